"""Estimated durations of presets, corrected by finished jobs."""

import pytest


@pytest.fixture
def speed(addon, monkeypatch, tmp_path):
    """The speed of a computer that learns from a million samples per second."""
    speed = addon.estimates.Speed("python", 2, 1e6)
    monkeypatch.setattr(addon.session.get(addon.estimates.ThisComputer), "speed", speed)
    monkeypatch.setattr(addon.estimates, "_file", lambda: tmp_path / "speed.json")
    return speed


def test_larger_presets_and_more_steps_take_longer(addon, speed, monkeypatch):
    def seconds(preset, button="learn_scene"):
        return addon.estimates.seconds(preset, button, False)

    presets = [seconds(name) for name in ("demo", "fast", "fine", "quality")]
    assert presets == sorted(presets) and presets[0] == pytest.approx(52)  # 650 iterations of 80,000 samples
    assert seconds("demo", "learn_all") > presets[0] and seconds("paper") is None
    monkeypatch.setattr(addon.session.get(addon.estimates.ThisComputer), "speed", None)  # not measured
    assert seconds("demo") is None


def test_finished_job_corrects_all_presets_and_is_saved(addon, speed, tmp_path):
    updated = speed.learned_from("geometry", 50.0, 100.0)
    assert updated.corrected({"geometry": 10.0, "segmentation": 5.0}) == {"geometry": 20.0, "segmentation": 5.0}
    assert updated.learned_from("geometry", 50.0, 50.0).factors == {"geometry": 1.5}
    assert speed.learned_from("geometry", 50.0, 3.0) is speed  # a resumed job
    updated.write(tmp_path / "speed.json")
    assert addon.estimates.read_speed(tmp_path / "speed.json", "python", 2) == updated
    assert addon.estimates.read_speed(tmp_path / "speed.json", "python", 1).samples_per_second == 0


def test_duration_of_a_job_is_measured(addon, speed, learned, monkeypatch):
    request = addon.engine_api.Request("geometry", addon.folders.project_of(learned).folder, {})
    state = {"stages": {"geometry": {"space": "box"}}, "settings": {"preset": "demo"}}
    monkeypatch.setattr(addon.engine_api.Project, "state", lambda self: state)
    addon.estimates._take_time(request, 104.0)
    assert addon.estimates.seconds("demo", "learn_scene", False) == pytest.approx(104)


@pytest.mark.parametrize("seconds, text", [(50, "a minute"), (430, "7 minutes"), (8000, "2 hours")])
def test_durations_are_rounded_for_people(addon, seconds, text):
    assert addon.learning.duration(seconds) == f"About {text} on this computer"
