"""The library's public functions: plain values in and out, without command line, job or Blender."""

import errno
import math
import os
import re
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest

import karf_engine as karf
from blender_tests.engine.conftest import QUICK, ROOT, finish_again
from karf_engine.cli import main
from karf_engine.errors import BadRequest, Cancelled, DataError, OutOfMemory

RED_TO_BLUE = ("#d92619", "#1f5fbf")
LEARNING = {"overrides": QUICK, "threads": 1, "device": "cpu"}


@pytest.fixture(scope="module")
def model(learned):
    return karf.load(learned.project, device="cpu")


def test_public_names_are_documented_and_import_without_torch():
    assert set(karf.__all__) == set(karf._HOME) | {"__version__"}
    assert [name for name in karf._HOME if not getattr(karf, name).__doc__] in ([], ["PRESETS"])
    used = "karf.open_capture; karf.learn; karf.read_edit"
    code = f"import sys, karf_engine as karf; {used}; assert 'torch' not in sys.modules"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT).returncode == 0


def test_learn_takes_a_changed_capture_and_reports_progress_lines(still_life, tmp_path):
    capture = karf.open_capture(still_life.capture)
    fewer = replace(capture, views=tuple(view for view in capture.views if view.name != "train_r_1"))
    lines = []
    model = karf.learn(fewer, still_life.masks, project=tmp_path / "project", progress=lines.append, **LEARNING)
    assert model.objects == ["ball", "block"] and len(model.palettes) == 2
    assert len(model.capture.views) == len(capture.views) - 1
    assert any(line.startswith("segmentation ") for line in lines)


def test_library_calls_leave_torch_state_unchanged(learned, tmp_path):
    import torch

    def state():
        return torch.get_num_threads(), torch.get_rng_state().tolist(), math.ulp(0.0) * 1.0  # denormals are kept

    torch.set_num_threads(2)
    torch.manual_seed(5)
    before = state()
    karf.learn_splats(learned.project, threads=1, device="cpu")
    karf.render(learned.project, tmp_path / "out", views="test", threads=1, device="cpu")
    karf.load(learned.project, device="cpu")
    assert state() == before
    torch.set_num_threads(1)


