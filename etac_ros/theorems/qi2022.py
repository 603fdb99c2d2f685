"""Theorems 1 and 2 of qi2022: the decrease of V, and the least interval."""

from __future__ import annotations

import numpy as np

from etac_ros.parameters import square
from etac_ros.theorems.bound import Lyapunov, Theorems, at_least, at_most, everywhere
from etac_ros.theorems.evidence import Evidence, norms

_SENSOR = "/pm/relative_sensor"


def theorems(evidence: Evidence) -> Theorems:
    """Every bound of the paper along a run.

    The proof of theorem 1 puts the law's torque of every instant into V', not the held one, and the law's feed-forward
    cancels panels and disturbances exactly; ``K_p`` is taken for one number, the mean of its diagonal.
    """
    plant = "/sim/plant"
    law = evidence.parameters(_SENSOR, "law")
    states, times = evidence.states(plant), evidence.times_s(plant)
    q_0, omega = states[:, 7], states[:, 11:14]
    inertia = square(tuple(law["inertia_sm_kg_m2"]))
    spring = float(np.mean(law["attitude_gain_nm"]))
    V = 0.5 * np.sum(omega * (omega @ inertia.T), axis=1) + spring * (1.0 - np.abs(q_0))
    V_dot = -np.sum(omega**2 * np.asarray(law["rate_gain_nms"]), axis=1)
    trigger = evidence.trigger(_SENSOR)
    tau = trigger.shown.rows[:, :3]
    steepest = float(norms(np.diff(tau, axis=0)).max()) / evidence.tick_s
    least = float(trigger.compared.thresholds.min()) / steepest
    change = np.diff(V) / evidence.tick_s
    return Theorems(
        bounds=(
            everywhere("(16)", "V' <= 0", change, np.zeros(change.size), "the held torque is not that of the proof"),
            everywhere(
                "(16)",
                "V' <= -omega' K_d omega",
                change,
                np.maximum(V_dot[:-1], V_dot[1:]),
                "as above; panels and disturbances are not cancelled either",
            ),
            at_most(
                "theorem 1",
                "V at the end, of V at the start: tends to 0",
                1.0,
                float(V[-1] / V[0]),
                note="asymptotic stability bounds nothing at a finite time",
            ),
            at_most(
                "(17), (18)",
                "|tau_cons'| has a bound",
                steepest,
                steepest,
                "N m/s",
                0.0,
                "that gamma exists is all that is said; printed for |tau_cons|",
            ),
            at_least(
                "(18)",
                "shortest interval",
                least,
                float(trigger.intervals_s.min()),
                "s",
                evidence.tick_s,
                "epsilon |X| / gamma with the least |X| of this run: it tends to 0 with the error",
            ),
        ),
        lyapunov=Lyapunov("(14)", times, V, np.full(times.size, V[0])),
    )
