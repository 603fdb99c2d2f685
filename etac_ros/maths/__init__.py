"""Maths: conventions said once, and the compiled kernels that both engines share.

Conventions of the whole package
--------------------------------
Quaternion
    ``q_BN = [q0, q1, q2, q3]``, scalar first, unit norm: the attitude of the body frame B relative to the
    reference frame N. It is the vector part that the papers call ``q_v``; kinematics as in wu2018 eqs. (2)-(3),
    ``q_v_dot = (q_v^x + q0 I) w / 2``, ``q0_dot = -q_v . w / 2``.
MRP
    ``p = e tan(angle / 4)`` of the same rotation, ``p_dot = G(p) w``; see :mod:`etac_ros.maths.mrp`.
Frames
    ``dcm_BN`` takes components in N to components in B. ``omega_BN_B`` is the angular velocity of B relative
    to N, written in B. Torques are written in B.
Euler angles
    3-2-1 (yaw, pitch, roll) rotations from N to B, given and reported as ``[roll, pitch, yaw]``.
Units
    SI inside: rad, rad/s, N m, kg m^2, s. Degrees only where a name ends in ``_deg`` or ``_deg_s``.
Time
    An integer tick of the scenario's grid; :func:`etac_ros.maths.ticks.seconds` is the one way to seconds.
"""
