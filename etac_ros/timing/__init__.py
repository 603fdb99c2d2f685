"""The time protocol without I/O: who may advance time, and when. ``docs/timing.md`` says it in words."""
