"""What the tests share."""

from __future__ import annotations

from hypothesis import settings

# The same examples each time, and no limit on their time: a test fails only when the code is wrong.
settings.register_profile("etac", deadline=None, derandomize=True, database=None, max_examples=60)
settings.load_profile("etac")
