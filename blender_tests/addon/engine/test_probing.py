"""Test Engine never blocks the interface, shows what it finds as it finds it, and its findings belong to one Python."""

import os
import sys
from pathlib import Path

import pytest

from ..layout import drawn_preferences as shown
from ..timers import run_to_end

pytestmark = pytest.mark.skipif(os.name == "nt", reason="shell scripts stand in for Python")


@pytest.fixture
def script(tmp_path):
    """A function that writes a shell script used as the engine's Python."""

    def script(text):
        path = tmp_path / "a python"
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(0o755)
        return path

    return script


@pytest.fixture
def saying(script, tmp_path):
    """A function that writes a Python which prints lines, then runs a command."""

    def saying(said, then=""):
        (tmp_path / "lines").write_text(said)
        return script(f"cat '{tmp_path / 'lines'}'; {then}")

    return saying


@pytest.fixture
def found(addon):
    """A function that gives a finding as the engine says it."""
    return lambda *values: addon.engine_api.Finding(*values).to_line() + "\n"


@pytest.fixture
def hanging(addon, script, tmp_path):
    """The process of a test whose Python does not answer."""
    addon.probing._begin(script("sleep 60 & wait"), tmp_path, 0)
    return addon.session.get(addon.probing._State).examination._inquiry.process


def test_findings_belong_to_the_python_tested(bpy, addon, chosen, tmp_path):
    chosen.engine_python = sys.executable
    with pytest.raises(RuntimeError, match="cannot work here: torch"):
        bpy.ops.karf.examine_engine()
    drawn = shown(bpy, chosen)
    assert "torch is not installed." in drawn and "karf.copy_command" in drawn and '"torch>=' in drawn
    chosen.engine_python = str(tmp_path / "another")
    assert "torch" not in shown(bpy, chosen) and not bpy.ops.karf.copy_findings.poll()
    with pytest.raises(RuntimeError, match="does not exist"):
        bpy.ops.karf.examine_engine()
    assert "does not exist" in shown(bpy, chosen)


def test_scripts_get_the_findings_or_the_error_with_its_remedy(bpy, addon, chosen, saying, found, capsys):
    chosen.engine_python = str(saying(found("engine", "ok", "The engine is ready.")))
    (verdict,) = addon.steps.examine_engine(bpy.context.scene)
    assert verdict.sentence == "The engine is ready." and verdict.sentence in capsys.readouterr().out
    chosen.engine_python = sys.executable
    with pytest.raises(addon.engine_api.MissingDependency, match=r"torch.* -m pip install"):
        addon.steps.examine_engine(bpy.context.scene)


def test_findings_are_shown_as_they_come_with_remedies_for_problems(bpy, addon, chosen, saying, found, tmp_path):
    said = (
        found("python", "ok", "Python is fine.", "Nothing to do.")
        + found("disk", "warning", "The disk is nearly full.", "Free some space.")
        + found("scipy", "error", "scipy is not installed.", "Install it:", "pip install scipy")
    )
    chosen.engine_python = str(saying(said, then="sleep 60 & wait"))
    addon.probing._begin(Path(chosen.engine_python), tmp_path, 0)
    while len(addon.probing.findings_on(Path(chosen.engine_python))) < 3:
        assert addon.probing._tick() == addon.probing.POLL_SECONDS
    assert addon.probing.is_running() and not bpy.ops.karf.examine_engine.poll()
    drawn = shown(bpy, chosen)
    assert "Testing ..." in drawn and "karf.cancel_examination" in drawn
    assert "Python is fine." in drawn and "Nothing to do." not in drawn
    assert "The disk is nearly full. Free some space." in drawn
    assert "scipy is not installed. Install it: pip install scipy" in drawn


@pytest.mark.parametrize("by", ["cancel", "disabling the extension"])
def test_a_test_that_hangs_is_ended(bpy, addon, chosen, hanging, by):
    assert addon.probing._tick() == addon.probing.POLL_SECONDS
    addon.session.start_timer(addon.probing._tick, 60, persistent=True)
    if by == "cancel":
        assert bpy.ops.karf.cancel_examination() == {"FINISHED"}
    else:
        addon.extension.unregister()
        addon.extension.register()
    assert hanging.poll() is not None and not addon.probing.is_running()
    assert not bpy.app.timers.is_registered(addon.probing._tick)


def test_silent_python_times_out(addon, chosen, script, tmp_path, monkeypatch):
    monkeypatch.setattr(addon.probing, "TIMEOUT", 0.1)
    python = script("sleep 60 & wait")
    addon.probing._begin(python, tmp_path, 0)
    run_to_end(addon.probing._tick)
    assert "no answer" in addon.probing.verdict_on(python).sentence


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (None, "cannot be started"),
        ("echo hello", "cannot run the engine (exit code 0)"),
        ("exit 3", "cannot run the engine (exit code 3)"),
        ("echo 'error: this is Python 3.9, and the engine needs 3.11 or newer' >&2; exit 3", "needs 3.11 or newer"),
    ],
)
def test_program_that_is_not_a_suitable_python_is_named(addon, script, tmp_path, text, sentence):
    python = script(text) if text else tmp_path / "nothing"
    (verdict,) = addon.probing.wait(python, tmp_path)
    assert verdict.status == "error" and verdict.remedy == "Choose another Python."
    assert str(python) in verdict.sentence and sentence in verdict.sentence


def test_crash_of_a_library_keeps_earlier_findings(addon, saying, found, tmp_path):
    python = saying(found("python", "ok", "Fine.") + found("torch", "ok", "Fine."), then="kill -SEGV $$")
    findings = addon.probing.wait(python, tmp_path)
    assert [each.name for each in findings] == ["python", "torch", "engine"]
    assert findings[-1].status == "error" and "after torch (SIGSEGV)" in findings[-1].sentence


def test_output_of_libraries_is_ignored(addon, saying, found, tmp_path):
    said = "CUDA initialized\n[]\n" + found("engine", "ok", "The engine is ready.") + "half a li"
    assert [each.sentence for each in addon.probing.wait(saying(said), tmp_path)] == ["The engine is ready."]


def test_disk_and_locks_are_tested_in_the_project(bpy, chosen, project_scene, script, tmp_path):
    said = tmp_path / "said"
    chosen.engine_python = str(script(f"""echo "$@" > '{said}'"""))
    with pytest.raises(RuntimeError):
        bpy.ops.karf.examine_engine()
    assert f"--folder {tmp_path / 'project'}" in said.read_text()
