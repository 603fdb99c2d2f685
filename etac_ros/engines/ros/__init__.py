"""The ros engine: the same modules and the same time master as in process, with messages over DDS for calls."""
