"""Engines: the same modules and the same time master, by calls in one process or by messages over DDS."""
