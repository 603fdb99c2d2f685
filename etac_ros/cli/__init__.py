"""The command line: ``etac``, and the node executables of ``ros2 run etac_ros``."""
