"""Help, exit codes and one-line errors of the command line."""

import shutil
import subprocess
import sys

import numpy as np
import pytest

from blender_tests.engine.conftest import LONG_PATH, ROOT, odd_folder, run_engine
from blender_tests.engine.drawn_chart import CAST, CORNERS, photo_of_chart
from karf_engine.cli import main, verbs
from karf_engine.io.images import write_png
from karf_engine.palettes.calibration import ReferenceLight
from karf_engine.palettes.palette import hex_to_rgb, rgb_to_hex
from karf_engine.palettes.project_edit import edit_of
from karf_engine.project import Project
from karf_engine.worker.protocol import EventReader, Request

VERBS = """
    poses inspect mark all geometry segmentation palette recoloring splats match render colorways settings doctor run
""".split()


def assert_fails(capsys, code, *arguments):
    """Run a command that must fail with this exit code; returns its error message and hint."""
    assert main([*map(str, arguments)]) == code
    printed = capsys.readouterr().err.strip().splitlines()
    errors = [number for number, line in enumerate(printed) if line.startswith("error: ")]
    assert len(errors) == 1 and "Traceback" not in "".join(printed)
    sentence, hint = printed[errors[0]].removeprefix("error: "), "".join(printed[errors[0] + 1 :]).strip()
    assert sentence.endswith(".") and hint
    return sentence, hint


def test_help_covers_every_verb_and_exit_code(capsys):
    for verb in VERBS:
        with pytest.raises(SystemExit) as stopped:
            main([verb, "--help"])
        assert stopped.value.code == 0 and f"usage: karf_engine {verb}" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["--help"])
    printed = capsys.readouterr().out
    assert all(f"\n    {verb} " in printed.replace("\n", " \n") for verb in VERBS)
    for code in ("2 bad request", "4 bad data", "6 cancelled", "7 diverged"):
        assert code in " ".join(printed.split())
    assert main(["settings"]) == 0
    assert "geometry.long_side" in capsys.readouterr().out


