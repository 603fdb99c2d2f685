"""Modules: plant, sensor, controller, actuator, and the links between them. Explicit state, no I/O."""
