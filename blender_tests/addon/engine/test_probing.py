"""Test Engine never blocks the interface, and its verdict belongs to the Python that was asked."""

import os
import sys
from pathlib import Path

import pytest

from ..layout import Layout
from ..timers import run_to_end


def sleeper(folder):
    """A Python that does not answer."""
    script = folder / "slow python"
    script.write_text("#!/bin/sh\nsleep 60 & wait\n")
    script.chmod(0o755)
    return script


def shown(bpy, preferences):
    drawn = []
    preferences.__class__.draw(Drawn(preferences, Layout(bpy, drawn)), None)
    return drawn


class Drawn:
    """Preferences as Blender draws them: with a layout."""

    def __init__(self, preferences, layout):
        object.__setattr__(self, "_preferences", preferences)
        self.layout = layout

    def __getattr__(self, name):
        return getattr(self._preferences, name)


def test_a_test_runs_beside_the_interface(bpy, addon, chosen):
    addon.probing._begin(Path(sys.executable))
    assert addon.probing.is_running() and not bpy.ops.karf.examine_engine.poll()
    run_to_end(addon.probing._tick)
    assert "lacks torch" in addon.probing.verdict_on(Path(sys.executable)).sentence
    assert not addon.probing.is_running()


@pytest.mark.skipif(os.name == "nt", reason="a shell script stands in for Python")
def test_a_test_that_hangs_is_cancelled(bpy, addon, chosen, tmp_path):
    addon.probing._begin(sleeper(tmp_path))
    process = addon.probing._Memory.probe._process
    assert addon.probing._tick() == addon.probing.POLL_SECONDS
    assert bpy.ops.karf.cancel_examination() == {"FINISHED"}
    assert process.poll() is not None and not addon.probing.is_running()


@pytest.mark.skipif(os.name == "nt", reason="a shell script stands in for Python")
def test_disabling_the_extension_ends_the_test_and_its_timer(bpy, addon, chosen, tmp_path):
    addon.probing._begin(sleeper(tmp_path))
    process = addon.probing._Memory.probe._process
    bpy.app.timers.register(addon.probing._tick, first_interval=60, persistent=True)
    addon.preferences.unregister()
    addon.preferences.register()
    assert process.poll() is not None and not bpy.app.timers.is_registered(addon.probing._tick)


@pytest.mark.skipif(os.name == "nt", reason="a shell script stands in for Python")
def test_a_python_that_never_answers_is_given_up(addon, chosen, tmp_path, monkeypatch):
    monkeypatch.setattr(addon.environment, "TIMEOUT", 0.1)
    addon.probing._begin(sleeper(tmp_path))
    run_to_end(addon.probing._tick)
    assert "no answer" in addon.probing.verdict_on(sleeper(tmp_path)).sentence


def test_the_verdict_is_that_of_the_python_it_was_given_on(bpy, addon, chosen, tmp_path):
    chosen.engine_python = sys.executable
    with pytest.raises(RuntimeError, match="lacks torch"):
        bpy.ops.karf.examine_engine()
    assert any("lacks torch" in text for text in shown(bpy, chosen)) and chosen.command
    chosen.engine_python = str(tmp_path / "another")
    assert not any("lacks torch" in text for text in shown(bpy, chosen)) and not chosen.command
    with pytest.raises(RuntimeError, match="does not run"):
        bpy.ops.karf.examine_engine()
    assert any("does not run" in text for text in shown(bpy, chosen))


def test_a_failed_test_takes_the_place_of_an_earlier_verdict(bpy, addon, chosen, tmp_path):
    python = tmp_path / "python"
    python.symlink_to(sys.executable)
    chosen.engine_python = str(python)
    with pytest.raises(RuntimeError, match="lacks torch"):
        bpy.ops.karf.examine_engine()
    python.unlink()
    with pytest.raises(RuntimeError, match="does not run"):
        bpy.ops.karf.examine_engine()
    drawn = shown(bpy, chosen)
    assert any("does not run" in text for text in drawn) and not any("lacks" in text for text in drawn)