@pytest.mark.parametrize("arguments", ["", "paint", "geometry", "geometry c --project p --preset best"])
def test_unparsable_command_exits_with_2(arguments, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(arguments.split())
    assert stopped.value.code == 2
    assert "usage: karf_engine" in capsys.readouterr().err


@pytest.fixture
def places(still_life, learned, tmp_path):
    """Paths by their placeholders in FAILURES."""
    Project(tmp_path / "new").create(str(still_life.capture))
    (tmp_path / "edit.json").write_text('{"schema": "karf-edit/1", "objects": {"vase": {"colors": [null]}}}')
    (tmp_path / "empty").mkdir()
    return {
        "CAPTURE": still_life.capture,
        "COPY": shutil.copytree(still_life.capture, tmp_path / "copy"),
        "LEARNED": learned.project,
        **{name.upper(): tmp_path / name for name in ("out", "nowhere", "empty", "new", "edit.json")},
    }


PAIR, TO_OUT = "--from #d92619 --to #1f5fbf", "--out OUT"
FAILURES = [
    (4, "geometry NOWHERE --project OUT", "NOWHERE does not exist.", ""),
    (2, "geometry CAPTURE --project OUT --set geometry.max_ray=9", "geometry.max_ray", "geometry.max_rays"),
    (2, f"palette LEARNED --threads {'9' * 30}", f"threads = {'9' * 30} is out of range", ""),
    (2, "geometry COPY --project LEARNED", "LEARNED already holds a project of CAPTURE", "COPY"),
    (4, f"palette EMPTY {TO_OUT}", "EMPTY is not a KaRF project", ""),
    (2, "palette NEW", "NEW has no settings yet.", "geometry"),
    (2, f"match NEW --object ball {PAIR} {TO_OUT}", "palette", ""),
    (4, "segmentation LEARNED --masks NOWHERE", "NOWHERE is not a folder of masks", ""),
    (4, f"render LEARNED --edit EDIT.JSON {TO_OUT}", "EDIT.JSON edits the unknown object 'vase'", ""),
    (4, f"render LEARNED --views nobody {TO_OUT}", "has no view 'nobody'", ""),
    (4, f"render LEARNED --views val {TO_OUT}", "has no val views", ""),
    (2, f"match LEARNED --object vase {PAIR} {TO_OUT}", "no object 'vase'", ""),
    (4, f"match LEARNED --object ball --also green #00ff00 {PAIR} {TO_OUT}", "'green' is not a color", ""),
    (4, f"match LEARNED --object ball --from red --to #00ff00 {TO_OUT}", "'red' is not a color", ""),
]


@pytest.mark.parametrize(("code", "words", "message", "hint"), FAILURES)
def test_failing_command_prints_one_line_and_changes_nothing(places, capsys, code, words, message, hint):
    project = Project(places["LEARNED"])
    before = project.state()
    printed = assert_fails(capsys, code, *(places.get(word, word) for word in words.split()))
    for name, place in places.items():
        message, hint = message.replace(name, str(place)), hint.replace(name, str(place))
    assert message in printed[0] and hint in printed[1]
    assert not places["OUT"].exists() and not (project.folder / "lock.json").exists() and project.state() == before


def test_internal_error_exits_with_70_and_prints_traceback(monkeypatch, capsys):
    monkeypatch.setattr(verbs, "list_settings", lambda _: 1 / 0)
    assert main(["settings"]) == 70
    printed = capsys.readouterr().err
    assert "Traceback" in printed and "error: Internal error: ZeroDivisionError('division by zero')." in printed


def test_broken_captures_fail_with_one_line(scenes, tmp_path, capsys):
    folders = [path for path in sorted((scenes / "broken").iterdir()) if path.is_dir()]
    assert folders
    for folder in folders:
        sentence, _ = assert_fails(capsys, 4, "geometry", folder, "--project", tmp_path / folder.name)
        assert folder.name in sentence


def test_missing_torch_names_the_install_command(still_life, tmp_path):
    (tmp_path / "sitecustomize.py").write_text("import sys\nsys.modules['torch'] = None\n")
    command = ("geometry", still_life.capture, "--project", tmp_path / "p")
    done = run_engine(*command, environment={"PYTHONPATH": str(tmp_path)})
    assert done.returncode == 3 and "Traceback" not in done.stderr
    assert f"({sys.executable}) has no package 'torch'" in done.stderr and "pip install torch" in done.stderr


@pytest.fixture
def match(learned, tmp_path, capsys):
    """Match a color of the ball; returns the output and the ball's edited colors."""

    def match(source="#d92619", target="#1f5fbf", *words):
        out = tmp_path / "edit.json"
        command = ("match", learned.project, "--object", "ball", "--from", source, "--to", target, *words, "--out", out)
        assert main([*map(str, command)]) == 0
        return "".join(capsys.readouterr()), edit_of(Project(learned.project), out).colors["ball"]

    return match


def test_match_explains_unreachable_colors(match):
    reached, _ = match()
    assert "is of the paint that becomes another" in reached and "warning" not in reached
    assert "shows no color like #00ff00" in match("#00ff00")[0]


CARD, CHART = ReferenceLight.of_card(hex_to_rgb("#a08060")), ReferenceLight(CAST)
AT_CORNERS = ("--corners", ",".join(f"{value:g}" for value in CORNERS.ravel()))


@pytest.mark.parametrize(
    ("words", "light", "tolerance"),
    [
        (("--card", "#a08060"), CARD, 0),
        (("--chart", "chart.png"), CHART, 0.02),
        (("--chart", "chart.png", *AT_CORNERS), CHART, 0.02),
    ],
    ids=["card", "detected chart", "chart at given corners"],
)
def test_card_or_chart_converts_target_to_photo_light(match, tmp_path, monkeypatch, words, light, tolerance):
    monkeypatch.chdir(tmp_path)
    write_png(tmp_path / "chart.png", photo_of_chart())
    printed, found = match("#d92619", "#1f5fbf", *words)
    _, expected = match("#d92619", rgb_to_hex(light.photographed(hex_to_rgb("#1f5fbf"))))
    np.testing.assert_allclose(found, expected, atol=tolerance)
    assert np.abs(found - match()[1]).max() > 0.05
    assert ("color chart: CIEDE2000 0.1 left in the mean of 23 patches" in printed) == ("--chart" in words)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--chart", "gray.png"), "No color chart was found in gray.png"),
        (AT_CORNERS, "but no photo of it"),
        (("--chart", "gray.png", "--card", "#808080"), "were given"),
    ],
)
def test_unusable_reference_is_rejected(learned, tmp_path, monkeypatch, capsys, words, message):
    monkeypatch.chdir(tmp_path)
    write_png(tmp_path / "gray.png", np.full((60, 80, 3), 0.5))
    options = ("--object", "ball", *PAIR.split(), "--out", "edit.json", *words)
    assert message in assert_fails(capsys, 2, "match", learned.project, *options)[0]


ASCII_CONSOLE = {"PYTHONIOENCODING": "ascii"}


@pytest.fixture
def odd_project(learned, tmp_path):
    """The learned still life in a long path with spaces and letters of other alphabets."""
    folder = odd_folder(tmp_path) / "project 1"
    assert len(str(folder)) > LONG_PATH
    shutil.copytree(learned.project, folder)
    return folder


def test_every_frame_kind_is_written_to_odd_folder(odd_project):
    out = odd_project.with_name("frames 1")
    options = ["--views", "test", "--layers", "--planes", "--depth", "--threads", "1", "--out", out]
    done = run_engine("render", odd_project, *options, environment=ASCII_CONSOLE)
    assert done.returncode == 0, done.stderr
    assert {path.name for path in out.iterdir()} >= {"render", "masks", "layers", "planes", "depth"}


def test_odd_path_prints_on_ascii_console(odd_project):
    done = run_engine("palette", odd_project / "壺", environment=ASCII_CONSOLE)
    assert done.returncode == 4 and "is not a KaRF project" in done.stderr and "\\u58fa" in done.stderr


def test_extension_in_odd_folder_runs_a_job(odd_project):
    engine = odd_project.with_name("karf engine 1") / "karf_engine"
    shutil.copytree(ROOT / "karf_engine", engine, ignore=shutil.ignore_patterns("__pycache__"))
    job, edit = Project(odd_project).new_job("match"), odd_project.with_name("Änderung 1.json")
    options = {"object": "ball", "source": "#c04030", "target": "#3059b8", "out": str(edit)}
    Request("match", odd_project, options).write(job)
    command = [sys.executable, "-I", "-B", "-u", "-X", "utf8", engine, "run", job]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, cwd=job, capture_output=True, text=True, encoding="utf-8")
    assert done.returncode == 0, done.stderr
    assert [event.kind for event in EventReader(job).poll()][-1] == "done" and edit.is_file()
