"""The command line: help, exit codes with one sentence each, and no traceback."""

import json
import shutil
import sys

import numpy as np
import pytest

pytest.importorskip("scipy")
pytest.importorskip("imageio")

from blender_tests.engine.conftest import run_engine
from blender_tests.engine.drawn_chart import CAST, CORNERS, photo_of_chart
from karf_engine.cli import main, verbs
from karf_engine.io.images import write_png
from karf_engine.palettes.calibration import ReferenceLight
from karf_engine.palettes.palette import hex_to_rgb, rgb_to_hex
from karf_engine.palettes.project_edit import edit_of
from karf_engine.project import Project
from karf_engine.worker.findings import VERDICT, Finding

VERBS = (
    *("poses", "inspect", "mark", "all", "geometry", "segmentation", "palette", "recoloring", "splats", "match"),
    *("render", "colorways", "settings", "doctor", "run"),
)
BLOCK_TORCH = "import sys\nsys.modules['torch'] = None\n"
PAIR = ("--from", "#d92619", "--to", "#1f5fbf")


def runs(*arguments):
    assert main(list(map(str, arguments))) == 0


def fails(capsys, code, *arguments):
    """Run a command that must fail with this exit code; returns its sentence and its remedy."""
    assert main(list(map(str, arguments))) == code
    printed = capsys.readouterr().err.strip().splitlines()
    errors = [number for number, line in enumerate(printed) if line.startswith("error: ")]
    assert len(errors) == 1 and "Traceback" not in "".join(printed)
    sentence, hint = printed[errors[0]].removeprefix("error: "), "".join(printed[errors[0] + 1 :]).strip()
    assert sentence.endswith(".") and hint
    return sentence, hint


# ------------------------------------------------------------------------------------------------------------------ help
def test_the_help_lists_every_verb_which_explains_itself_and_every_exit_code(capsys):
    for verb in VERBS:
        with pytest.raises(SystemExit) as stopped:
            main([verb, "--help"])
        assert stopped.value.code == 0 and f"usage: karf_engine {verb}" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["--help"])
    printed = capsys.readouterr().out
    assert all(f"\n    {verb} " in printed.replace("\n", " \n") for verb in VERBS)
    codes = ("2 bad request", "4 bad data", "6 cancelled", "7 diverged")
    assert all(code in " ".join(printed.split()) for code in codes)


@pytest.mark.parametrize("arguments", ["", "paint", "geometry", "geometry c --project p --preset best"])
def test_commands_that_cannot_be_understood_end_with_two(arguments, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(arguments.split())
    assert stopped.value.code == 2
    assert "usage: karf_engine" in capsys.readouterr().err


def test_settings_are_listed(capsys):
    runs("settings")
    assert "geometry.long_side" in capsys.readouterr().out


def test_the_doctor_says_line_by_line_what_it_finds(tmp_path, capsys, monkeypatch):
    pytest.importorskip("torch")
    free = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: free)  # others write meanwhile
    runs("doctor", "--quick", "--folder", tmp_path)
    text = capsys.readouterr().out
    runs("doctor", "--quick", "--json", "--folder", tmp_path)
    found = [Finding.from_line(line) for line in capsys.readouterr().out.splitlines()]
    assert text.splitlines() == [line for finding in found for line in finding.to_text().splitlines()]
    assert found[-1].name == VERDICT and all(finding.name != VERDICT for finding in found[:-1])
    assert set(json.loads(found[0].to_line())) == {"name", "status", "sentence", "remedy", "command", "code", "seconds"}


@pytest.mark.parametrize("line", ["", "{", "[]", "null", '{"name": "disk"}', '{"status": "fine"}', "a warning"])
def test_what_is_no_finding_is_refused(line):
    with pytest.raises(ValueError):
        Finding.from_line(line)


