"""A whole experiment with a control law of one's own: how wide a dead zone the pointing bears.

$ python dead_zone.py
"""

from __future__ import annotations

from etac_ros.parameters import FloatArray, Parameters


class DeadZone:
    """u = -k s for the components of s that leave a dead zone; the others get no torque.

    Parameters
    ----------
    parameters
        ``k`` [N m s/rad] and ``zone`` [rad/s].
    ticks_per_second
        The grid of the scenario; this law has no use for it.
    """

    class Parameters(Parameters):
        """Both are given in the scenario; neither has a default."""

        k: float
        zone: float

    signal_size = 3
    command_size = 3

    def __init__(self, parameters: Parameters, ticks_per_second: int) -> None:
        self.k, self.zone = parameters.k, parameters.zone

    def command(self, signal: FloatArray) -> FloatArray:
        """The torque [N m] for a filtered error [rad/s]; asked once a message."""
        return -self.k * signal * (abs(signal) > self.zone)


def experiment() -> None:
    """Run the spacecraft of wu2018 with wider and wider zones, and print what each costs and gives."""
    from etac_ros.runs import load, run_in_process

    print(f"{'zone [rad/s]':>12}  {'triggers':>8}  {'steady error [deg]':>18}  {'energy [N²m²s]':>14}")
    for zone in (0.0, 1e-5, 1e-4, 1e-3):
        law = f"controller.law={{class: 'dead_zone:DeadZone', k: 26.113821209155528, zone: {zone}}}"
        summary = run_in_process(load("wu2018", None, [law])).summary
        error = summary.performance["/plant"].max_attitude_error_deg
        print(f"{zone:12g}  {summary.value('triggers'):8g}  {error:18.4f}  {summary.value('energy_n2m2s'):14.4f}")


if __name__ == "__main__":
    experiment()
