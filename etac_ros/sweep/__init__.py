"""Sweeps: many runs of one scenario over starts, noise and parameters, each of which can be run again alone."""