# ------------------------------------------------------------------------------------------------------------ exit codes
def test_captures_and_settings_that_cannot_be_are_named_before_anything_is_made(still_life, tmp_path, capsys):
    pytest.importorskip("torch")
    project = tmp_path / "p"
    sentence, _ = fails(capsys, 4, "geometry", tmp_path / "nowhere", "--project", project)
    assert sentence == f"{tmp_path / 'nowhere'} does not exist."
    capture = shutil.copytree(still_life.capture, tmp_path / "capture")
    (capture / "transforms_train.json").write_text('{"frames": [\n{]}')
    sentence, _ = fails(capsys, 4, "geometry", capture, "--project", project)
    assert "transforms_train.json (cameras) is broken JSON at line 2" in sentence
    override = ["--set", "geometry.max_ray=9"]
    _, hint = fails(capsys, 2, "geometry", still_life.capture, "--project", project, *override)
    assert "geometry.max_rays" in hint and not project.exists()


def test_masks_that_do_not_fit_are_named(learned, tmp_path, capsys):
    project = shutil.copytree(learned.project, tmp_path / "project")
    before, masks = Project(project).state(), tmp_path / "masks"

    def refused():
        return fails(capsys, 4, "segmentation", project, "--masks", masks)[0]

    assert "is not a folder of masks" in refused()
    masks.mkdir()
    assert "holds no masks" in refused()
    write_png(masks / "ball" / "r_0.png", np.zeros((32, 32), bool))
    assert "r_0.png marks nothing of 'ball'" in refused()
    write_png(masks / "ball" / "r_0.png", np.ones((30, 32), bool))
    assert "r_0.png is 32x30 pixels where its photo has 32x32" in refused()
    assert Project(project).state() == before and not (project / "lock.json").exists()


def test_a_project_that_is_none_or_of_another_capture_or_not_learned_yet_is_refused(
    still_life, learned, tmp_path, capsys
):
    pytest.importorskip("torch")
    assert "is not a KaRF project" in fails(capsys, 4, "palette", tmp_path)[0]
    assert "is not a KaRF project" in fails(capsys, 4, "render", tmp_path, "--out", tmp_path / "out")[0]
    other = shutil.copytree(still_life.capture, tmp_path / "other")
    sentence, hint = fails(capsys, 2, "geometry", other, "--project", learned.project)
    assert "already holds a project of" in sentence and str(other) in hint
    project = Project(tmp_path / "new")
    project.create(str(still_life.capture))
    assert "geometry" in "".join(fails(capsys, 2, "palette", project.folder))
    words = ("--object", "ball", *PAIR, "--out", "e.json")
    assert "palette" in "".join(fails(capsys, 2, "match", project.folder, *words))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ('{"schema": "karf-edit/1", "objects": {"vase": {"colors": [null]}}}', "edits the unknown object 'vase'"),
        ('{"schema": "karf-edit/1", "objects": {"ball": {"colors": [null]}}}', "has 1 colors"),
        ('{"schema": "karf-edit/9"}', "has schema 'karf-edit/9'"),
        ("{", "is broken JSON"),
    ],
)
def test_edits_that_do_not_fit_are_named(learned, tmp_path, capsys, content, words):
    (tmp_path / "edit.json").write_text(content)
    options = ["--edit", tmp_path / "edit.json", "--out", tmp_path / "out"]
    sentence, _ = fails(capsys, 4, "render", learned.project, *options)
    assert words in sentence and "edit.json" in sentence
    assert not (tmp_path / "out").exists()


BALL = ("match", "--object", "ball")
WRONG_WORDS = [
    (4, ("render", "--views", "nobody"), "has no view 'nobody'"),
    (4, ("render", "--views", "val"), "has no val views"),
    (2, ("match", "--object", "vase", *PAIR), "no object 'vase'"),
    (4, (*BALL, "--also", "green", "#00ff00", *PAIR), "'green' is not a color"),
    (4, (*BALL, "--from", "red", "--to", "#00ff00"), "'red' is not a color"),
]


@pytest.mark.parametrize(("code", "words", "sentence"), WRONG_WORDS)
def test_wrong_words_for_views_objects_and_colors_are_named(learned, tmp_path, capsys, code, words, sentence):
    verb, *options = words
    assert sentence in fails(capsys, code, verb, learned.project, *options, "--out", tmp_path / "out.json")[0]


