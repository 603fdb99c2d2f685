"""What the papers prove: every bound computed for a scenario, said to be vacuous where it is, and checked along a run.

One file a paper. A bound is computed from what the scenario says; constants of which a paper says only that they exist
(a largest disturbance, a bound on the dynamics) are the least that the run at hand allows, which flatters the theorem.
"""
