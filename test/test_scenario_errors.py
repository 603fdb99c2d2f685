"""Bad input: every message names the file, the key, what was found, and what was expected; nothing is a traceback."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from etac_ros.errors import ScenarioError
from etac_ros.scenario.load import load

Small = Callable[..., Path]

TRIGGER = 'trigger: {class: "etac_ros.triggers.relative:RelativeThreshold", alpha: 0.5, gamma: 1e-6}'
INERTIA = "[2.0, 0.1, 0.0, 0.1, 3.0, 0.0, 0.0, 0.0, 4.0]"
QUATERNION = "attitude_q: [0.8, 0.6, 0.0, 0.0]"
TORQUE = "torque: {from: /actuator, to: [/plant], kind: physical}"
SIGNAL = "signal: {from: /sensor, to: [/controller], kind: network}"
WITH_SIGNAL = f"seed: 3\n    links:\n      {SIGNAL}"


def on_air(medium: str, joins: str = "air") -> str:
    """The signal on a medium, in the place of ``WITH_SIGNAL``."""
    joined = SIGNAL.replace("kind", f"medium: {joins}, kind")
    return f"seed: 3\n    media: {{air: {medium}}}\n    links:\n      {joined}"


TDMA = "class: 'etac_ros.media.tdma:Tdma'"

# What is replaced in the small scenario, by what, and parts of the message in their order.
IN_THE_FILE: dict[str, tuple[str, str, list[str]]] = {
    "unknown key of the run": (
        "seed: 3",
        "sede: 3",
        ["/**.sede: unknown key 'sede'", "'seed'?", "ticks_per_second"],
    ),
    "unknown key of a link": (
        SIGNAL,
        SIGNAL.replace("kind", "knid"),
        ["/**.links.signal", "kind: is missing", "knid: unknown key", "'kind'?"],
    ),
    "two delays": (
        SIGNAL,
        SIGNAL.replace("kind", "delay_ticks: 1, delay_s: 0.1, kind"),
        ["/**.links.signal", "delay_ticks and delay_s say the same thing"],
    ),
    "losses of two kinds": (
        SIGNAL,
        SIGNAL.replace("kind", "loss: 0.1, bursts: {good_s: 1.0, bad_s: 1.0}, kind"),
        ["/**.links.signal", "loss is of each message by itself, bursts has losses of its own"],
    ),
    "jitter of two kinds": (
        SIGNAL,
        SIGNAL.replace("kind", "jitter: {uniform_s: 0.1, normal_s: 0.1}, kind"),
        ["/**.links.signal.jitter", "uniform_s and normal_s are given"],
    ),
    "everything is lost": (
        SIGNAL,
        SIGNAL.replace("kind", "loss: 1.0, kind"),
        ["/**.links.signal.loss", "found 1.0", "less than 1"],
    ),
    "a medium nobody joins": (
        "seed: 3",
        "seed: 3\n    media: {air: {rate_bit_s: 1000.0}}",
        ["/**.media.air: no link joins it", "medium: air"],
    ),
    "a link on an unknown medium": (
        WITH_SIGNAL,
        on_air("{rate_bit_s: 1000.0}", "ari"),
        ["/**.links.signal.medium: there is no medium 'ari'", "air"],
    ),
    "torque on the air": (
        TORQUE,
        TORQUE.replace("kind", "medium: air, kind"),
        ["/**.links.torque.medium: a physical link carries light or torque"],
    ),
    "one power of two": (
        WITH_SIGNAL,
        on_air("{rate_bit_s: 1000.0, transmit_w: 0.05}"),
        ["/**.media.air", "transmit_w and receive_w belong together"],
    ),
    "a rate too low": (
        WITH_SIGNAL,
        on_air("{rate_bit_s: 80.0, overhead: ieee-802.15.4}"),
        ["/**.media.air.rate_bit_s: 80 bit/s cannot carry one frame of signal a second", "232 or more"],
    ),
    "slots that leave a sender out": (
        WITH_SIGNAL,
        on_air(f"{{rate_bit_s: 9600.0, access: {{{TDMA}, slot_s: 0.1, senders: [controller]}}}}"),
        ["/**.media.air.access: the slots leave out /sensor", "senders: [/sensor]"],
    ),
    "slots shorter than a frame": (
        WITH_SIGNAL,
        on_air(f"{{rate_bit_s: 9600.0, access: {{{TDMA}, slot_s: 0.001}}}}"),
        ["/**.media.air.access: a frame of link signal takes 0.01 s, longer than a slot", "slot_s: 0.01 or more"],
    ),
    "an order of links that are not there": (
        WITH_SIGNAL,
        on_air("{rate_bit_s: 9600.0, access: {class: 'etac_ros.media.priority:Priority', order: [sginal]}}"),
        ["/**.media.air.access: order names sginal", "signal"],
    ),
    "an access rule without a class": (
        WITH_SIGNAL,
        on_air("{rate_bit_s: 9600.0, access: {slot_s: 0.1}}"),
        ["/**.media.air.access: found", "a mapping with 'class'"],
    ),
    "an access rule of another kind": (
        WITH_SIGNAL,
        on_air("{rate_bit_s: 9600.0, access: {class: 'etac_ros.triggers.periodic:Periodic'}}"),
        ["/**.media.air.access.class: Periodic has no 'may_retry', 'turn'", "etac_ros.media.access:Access"],
    ),
    "unknown key of a node": (
        "reads: /plant",
        "reads: /plant\n    low_pas_s: 1.0",
        ["/sensor.low_pas_s: unknown key", "'low_pass_s'?"],
    ),
    "mistyped component": (
        TRIGGER,
        TRIGGER.replace("trigger", "triger", 1),
        ["/sensor.triger: unknown key 'triger'", "'trigger'?"],
    ),
    "mistyped key that all nodes have": (
        "module: controller",
        "modul: controller",
        ["/controller", "module: is missing"],
    ),
    "unknown key of a component": (
        "alpha: 0.5",
        "alfa: 0.5",
        ["/sensor.trigger", "alpha: is missing", "alfa: unknown key 'alfa'", "'alpha'?"],
    ),
    "unknown key far below": (
        QUATERNION,
        f"{QUATERNION}\n      disturbance: {{sinus_nm: [0, 0, 0]}}",
        ["/plant.dynamics.disturbance.sinus_nm: unknown key", "'sine_nm'?"],
    ),
    "no number": ("beta: 0.5", "beta: much", ['/sensor.signal.beta: found "much"', "expected: a number"]),
    "a number in quotes": ("beta: 0.5", "beta: '0.5'", ['/sensor.signal.beta: found "0.5"', "expected: a number"]),
    "not a number": ("beta: 0.5", "beta: .nan", ["/sensor.signal.beta: found NaN", "expected: a finite number"]),
    "no whole number": ("seed: 3", "seed: 3.5", ["/**.seed: found 3.5", "expected: a whole number"]),
    "a date": ("beta: 0.5", "beta: 2024-01-01", ['/sensor.signal.beta: found "2024-01-01"', "expected: a number"]),
    "no list": (INERTIA, "3.0", ["/plant.dynamics.inertia_kg_m2: found 3.0", "expected: a list"]),
    "no mapping": (
        'signal: {class: "etac_ros.laws.wu2018:FilteredError", beta: 0.5}',
        "signal: 3",
        ["/sensor.signal: found 3", "expected: a mapping with the key 'class'"],
    ),
    "too few numbers": (
        INERTIA,
        "[2.0, 0.1, 0.0, 0.1, 3.0]",
        ["/plant.dynamics.inertia_kg_m2: found 5 values", "expected: 9 values"],
    ),
    "too many numbers": (
        QUATERNION,
        "attitude_q: [1, 0, 0, 0, 0]",
        ["/plant.dynamics.attitude_q: found 5 values", "expected: 4 values"],
    ),
    "a matrix of lists": (
        INERTIA,
        "[[2, 0, 0], [0, 3, 0], [0, 0, 4]]",
        ["/plant.dynamics.inertia_kg_m2: found a list of lists", "expected: one list of 9, row by row"],
    ),
    "a text among the numbers": (
        QUATERNION,
        "attitude_q: [1, 0, zero, 0]",
        ['/plant.dynamics.attitude_q[2]: found "zero"', "expected: a number"],
    ),
    "receivers that are no list": (
        "to: [/plant]",
        "to: /plant",
        ['/**.links.torque.to: found "/plant"', "expected: a list"],
    ),
    "quaternion of another norm": (
        QUATERNION,
        "attitude_q: [0.8, 0.6, 0.1, 0.0]",
        [
            "/plant.dynamics.attitude_q: found [0.8, 0.6, 0.1, 0.0]",
            "a unit quaternion, scalar first; the norm is 1.00498756",
        ],
    ),
    "inertia that is not positive definite": (
        INERTIA,
        "[2.0, 0.0, 0.0, 0.0, -3.0, 0.0, 0.0, 0.0, 4.0]",
        ["/plant.dynamics.inertia_kg_m2: found [2.0,", "a positive definite matrix; the smallest eigenvalue is -3"],
    ),
    "singular inertia": (
        INERTIA,
        "[2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0]",
        ["/plant.dynamics.inertia_kg_m2: found", "a positive definite matrix"],
    ),
    "inertia that is not symmetric": (
        INERTIA,
        "[2.0, 0.1, 0.0, 0.2, 3.0, 0.0, 0.0, 0.0, 4.0]",
        ["/plant.dynamics.inertia_kg_m2: found [2.0,", "expected: a symmetric matrix"],
    ),
    "two attitudes": (
        QUATERNION,
        f"{QUATERNION}\n      attitude_euler_deg: [1, 2, 3]",
        ["/plant.dynamics: attitude_q and attitude_euler_deg are given", "expected: exactly one of"],
    ),
    "no attitude": (QUATERNION, "substeps: 1", ["/plant.dynamics: none of them is given", "exactly one of attitude_q"]),
    "alpha of one": ("alpha: 0.5", "alpha: 1.0", ["/sensor.trigger.alpha: found 1.0", "expected: less than 1"]),
    "alpha of nought": ("alpha: 0.5", "alpha: 0.0", ["/sensor.trigger.alpha: found 0.0", "expected: greater than 0"]),
    "a part of a tick": (
        "duration_s: 20.0",
        "duration_s: 20.05",
        ["/**.duration_s: 20.05 s is no whole number of ticks of 1/10 s", "20 s and 20.1 s"],
    ),
    "no duration": ("duration_s: 20.0", "duration_s: 0", ["/**.duration_s: found 0", "expected: greater than 0"]),
    "a period that is a part of a tick": (
        TRIGGER,
        'trigger: {class: "etac_ros.triggers.periodic:Periodic", period_s: 0.25}',
        ["/sensor.trigger: 0.25 s is no whole number of ticks of 1/10 s"],
    ),
    "windows the wrong way round": (
        "seed: 3",
        "windows: {first: 9, longest: 3}",
        ["/**.windows: first is 9, and must be no longer than the longest, 3"],
    ),
    "a class that is nowhere": (
        "etac_ros.triggers.relative:RelativeThreshold",
        "no_such_package.rules:Mine",
        ["/sensor.trigger.class: 'no_such_package.rules' cannot be imported", "ModuleNotFoundError", "PYTHONPATH"],
    ),
    "a class that is not in its module": (
        "relative:RelativeThreshold",
        "relative:RelativeTreshold",
        ["/sensor.trigger.class: 'etac_ros.triggers.relative' has no class 'RelativeTreshold'", "'RelativeThreshold'?"],
    ),
    "a class without its module": (
        "etac_ros.triggers.relative:RelativeThreshold",
        "RelativeThreshold",
        ["/sensor.trigger.class: found 'RelativeThreshold'", "expected: a class as package.module:Class"],
    ),
    "a law in the place of a trigger rule": (
        TRIGGER,
        'trigger: {class: "etac_ros.laws.wu2018:Proportional", k: 2.0}',
        [
            "/sensor.trigger.class: Proportional has no 'first', 'margin'",
            "a class like etac_ros.triggers.rule:TriggerRule",
        ],
    ),
    "a trigger rule in the place of a module": (
        "module: controller",
        "module: etac_ros.triggers.periodic:Periodic",
        ["/controller.module: etac_ros.triggers.periodic:Periodic is no module", "a subclass of"],
    ),
    "unknown kind of node": (
        "module: sensor",
        "module: sensr",
        ["/sensor.module: found 'sensr'", "'sensor'?", "plant, sensor, controller, actuator"],
    ),
    "a component without a class": (
        'law: {class: "etac_ros.laws.wu2018:Proportional", k: 2.0}',
        "law: {k: 2.0}",
        ['/controller.law: found {"k": 2.0}', "a mapping with the key 'class'"],
    ),
    "no component": (
        '    law: {class: "etac_ros.laws.wu2018:Proportional", k: 2.0}\n',
        "",
        ["/controller.law: is missing", "a mapping with the key 'class'"],
    ),
    "a link to nowhere": (
        "to: [/controller]",
        "to: [/controler]",
        ["/**.links.signal.to: there is no node '/controler'", "'/controller'?"],
    ),
    "a link from nowhere": (
        "from: /sensor",
        "from: /senzor",
        ["/**.links.signal.from: there is no node '/senzor'", "'/sensor'?"],
    ),
    "unknown input": (
        "to: [/plant]",
        "to: ['/plant:force']",
        ["/**.links.torque.to: 'force' is no input of /plant", "NODE:PORT", "torque"],
    ),
    "unknown output": (
        "from: /sensor",
        "from: '/sensor:state'",
        ["/**.links.signal.from: 'state' is no output of /sensor", "signal"],
    ),
    "a link from what sends nothing": (
        "from: /actuator",
        "from: /plant",
        ["/**.links.torque.from: there is no output of /plant"],
    ),
    "one receiver twice": (
        "to: [/plant]",
        "to: [/plant, '/plant:torque']",
        ["/**.links.torque.to: /plant stands there twice"],
    ),
    "no receivers": ("to: [/plant]", "to: []", ["/**.links.torque.to: found []", "at least 1 item"]),
    "an input that nobody feeds": (
        TORQUE,
        TORQUE.replace("/plant", "/actuator"),
        ["/plant: input 'torque' is fed by no link", "expected: a link to it"],
    ),
    "two links on one topic": (
        SIGNAL,
        SIGNAL.replace("kind", "topic: /command, kind"),
        ["/**.links: topic /command is used by signal and command", "a topic of its own"],
    ),
    "a topic that ROS refuses": (
        SIGNAL,
        SIGNAL.replace("kind", "topic: /my signal, kind"),
        ["/**.links.signal.topic: '/my signal' is no ROS topic"],
    ),
    "unknown kind of link": (
        SIGNAL,
        SIGNAL.replace("network", "netwerk"),
        ['/**.links.signal.kind: found "netwerk"', "'network', 'internal' or 'physical'"],
    ),
    "unknown wire": (
        "seed: 3",
        "wire: exact",
        ['/**.wire: found "exact"', "'compact', 'stamped' or 'double'"],
    ),
    "a delay that is no whole number of ticks": (
        SIGNAL,
        SIGNAL.replace("kind", "delay_ticks: 0.5, kind"),
        ["/**.links.signal.delay_ticks: found 0.5", "expected: a whole number"],
    ),
    "a loss of everything": (
        SIGNAL,
        SIGNAL.replace("kind", "loss: 1.0, kind"),
        ["/**.links.signal.loss: found 1.0", "expected: less than 1"],
    ),
    "a sensor of nothing": ("    reads: /plant\n", "", ["/sensor: a sensor needs a plant", "'reads'"]),
    "a sensor of no plant": (
        "reads: /plant",
        "reads: /actuator",
        ["/sensor.reads: '/actuator' is no plant", "one of: /plant"],
    ),
    "a controller that sees": (
        "module: controller",
        "module: controller\n    reads: /plant",
        ["/controller.reads: a module that only answers"],
    ),
    "a name that ROS refuses": (
        "/actuator:\n",
        "/my-actuator:\n",
        ["/my-actuator: is no name of a ROS node", "letters, digits and _"],
    ),
    "a node twice": ("/actuator:\n", "sensor:\n", ["sensor: stands in the file twice"]),
    "a key twice": ("seed: 3", "seed: 3\n    seed: 4", ["line 7, column 5: the key 'seed' stands twice"]),
    "no ros__parameters": (
        "/actuator:\n  ros__parameters:\n    module: actuator",
        "/actuator:\n  module: actuator",
        ['/actuator: found {"module": "actuator"}', "one key 'ros__parameters'"],
    ),
    "broken YAML": ("[2.0, 0.1,", "[2.0, 0.1: :,", ["line 19, column", "valid YAML"]),
    "a tab": ("    seed: 3", "\tseed: 3", ["line 6, column 1", "valid YAML"]),
    "variants that are a list": (
        "    variants:\n",
        "    variants: []\n    published:\n",
        ["/**.published.patient"],
    ),
    "a variant that is no mapping": (
        "patient: {duration_s: 30.0, sensor: {trigger: {alpha: 0.9}}}",
        "patient: 30.0",
        ["/**.variants.patient: found 30.0", "a mapping"],
    ),
}


def message_of(path: Path, variant: str | None = None, *overrides: str) -> str:
    with pytest.raises(ScenarioError) as caught:
        load(str(path), variant, overrides)
    return str(caught.value)


def assert_in_order(parts: list[str], message: str) -> None:
    assert re.search(".*".join(re.escape(part) for part in parts), message, re.DOTALL), message


@pytest.mark.parametrize("case", IN_THE_FILE)
def test_fault_in_the_file(case: str, small: Small) -> None:
    old, new, parts = IN_THE_FILE[case]
    path = small((old, new))
    message = message_of(path)
    assert_in_order([str(path), *parts], message)
    assert "Input should be" not in message


def test_the_small_scenario_itself_is_right(small: Small) -> None:
    assert load(str(small())).name == "small"


def test_every_fault_is_reported(small: Small) -> None:
    message = message_of(small(("seed: 3", "seed: -1\n    wire: paper\n    titel: x")))
    assert_in_order(["/**: 3 faults", "seed: found -1", 'wire: found "paper"', "'title'?"], message)


WIDE = """
from etac_ros.graph.module import Module
from etac_ros.graph.role import Acts, Role

