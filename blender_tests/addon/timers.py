"""Timers without Blender's window loop: the tests are the loop."""

import time


def run_to_end(tick, seconds=20):
    """Call a timer's function until it ends itself."""
    deadline = time.monotonic() + seconds
    while tick() is not None:
        assert time.monotonic() < deadline, "the timer does not end"
        time.sleep(0.02)
