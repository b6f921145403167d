"""How long stages take follows from how fast a computer learns."""

from dataclasses import replace

import pytest

from karf_engine.cli import smoke
from karf_engine.project.settings import PRESETS, seconds_of_stages


def test_the_speed_is_that_of_the_iterations_behind_the_first(monkeypatch):
    from karf_engine import api

    times = iter((0.0, 5.0, 5.5, 6.5))
    monkeypatch.setattr(smoke.time, "perf_counter", lambda: next(times))

    def learn(*_, emit, **__):
        emit("stage", name="geometry")
        for step in (4, 12, 20, 40):
            emit("progress", stage="geometry", step=step)

    monkeypatch.setattr(api, "learn_geometry", learn)
    assert smoke.samples_per_second() == pytest.approx(smoke.REAL_SPEED * smoke.SAMPLES * 28 / 1.5)


def test_twice_as_fast_takes_half_as_long_and_open_space_longer():
    slow, fast = (seconds_of_stages(PRESETS["demo"], rate) for rate in (1e5, 2e5))
    assert all(slow[stage] == 2 * fast[stage] for stage in ("geometry", "segmentation", "recoloring", "splats"))
    assert seconds_of_stages(PRESETS["demo"], 1e5, is_open=True)["geometry"] > slow["geometry"]


def test_splats_that_are_not_asked_for_take_no_time_and_large_photos_no_longer_than_their_windows():
    demo = PRESETS["demo"]

    def seconds(**changes):
        return seconds_of_stages(replace(demo, splats=replace(demo.splats, **changes)), 1e6)["splats"]

    assert seconds(iterations=0) == 0 < seconds(long_side=200) < seconds(long_side=400) == seconds(long_side=4000)


def test_a_nerf_was_not_measured():
    assert seconds_of_stages(PRESETS["paper"], 1e6) is None