class Answer(Module):
    role = Role(Acts.AT_ONCE)
    SIZES = 3, 3

    def __init__(self, context, parameters):
        super().__init__(context)
        self.inputs, self.outputs = {"signal": self.SIZES[0]}, {"command": self.SIZES[1]}

class Widen(Answer):
    SIZES = 3, 5

class Narrow(Answer):
    SIZES = 5, 3
"""


def test_five_components(small: Small, monkeypatch: pytest.MonkeyPatch) -> None:
    widened = (
        ("module: controller\n", "module: wide_for_errors:Widen\n"),
        ('    law: {class: "etac_ros.laws.wu2018:Proportional", k: 2.0}\n', ""),
    )
    path = small(*widened)
    (path.parent / "wide_for_errors.py").write_text(WIDE)
    monkeypatch.syspath_prepend(path.parent)
    parts = ["/**.links.command.to: /actuator:command takes 3 components, /controller:command sends 5"]
    assert_in_order([str(path), *parts, "equal sizes"], message_of(path))

    path = small(*widened, ("module: actuator\n", "module: wide_for_errors:Narrow\n"))
    assert load(str(path)).build().links["command"].wire.type_name == "std_msgs/msg/Float32MultiArray"
    parts = ["/**.links.command.wire: no stamped message", "carries 5 components", "[3, 4, 6]", "compact"]
    assert_in_order([str(path), *parts], message_of(path, None, "wire=stamped"))


OVERRIDES: dict[str, tuple[str, list[str]]] = {
    "no assignment": ("seed", ["--set seed", "is no assignment", "key=value"]),
    "no key": ("=3", ["--set =3", "is no assignment"]),
    "unknown key": ("duration=3", ["--set duration: unknown key 'duration'", "'duration_s'?"]),
    "unknown node": ("senzor.low_pass_s=3", ["--set senzor.low_pass_s: unknown key 'senzor'", "'sensor'?"]),
    "unknown component": ("sensor.triger.alpha=1", ["/sensor.triger: unknown key 'triger'", "'trigger'?"]),
    "unknown parameter": ("sensor.trigger.alhpa=1", ["/sensor.trigger.alhpa: unknown key", "'alpha'?"]),
    "below a number": ("sensor.trigger.alpha.x=1", ['/sensor.trigger.alpha: found {"x": 1}', "a number"]),
    "a whole node": ("sensor=3", ["--set sensor: names a whole node", "sensor.KEY=VALUE"]),
    "no YAML": ("title=[1", ["--set title: line ", "valid YAML"]),
    "nothing": ("seed=", ["/**.seed: found null", "a whole number"]),
    "alpha": ("sensor.trigger.alpha=1", ["small.yaml: /sensor.trigger.alpha: found 1", "less than 1"]),
    "five numbers": ("plant.dynamics.inertia_kg_m2=[1,2,3,4,5]", ["inertia_kg_m2: found 5 values", "9 values"]),
    "another class with old keys": (
        "sensor.trigger.class=etac_ros.triggers.periodic:Periodic",
        ["/sensor.trigger.period_s: is missing"],
    ),
    "the name of a link": ("links.signl.loss=0.1", ["/**.links.signl", "from: is missing"]),
    "a variant's block": ("variants.patient.seed=1", ["--set variants.patient.seed: unknown key 'variants'"]),
}


@pytest.mark.parametrize("case", OVERRIDES)
def test_fault_in_an_override(case: str, small: Small) -> None:
    assignment, parts = OVERRIDES[case]
    assert_in_order(parts, message_of(small(), None, assignment))


def test_attitude_given_in_two_ways_tells_the_way_out(small: Small) -> None:
    path = small((QUATERNION, "attitude_euler_deg: [10, 5, -5]"))
    way_out = "plant.dynamics.attitude_euler_deg=null"
    override = "plant.dynamics.attitude_q=[1,0,0,0]"
    message = message_of(path, None, override)
    assert_in_order(
        [str(path), "/plant.dynamics: attitude_q and attitude_euler_deg are given", f"--set {way_out}"], message
    )
    assert load(str(path), overrides=[override, way_out]).nodes["/plant"]["dynamics"]["attitude_q"] == [1, 0, 0, 0]


def test_unknown_variant_names_the_nearest(small: Small) -> None:
    path = small()
    parts = [str(path), "variants", "no variant 'patent'", "'patient'?", "clocked"]
    assert_in_order(parts, message_of(path, "patent"))


def test_variant_with_an_unknown_node(small: Small) -> None:
    path = small(("sensor: {trigger: {alpha: 0.9}}", "senzor: {trigger: {alpha: 0.9}}"))
    parts = [str(path), "variants.patient.senzor", "unknown key 'senzor'", "'sensor'?"]
    assert_in_order(parts, message_of(path, "patient"))


def test_unknown_scenario_names_the_nearest() -> None:
    with pytest.raises(ScenarioError, match=r"scenario 'wu2081'.*\n.*'wu2018'\?"):
        load("wu2081")


def test_missing_file(tmp_path: Path) -> None:
    assert_in_order([str(tmp_path / "none.yaml"), "no such file"], message_of(tmp_path / "none.yaml"))


@pytest.mark.parametrize("content", [b"", b"- 1\n", b"text", b"a: {ros__parameters: {}}\n"])
def test_file_that_is_no_scenario(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "other.yaml"
    path.write_bytes(content)
    assert_in_order([str(path), "is not a scenario file", "'/**'"], message_of(path))


def test_file_that_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "binary.yaml"
    path.write_bytes(b"\xff\xfe\x00")
    assert_in_order([str(path), "line 1", "no UTF-8"], message_of(path))


def test_empty_file_of_a_scenario_says_what_is_missing(tmp_path: Path) -> None:
    path = tmp_path / "empty.yaml"
    path.write_text("/**:\n  ros__parameters: {}\n")
    parts = ["scenario: is missing", "ticks_per_second: is missing", "duration_s: is missing", "links: is missing"]
    assert_in_order(parts, message_of(path))


def test_scenario_without_a_plant(tmp_path: Path) -> None:
    path = tmp_path / "none.yaml"
    path.write_text("/**: {ros__parameters: {scenario: none, ticks_per_second: 1, duration_s: 1, links: {}}}\n")
    assert_in_order([str(path), "no node is a plant", "module: plant"], message_of(path))