def test_internal_errors_end_with_seventy_and_show_their_trace(monkeypatch, capsys):
    def break_down(_):
        raise ZeroDivisionError("of all things")

    monkeypatch.setattr(verbs, "list_settings", break_down)
    assert main(["settings"]) == 70
    printed = capsys.readouterr().err
    assert "Traceback" in printed and "error: Internal error: ZeroDivisionError('of all things')." in printed


def test_the_broken_captures_from_the_wild_end_with_one_sentence(scenes, tmp_path, capsys):
    pytest.importorskip("torch")
    folders = [path for path in sorted((scenes / "broken").iterdir()) if path.is_dir()]
    assert folders
    for folder in folders:
        sentence, _ = fails(capsys, 4, "geometry", folder, "--project", tmp_path / folder.name)
        assert folder.name in sentence


def test_without_torch_the_engine_says_what_to_install(still_life, tmp_path):
    (tmp_path / "sitecustomize.py").write_text(BLOCK_TORCH)
    environment = {"PYTHONPATH": str(tmp_path)}
    done = run_engine("geometry", still_life.capture, "--project", tmp_path / "p", environment=environment)
    assert done.returncode == 3
    assert f"({sys.executable}) has no package 'torch'" in done.stderr and "pip install torch" in done.stderr
    assert "Traceback" not in done.stderr
    done = run_engine("doctor", environment=environment)
    assert done.returncode == 3 and "torch is not installed." in done.stdout and done.stderr == ""


# ------------------------------------------------------------------------------------------------------- matching of colors
def test_what_an_edit_cannot_reach_is_told_with_the_reason(learned, tmp_path, capsys):
    def told(source, target):
        words = ("--object", "ball", "--from", source, "--to", target, "--out", tmp_path / "edit.json")
        runs("match", learned.project, *words)
        return "".join(capsys.readouterr())

    reached = told("#d92619", "#1f5fbf")
    assert "is of the paint that becomes another" in reached and "warning" not in reached
    assert "shows no color like #00ff00" in told("#00ff00", "#1f5fbf")


def test_a_gray_card_says_what_a_books_color_looks_like_in_the_photos(learned, tmp_path):
    def edit(name, *words):
        out = tmp_path / name
        runs("match", learned.project, "--object", "ball", "--from", "#d92619", *words, "--out", out)
        return out.read_text()

    light = ReferenceLight.of_card(hex_to_rgb("#a08060"))
    seen = rgb_to_hex(light.photographed(hex_to_rgb("#1f5fbf")))
    with_card = edit("card.json", "--to", "#1f5fbf", "--card", "#a08060")
    assert with_card == edit("seen.json", "--to", seen) != edit("plain.json", "--to", "#1f5fbf")


def test_a_color_chart_in_a_photo_says_the_same_found_by_itself_or_by_its_corners(learned, tmp_path, capsys):
    photo, out = tmp_path / "chart.png", tmp_path / "edit.json"
    write_png(photo, photo_of_chart())
    match = ("match", learned.project, "--object", "ball", *PAIR, "--out", out)
    seen = rgb_to_hex(ReferenceLight(CAST).photographed(hex_to_rgb("#1f5fbf")))
    wanted = edit_of(Project(learned.project)).becomes("ball", "#d92619", seen)
    corners = ",".join(f"{value:g}" for value in CORNERS.ravel())
    for words in (), ("--corners", corners):
        runs(*match, "--chart", photo, *words)
        assert "color chart: CIEDE2000 0.1 left in the mean of 23 patches" in "".join(capsys.readouterr())
        edit = edit_of(Project(learned.project), out)
        np.testing.assert_allclose(edit.colors["ball"], wanted.colors["ball"], atol=0.02)
    write_png(photo, np.full((60, 80, 3), 0.5))
    assert f"No color chart was found in {photo}" in fails(capsys, 2, *match, "--chart", photo)[0]
    assert "but no photo of it" in fails(capsys, 2, *match, "--corners", corners)[0]
    assert "were given" in fails(capsys, 2, *match, "--chart", photo, "--card", "#808080")[0]
