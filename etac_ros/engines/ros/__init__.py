"""The ros engine: the same modules and the same time master as in process, with messages over DDS for calls."""

import sys

LOADED_BEFORE = "rclpy" in sys.modules
"""Whether the program had loaded rclpy before it loaded anything of this room."""
