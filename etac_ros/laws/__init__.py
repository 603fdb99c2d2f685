"""Control laws: one file a paper.

A law is split where the network cuts it: the signal that the sensor module forms and transmits, and the torque that
the controller computes from what arrived.
"""
