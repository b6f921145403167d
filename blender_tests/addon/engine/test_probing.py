"""Test Engine never blocks the interface, shows what it finds as it finds it, and its findings belong to one Python."""

import os
import sys
from pathlib import Path

import pytest

from ..layout import drawn_preferences as shown
from ..timers import run_to_end

HERE = Path(sys.executable)
pytestmark = pytest.mark.skipif(os.name == "nt", reason="shell scripts stand in for Python")


def script(folder, text, name="a python"):
    """A program that stands in for a Python."""
    path = folder / name
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return path


def sleeper(folder):
    """A Python that does not answer."""
    return script(folder, "sleep 60 & wait")


def saying(addon, folder, *findings, then=""):
    """A Python that has found this."""
    lines = folder / "lines"
    lines.write_text("".join(finding.to_line() + "\n" for finding in findings))
    return script(folder, f"cat '{lines}'; {then}")


@pytest.fixture
def finding(addon):
    return addon.engine_api.Finding


def test_a_test_runs_beside_the_interface(bpy, addon, chosen, tmp_path):
    addon.probing._begin(HERE, tmp_path, 0)
    assert addon.probing.is_running() and not bpy.ops.karf.examine_engine.poll()
    run_to_end(addon.probing._tick)
    assert "torch" in addon.probing.verdict_on(HERE).sentence
    assert not addon.probing.is_running()


def test_a_python_without_torch_is_told_what_to_install(bpy, addon, chosen):
    chosen.engine_python = sys.executable
    with pytest.raises(RuntimeError, match="cannot work here: torch"):
        bpy.ops.karf.examine_engine()
    drawn = shown(bpy, chosen)
    assert "torch is not installed." in drawn and "karf.copy_command" in drawn and '"torch>=' in drawn


def test_scripts_get_the_findings_or_the_error_with_its_remedy(bpy, addon, chosen, finding, tmp_path, capsys):
    chosen.engine_python = str(saying(addon, tmp_path, finding("engine", "ok", "The engine is ready.")))
    (verdict,) = addon.steps.examine_engine(bpy.context.scene)
    assert verdict.sentence == "The engine is ready." and verdict.sentence in capsys.readouterr().out
    chosen.engine_python = sys.executable
    with pytest.raises(addon.engine_api.MissingDependency, match=r"torch.* -m pip install"):
        addon.steps.examine_engine(bpy.context.scene)


def test_findings_are_shown_as_they_come_with_the_remedy_where_something_is_amiss(
    bpy, addon, chosen, finding, tmp_path
):
    found = (
        finding("python", "ok", "Python is fine.", "Nothing to do."),
        finding("disk", "warning", "The disk is nearly full.", "Free some space."),
        finding("scipy", "error", "scipy is not installed.", "Install it:", "pip install scipy"),
    )
    chosen.engine_python = str(saying(addon, tmp_path, *found, then="sleep 60 & wait"))
    addon.probing._begin(Path(chosen.engine_python), tmp_path, 0)
    while len(addon.probing.findings_on(Path(chosen.engine_python))) < 3:
        assert addon.probing._tick() == addon.probing.POLL_SECONDS
    drawn = shown(bpy, chosen)
    assert "Testing ..." in drawn and "karf.cancel_examination" in drawn
    assert "Python is fine." in drawn and "Nothing to do." not in drawn
    assert "The disk is nearly full. Free some space." in drawn
    assert "scipy is not installed. Install it: pip install scipy" in drawn


def test_a_test_that_hangs_is_cancelled(bpy, addon, chosen, tmp_path):
    addon.probing._begin(sleeper(tmp_path), tmp_path, 0)
    process = addon.session.get(addon.probing._State).examination._inquiry.process
    assert addon.probing._tick() == addon.probing.POLL_SECONDS
    assert bpy.ops.karf.cancel_examination() == {"FINISHED"}
    assert process.poll() is not None and not addon.probing.is_running()


def test_disabling_the_extension_ends_the_test_and_its_timer(bpy, addon, chosen, tmp_path):
    addon.probing._begin(sleeper(tmp_path), tmp_path, 0)
    process = addon.session.get(addon.probing._State).examination._inquiry.process
    addon.session.start_timer(addon.probing._tick, 60, persistent=True)
    addon.extension.unregister()
    addon.extension.register()
    assert process.poll() is not None and not bpy.app.timers.is_registered(addon.probing._tick)


