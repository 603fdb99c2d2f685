"""Event-triggered attitude control of spacecraft as a graph of networked modules over ROS 2."""

__version__ = "0.1.0"
