"""The progress of a task of several jobs with expected durations: one bar for all, and the time left. No bpy."""

from collections.abc import Sequence
from math import sqrt

from ..engine_api import Event

TRUST = 2.0  # weight of the time left by counting steps, per share of the job done
CACHED = 0.3  # a job that takes less than this share of its expected time had been done before


class OverallProgress:
    """Follows the events of a task's jobs. All times are in seconds of one clock."""

    def __init__(self, expected: Sequence[float], now: float) -> None:
        self._expected = tuple(expected)
        self._number = 0
        self._start = self._began = self._last_event = now
        self._spent = self._promised = 0.0  # by the jobs that are done and had work to do
        self._left = self._expected[0]  # of the current job
        self._share = 0.0
        self._steps: list[tuple[float, int]] = []  # times and counts

    def begin_next(self, now: float) -> None:
        """Begin the next job; the current one is done."""
        taken, expected = now - self._began, self._expected[self._number]
        if taken > CACHED * expected:
            self._spent, self._promised = self._spent + taken, self._promised + expected
        self._number += 1
        self._began = self._last_event = now
        self._steps = []
        self._left = self._expected[self._number] * _pace(self._spent, self._promised)

    def take(self, event: Event, stage: str, now: float) -> None:
        """Process a progress event of the current job; events of other stages than `stage` are preparations."""
        self._last_event = now
        expected = self._expected[self._number] * _pace(self._spent, self._promised)
        expected = max(expected - (now - self._began), 0.0)
        counted = self._count(event, now) if event["stage"] == stage else None
        trust = 0.0 if counted is None else min(1.0, TRUST * event["step"] / max(event["total"], 1))
        self._left = trust * (counted or 0.0) + (1 - trust) * expected

    def _count(self, event: Event, now: float) -> float | None:
        """Return the seconds left by the later half of the steps since the first event (before it, kernels compile)."""
        self._steps = [each for each in self._steps if 2 * each[1] >= event["step"]] + [(now, event["step"])]
        start, first = self._steps[0]
        passed = event["step"] - first
        return (event["total"] - event["step"]) * (now - start) / passed if passed else None

    def left(self) -> float:
        """Return the seconds left for all jobs, as of the last event."""
        current, done = self._expected[self._number], self._last_event - self._began
        pace = _pace(self._spent + done + self._left, self._promised + current)
        return self._left + pace * sum(self._expected[self._number + 1 :])

    def share(self) -> float:
        """Return the share done of all jobs, 0 to 1; it never falls."""
        passed = self._last_event - self._start
        self._share = max(self._share, passed / max(passed + self.left(), 1e-6))
        return self._share


def _pace(taken: float, promised: float) -> float:
    """Return by what factor other jobs will take longer than expected, judging by those that are done."""
    # half of their factor, in the logarithm, is due to the computer; the rest to these jobs
    return sqrt(taken / promised) if promised else 1.0