def test_a_python_that_never_answers_is_given_up(addon, chosen, tmp_path, monkeypatch):
    monkeypatch.setattr(addon.probing, "TIMEOUT", 0.1)
    addon.probing._begin(sleeper(tmp_path), tmp_path, 0)
    run_to_end(addon.probing._tick)
    assert "no answer" in addon.probing.verdict_on(sleeper(tmp_path)).sentence


def test_something_that_is_no_python_is_named(addon, tmp_path):
    for python in (tmp_path / "nothing", script(tmp_path, "echo hello"), script(tmp_path, "exit 3")):
        (verdict,) = addon.probing.wait(python, tmp_path)
        assert verdict.status == "error" and str(python) in verdict.sentence and verdict.remedy


def test_a_python_that_is_too_old_says_so(addon, tmp_path):
    old = script(tmp_path, "echo 'error: this is Python 3.9, and the engine needs 3.11 or newer' >&2; exit 3")
    (verdict,) = addon.probing.wait(old, tmp_path)
    assert "needs 3.11 or newer" in verdict.sentence


def test_a_library_that_crashes_leaves_what_was_found_before(addon, finding, tmp_path):
    python = saying(
        addon, tmp_path, finding("python", "ok", "Fine."), finding("torch", "ok", "Fine."), then="kill -SEGV $$"
    )
    found = addon.probing.wait(python, tmp_path)
    assert [each.name for each in found] == ["python", "torch", "engine"]
    assert found[-1].status == "error" and "after torch (SIGSEGV)" in found[-1].sentence


def test_what_libraries_print_is_no_finding(addon, finding, tmp_path):
    python = saying(addon, tmp_path, finding("engine", "ok", "The engine is ready."))
    (tmp_path / "lines").write_text("CUDA initialized\n[]\n" + (tmp_path / "lines").read_text() + "half a li")
    found = addon.probing.wait(python, tmp_path)
    assert [each.sentence for each in found] == ["The engine is ready."]


def test_the_findings_are_those_of_the_python_that_was_asked(bpy, addon, chosen, tmp_path):
    chosen.engine_python = sys.executable
    with pytest.raises(RuntimeError, match="torch"):
        bpy.ops.karf.examine_engine()
    assert "torch is not installed." in shown(bpy, chosen)
    chosen.engine_python = str(tmp_path / "another")
    assert "torch" not in shown(bpy, chosen) and not bpy.ops.karf.copy_findings.poll()
    with pytest.raises(RuntimeError, match="does not exist"):
        bpy.ops.karf.examine_engine()
    assert "does not exist" in shown(bpy, chosen)


def test_the_project_is_where_disk_and_locks_are_tried(bpy, addon, chosen, project_scene, tmp_path):
    said = tmp_path / "said"
    chosen.engine_python = str(script(tmp_path, f"""echo "$@" > '{said}'"""))
    with pytest.raises(RuntimeError):
        bpy.ops.karf.examine_engine()
    assert f"--folder {tmp_path / 'project'}" in said.read_text()


def test_the_copied_report_has_the_findings_and_no_names(bpy, addon, chosen, finding, tmp_path, monkeypatch):
    home = tmp_path / "ada"
    home.mkdir()
    monkeypatch.setattr(addon.failures.Path, "home", lambda: home)
    monkeypatch.setattr(addon.failures.getpass, "getuser", lambda: "ada")
    monkeypatch.setattr(addon.failures.platform, "node", lambda: "lovelace-pc")
    found = (
        finding("python", "ok", f"Python 3.11, {home}/engine/bin/python, is tested."),
        finding("disk", "error", "8 GB are free on /media/Ada/films.", "Ask the owner of lovelace-pc.", "rm /mnt/ada"),
    )
    text = addon.failures.compose_findings(found, {"KaRF": "0.1.0", "Engine Python": f"{home}/engine/bin/python"})
    assert "KaRF: 0.1.0" in text and "~/engine/bin/python" in text and "error    8 GB are free" in text
    assert "ada" not in text.lower() and "lovelace" not in text
    chosen.engine_python = sys.executable
    assert not bpy.ops.karf.copy_findings.poll()
    with pytest.raises(RuntimeError):
        bpy.ops.karf.examine_engine()
    assert bpy.ops.karf.copy_findings() == {"FINISHED"}


def test_a_name_within_a_word_is_none(addon):
    assert addon.failures.without_name("canada, ada's /ada/", "ada", "<user>") == "canada, <user>'s /<user>/"
    assert addon.failures.without_name("al", "al", "<user>") == "al"
