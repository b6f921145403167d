"""*Test Engine* shows findings about one Python as they come and never blocks the interface."""

import os
import sys
from pathlib import Path

import pytest

from ..layout import drawn_preferences
from ..timers import run_to_end

pytestmark = pytest.mark.skipif(os.name == "nt", reason="shell scripts stand in for Python")


@pytest.fixture
def script(tmp_path):
    """A function that writes a shell script in place of the engine's Python."""

    def script(text):
        path = tmp_path / "a python"
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(0o755)
        return path

    return script


@pytest.fixture
def printing(script, tmp_path):
    """A function that writes a Python that prints lines, then runs a command."""

    def printing(lines, then=""):
        (tmp_path / "lines").write_text(lines)
        return script(f"cat '{tmp_path / 'lines'}'; {then}")

    return printing


@pytest.fixture
def finding_line(addon):
    """A function that gives a finding as the engine prints it."""
    return lambda *values: addon.engine_api.Finding(*values).to_line() + "\n"


def test_findings_are_those_of_the_tested_python(bpy, addon, preferences, tmp_path):
    preferences.engine_python = sys.executable
    with pytest.raises(RuntimeError, match="cannot work here: torch"):
        bpy.ops.karf.examine_engine()
    drawn = drawn_preferences(bpy, preferences)
    assert "torch is not installed." in drawn and "karf.copy_command" in drawn and '"torch>=' in drawn
    preferences.engine_python = str(tmp_path / "another")
    assert "torch" not in drawn_preferences(bpy, preferences) and not bpy.ops.karf.copy_findings.poll()
    with pytest.raises(RuntimeError, match="does not exist"):
        bpy.ops.karf.examine_engine()
    assert "does not exist" in drawn_preferences(bpy, preferences)


def test_scripts_get_findings_or_an_error_with_its_remedy(bpy, addon, preferences, printing, finding_line, capsys):
    preferences.engine_python = str(printing(finding_line("engine", "ok", "The engine is ready.")))
    (verdict,) = addon.steps.examine_engine(bpy.context.scene)
    assert verdict.sentence == "The engine is ready." and verdict.sentence in capsys.readouterr().out
    preferences.engine_python = sys.executable
    with pytest.raises(addon.engine_api.MissingDependency, match=r"torch.* -m pip install"):
        addon.steps.examine_engine(bpy.context.scene)


def test_findings_appear_as_they_come(bpy, addon, preferences, printing, finding_line, tmp_path):
    output = (
        finding_line("python", "ok", "Python is fine.", "Nothing to do.")
        + finding_line("disk", "warning", "The disk is nearly full.", "Free some space.")
        + finding_line("scipy", "error", "scipy is not installed.", "Install it:", "pip install scipy")
    )
    preferences.engine_python = str(printing(output, then="sleep 60 & wait"))
    addon.probing._begin(Path(preferences.engine_python), tmp_path, 0)
    while len(addon.probing.findings_on(Path(preferences.engine_python))) < 3:
        assert addon.probing._tick() == addon.probing.POLL_SECONDS
    assert addon.probing.is_running() and not bpy.ops.karf.examine_engine.poll()
    drawn = drawn_preferences(bpy, preferences)
    assert "Testing ..." in drawn and "karf.cancel_examination" in drawn
    assert "Python is fine." in drawn and "Nothing to do." not in drawn
    assert "The disk is nearly full. Free some space." in drawn
    assert "scipy is not installed. Install it: pip install scipy" in drawn


@pytest.mark.parametrize("by", ["cancel", "disabling the extension"])
def test_hanging_test_is_ended(bpy, addon, preferences, script, tmp_path, by):
    addon.probing._begin(script("sleep 60 & wait"), tmp_path, 0)
    process = addon.session.get(addon.probing._State).examination._inquiry.process
    assert addon.probing._tick() == addon.probing.POLL_SECONDS
    addon.session.start_timer(addon.probing._tick, 60, persistent=True)
    if by == "cancel":
        assert bpy.ops.karf.cancel_examination() == {"FINISHED"}
    else:
        addon.extension.unregister()
        addon.extension.register()
    assert process.poll() is not None and not addon.probing.is_running()
    assert not bpy.app.timers.is_registered(addon.probing._tick)


def test_silent_python_times_out(addon, preferences, script, tmp_path, monkeypatch):
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
def test_unsuitable_python_is_named_with_the_reason(addon, script, tmp_path, text, sentence):
    python = script(text) if text else tmp_path / "nothing"
    (verdict,) = addon.probing.wait(python, tmp_path)
    assert verdict.status == "error" and verdict.remedy == "Choose another Python."
    assert str(python) in verdict.sentence and sentence in verdict.sentence


def test_library_crash_keeps_earlier_findings(addon, printing, finding_line, tmp_path):
    lines = finding_line("python", "ok", "Fine.") + finding_line("torch", "ok", "Fine.")
    python = printing(lines, then="kill -SEGV $$")
    findings = addon.probing.wait(python, tmp_path)
    assert [each.name for each in findings] == ["python", "torch", "engine"]
    assert findings[-1].status == "error" and "after torch (SIGSEGV)" in findings[-1].sentence


def test_output_of_libraries_is_ignored(addon, printing, finding_line, tmp_path):
    output = "CUDA initialized\n[]\n" + finding_line("engine", "ok", "The engine is ready.") + "half a li"
    assert [each.sentence for each in addon.probing.wait(printing(output), tmp_path)] == ["The engine is ready."]


def test_disk_and_locks_of_the_project_are_tested(bpy, preferences, project_scene, script, tmp_path):
    output = tmp_path / "output"
    preferences.engine_python = str(script(f"""echo "$@" > '{output}'"""))
    with pytest.raises(RuntimeError):
        bpy.ops.karf.examine_engine()
    assert f"--folder {tmp_path / 'project'}" in output.read_text()