@pytest.fixture
def python_ctrl_c():
    """Python's own handler of Ctrl-C, which a process started in a shell's background does not have."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("python_ctrl_c")
def test_ctrl_c_saves_a_checkpoint_and_should_stop_cancels(still_life, tmp_path):
    project = tmp_path / "project"

    def interrupt(kind, **values):
        if kind == "progress" and values["stage"] == "geometry":
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        karf.learn_geometry(still_life.capture, project=project, **LEARNING, emit=interrupt)
    assert (project / "unfinished_geometry.safetensors").exists()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    with pytest.raises(Cancelled):
        karf.learn_geometry(still_life.capture, project=project, **LEARNING, should_stop=lambda: True)


def test_frame_arrays_match_rendered_files(model, learned, tmp_path):
    view = model.capture.split("test")[0]
    frame = model.render(view.camera)
    n_objects, n_colors = model.learned_colors.shape[:2]
    shape = view.camera.height, view.camera.width
    assert frame.color.shape == (*shape, 3) and frame.depth.shape == frame.opacity.shape == shape
    assert frame.masks.shape == frame.probabilities.shape == (n_objects, *shape) and frame.masks.dtype == bool
    assert frame.palette_weights.shape == (n_objects, n_colors, *shape)
    assert frame.color.min() >= 0 and frame.color.max() <= 1
    karf.render(learned.project, tmp_path, views="test", threads=1, device="cpu", depth=True)
    depth = np.load(tmp_path / "depth" / f"{view.name}.npy")
    np.testing.assert_array_equal(model.render_view(view).depth, depth)


def test_edit_is_immutable_and_survives_saving(model, tmp_path):
    plain = model.edit()
    edit = plain.swatch("block", 1, "#2060a0").swatch("ball", 1, (0.1, 1.5, 0.2))
    np.testing.assert_array_equal(plain.colors["block"], model.edit().colors["block"])
    edit.save(tmp_path / "edit.json")
    for again in (karf.read_edit(tmp_path / "edit.json", model.palettes), model.edit(tmp_path / "edit.json")):
        assert again.colors.keys() == edit.colors.keys()
        for name in edit.colors:
            np.testing.assert_array_equal(again.colors[name], edit.colors[name])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda edit: edit.becomes("cup", "#000000", "#ffffff"), "no object 'cup'"),
        (lambda edit: edit.becomes("ball", *RED_TO_BLUE, rule="most"), "Unknown rule 'most'"),
        (lambda edit: edit.becomes("ball", *RED_TO_BLUE, "fewest", also=[("#ffffff", "#000000")]), "takes one pair"),
        (lambda edit: edit.swatch("ball", 0, "#ffffff"), "no swatch 0"),
        (lambda edit: edit.swatch("ball", 99, "#ffffff"), "no swatch 99"),
        (lambda edit: edit.swatch("ball", 1, "blue"), "'blue' is not a color"),
        (lambda edit: edit.swatch("ball", 1, (0.1, 0.2)), "is not a color"),
    ],
)
def test_impossible_edits_are_rejected(model, change, words):
    with pytest.raises((BadRequest, DataError), match=re.escape(words)):
        change(model.edit())


def test_edit_in_memory_renders_and_exports_like_its_file(model, learned, tmp_path):
    pytest.importorskip("numba")
    edit = model.edit().swatch("block", 1, "#2060a0").edge("block", 1.5)
    edit.save(tmp_path / "edit.json")
    view = model.capture.split("test")[0].name
    edits = {"file": tmp_path / "edit.json", "memory": edit, "list": [edit]}
    for folder, value in edits.items():
        karf.render(learned.project, tmp_path / folder, views=view, edit=value, threads=1, device="cpu")
    written = [path.relative_to(tmp_path / "file") for path in (tmp_path / "file").rglob("*.png")]
    assert any(path.parts[0] == "recolor" for path in written)
    for path in written:
        assert len({(tmp_path / folder / path).read_bytes() for folder in edits}) == 1, path
    for name in ("file", "memory"):
        karf.export_splat(learned.project, tmp_path / f"{name}.ply", edit=edits[name], threads=1, device="cpu")
    assert (tmp_path / "file.ply").read_bytes() == (tmp_path / "memory.ply").read_bytes()


def test_settings_dictionary_and_torch_device_are_accepted(monkeypatch, learned):
    import torch

    def options_given(**options):
        command = Mock()
        monkeypatch.setattr("karf_engine.api.run_command", command)
        karf.learn_geometry("garden", project="garden_karf", **options)
        return command.call_args.args[0]

    geometry = {"space": "box", "levels": [{"voxels": 40}]}
    settings = {"geometry.long_side": 512, "geometry": geometry, "seed": np.int64(3)}
    words = ("geometry.long_side=512", 'geometry.space="box"', 'geometry.levels=[{"voxels": 40}]', "seed=3")
    assert options_given(overrides=settings).overrides == words
    with pytest.raises(TypeError, match="overrides takes"):
        options_given(overrides={"seed": object()})
    assert options_given(device=torch.device("cuda", 1)).device == "cuda:1"
    assert karf.load(learned.project, device=torch.device("cpu")).device == torch.device("cpu")


def test_model_with_only_geometry_rejects_edits(learned, tmp_path):
    project = shutil.copytree(learned.project, tmp_path / "project")
    finish_again(project, "geometry")
    model = karf.load(project, device="cpu")
    view = model.capture.views[0]
    assert model.objects == [] and model.render(view.camera).palette_weights is None
    with pytest.raises(BadRequest, match="palette stage"):
        model.edit()
    with pytest.raises(BadRequest, match="no finished recoloring stage"):
        model.recolor(view, karf.Edit({}))


def test_loaded_model_renders_without_its_project(learned, tmp_path):
    copy = shutil.copytree(learned.project, tmp_path / "project")
    model = karf.load(copy, device="cpu")
    edit, view = model.edit().swatch("block", 1, "#2060a0"), model.capture.split("test")[0]
    shutil.rmtree(copy)
    assert model.recolor(view, edit).shape == (view.camera.height, view.camera.width, 3)
    assert model.capture.split("test")[0] is view
    assert not copy.exists()


@pytest.mark.parametrize(
    ("raised", "expected", "words"),
    [
        (OSError(errno.ENOSPC, "No space left on device", "/disk/geometry"), DataError, "The disk is full"),
        (MemoryError(), OutOfMemory, "ran out of memory"),
        (ZeroDivisionError("an internal error"), ZeroDivisionError, "an internal error"),
    ],
)
def test_system_errors_become_library_errors(monkeypatch, tmp_path, raised, expected, words):
    monkeypatch.setattr("karf_engine.api.run_command", Mock(side_effect=raised))
    with pytest.raises(expected, match=words):
        karf.extract_palettes(tmp_path)


@pytest.mark.parametrize("place", ["typo", "capture", "."])
def test_loading_a_folder_without_project_fails_and_writes_nothing(still_life, tmp_path, place):
    shutil.copytree(still_life.capture, tmp_path / "capture")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(karf.KarfError, match=r"project\.json is missing|does not exist|no project"):
        karf.load(tmp_path / place)
    assert sorted(tmp_path.rglob("*")) == before


def test_unmatched_masks_are_rejected_before_learning(still_life, tmp_path):
    (tmp_path / "masks" / "pot").mkdir(parents=True)
    shutil.copy(next((still_life.masks / "ball").iterdir()), tmp_path / "masks" / "pot" / "no_such_photo.png")
    for masks in (tmp_path / "masks", tmp_path / "typo"):
        with pytest.raises(karf.KarfError):
            karf.learn(still_life.capture, masks, project=tmp_path / "project", overrides=QUICK)
        assert main(replace(still_life, masks=masks).command(tmp_path / "project")) == DataError.exit_code
        assert not (tmp_path / "project").exists()
