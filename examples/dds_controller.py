"""The controller once more without ROS: another DDS implementation, the PyPI package cyclonedds, and nothing else.

Nothing but DDS is needed to take part. What ROS adds to the names: the topic /a/b is called rt/a/b in DDS, and the type
geometry_msgs/msg/Point32 is called geometry_msgs::msg::dds_::Point32_.

  ./scripts/run wu2018 --set controller.external=true --domain 7 --clock wall --rate 20
  python examples/dds_controller.py --domain 7 --signal /filtered_error --command /torque_command --gain -26.1138

  ./scripts/run qi2022 --set sm/controller.external=true --domain 7 --clock wall
  python examples/dds_controller.py --domain 7 --signal /pm/relative --command /sm/torque_s
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float32
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

# A launched run keeps to the loopback, and its processes are looked for by unicast.
LOOPBACK = """
<CycloneDDS><Domain>
  <General>
    <Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>
    <AllowMulticast>false</AllowMulticast>
  </General>
  <Discovery>
    <ParticipantIndex>auto</ParticipantIndex>
    <MaxAutoParticipantIndex>100</MaxAutoParticipantIndex>
    <Peers><Peer address="127.0.0.1"/></Peers>
  </Discovery>
</Domain></CycloneDDS>
"""


@dataclass
class Point32(IdlStruct, typename="geometry_msgs::msg::dds_::Point32_"):
    """The ROS message geometry_msgs/msg/Point32."""

    x: float32
    y: float32
    z: float32


def main() -> None:
    """Answer until interrupted."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--domain", type=int, default=0)
    parser.add_argument("--signal", default="/filtered_error")
    parser.add_argument("--command", default="/torque_command")
    parser.add_argument("--gain", type=float, default=1.0)
    given = parser.parse_args()
    domain = Domain(given.domain, LOOPBACK)
    participant = DomainParticipant(given.domain)
    qos = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.Durability.Volatile, Policy.History.KeepLast(10))
    reader = DataReader(participant, Topic(participant, f"rt{given.signal}", Point32), qos)
    writer = DataWriter(participant, Topic(participant, f"rt{given.command}", Point32), qos)
    waits = WaitSet(participant)
    waits.attach(ReadCondition(reader, SampleState.NotRead | ViewState.Any | InstanceState.Alive))
    print("ready", flush=True)
    try:
        while True:
            waits.wait(duration(milliseconds=200))
            for signal in reader.take(10):
                if isinstance(signal, Point32):
                    writer.write(Point32(given.gain * signal.x, given.gain * signal.y, given.gain * signal.z))
    except KeyboardInterrupt:
        pass
    del domain


if __name__ == "__main__":
    main()
