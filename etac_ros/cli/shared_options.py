"""What options of real time and of the live view mean together: the same for commands and for the executables."""

from __future__ import annotations

from etac_ros.errors import ScenarioError

QUIET_LEAST_S = 5.0
"""A shorter silence is no news on a busy machine."""


def rate_in_real_time(is_wall: bool, rate: float | None, strict: bool = False, priority: int = 0) -> float | None:
    """Simulated seconds a second of a run in real time, 1 unless it is given; None in simulated time.

    Raises
    ------
    ScenarioError
        If something is given that only means something in real time, without it.
    """
    if is_wall:
        return 1.0 if rate is None else rate
    for option, is_given in {"--strict": strict, f"--priority {priority}": priority != 0}.items():
        if is_given:
            raise ScenarioError(option, "is for --clock wall", "", "add --clock wall")
    return None


def port_of_live(live: bool, port: int | None) -> int | None:
    """Where a run is shown to Foxglove; None where it is not.

    Raises
    ------
    ScenarioError
        If there is a port, and nothing to show there.
    """
    if port is not None and not live:
        raise ScenarioError(f"--live-port {port}", "is for --live", "", "add --live")
    if not live:
        return None
    from etac_ros.bag.live import PORT

    return PORT if port is None else port


def check_quiet(seconds: float) -> None:
    """Refuse what would end runs on a busy machine.

    Raises
    ------
    ScenarioError
        If it is too short, or no time.
    """
    if not QUIET_LEAST_S <= seconds < float("inf"):
        raise ScenarioError(f"--quiet-s {seconds:g}", "is not allowed", f"{QUIET_LEAST_S:g} s or more")
