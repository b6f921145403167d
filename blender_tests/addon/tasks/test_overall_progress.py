"""One progress bar for several jobs, tested on a recorded *Learn All* of the demo on two cores."""

import importlib

import numpy as np
import pytest

# job, stage of its events; first, last and total step; seconds since the start at first and last; number of events
PHASES = (
    ("geometry", "points", 16, 60, 60, 3.4, 5.1, 2),
    ("geometry", "geometry", 1, 101, 650, 14.3, 17.1, 2),  # the first ones are faster
    ("geometry", "geometry", 132, 650, 650, 18.6, 44.8, 18),
    ("segmentation", "surface", 65_536, 442_368, 442_368, 45.6, 46.2, 2),
    ("segmentation", "segmentation", 1, 150, 150, 49.5, 52.6, 3),
    ("recoloring", "recoloring", 1, 250, 250, 53.7, 62.1, 7),
    ("render", "render", 1, 1, 1, 63.7, 63.7, 1),
)
# for each job: seconds from the start to its end, and its expected duration
ENDS = {"geometry": 45.2, "segmentation": 53.4, "palette": 53.5, "recoloring": 62.1, "render": 63.7}
EXPECTED = {"geometry": 45.5, "segmentation": 10.0, "palette": 1.0, "recoloring": 10.4, "render": 1.0}
TOTAL = ENDS["render"]


class Event(dict):
    """Stands in for the engine's event."""

    kind = "progress"


def replay(course):
    """Yield the time of each event with the share done and the seconds left that are shown then."""
    current = "geometry"
    for job, stage, first, last, total, begin, end, count in PHASES:
        while job != current:
            course.begin_next(ENDS[current])
            current = list(ENDS)[list(ENDS).index(current) + 1]
        for now, step in zip(np.linspace(begin, end, count), np.linspace(first, last, count), strict=True):
            course.take(Event(stage=stage, step=round(step), total=total), job, now)
            yield now, course.share(), course.left()


@pytest.fixture
def course(addon):
    module = importlib.import_module(f"{addon.runner.__package__}.overall_progress")
    return lambda **seconds: module.OverallProgress(tuple((EXPECTED | seconds).values()), 0.0)


def test_bar_never_moves_back_and_ends_full(course):
    shares = [share for _, share, _ in replay(course())]
    assert shares == sorted(shares) and shares[0] < 0.1 and shares[-1] > 0.95


def test_time_left_is_within_a_third_after_a_tenth(course):
    for now, _, left in replay(course()):
        if now > TOTAL / 10:
            assert abs(left - (TOTAL - now)) < max((TOTAL - now) / 3, 5), f"{left:.0f} s at {now} of {TOTAL}"


def test_counted_steps_correct_a_wrong_estimate(course):
    for factor in (0.5, 2):
        wrong = {stage: seconds * factor for stage, seconds in EXPECTED.items()}
        for now, _, left in replay(course(**wrong)):
            if 0.6 * TOTAL < now < ENDS["geometry"]:
                assert abs(left - (TOTAL - now)) < (TOTAL - now) * 2 / 3, f"{left:.0f} s at {now} of {TOTAL}"


def test_cached_job_leaves_other_estimates_unchanged(course):
    progress = course()
    progress.begin_next(0.3)  # the scene was learned before
    assert progress.left() == pytest.approx(sum(EXPECTED.values()) - EXPECTED["geometry"])
