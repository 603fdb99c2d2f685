"""Bags: what a run leaves on disk, as a rosbag2 directory with one MCAP file."""
