"""The example field is learned, stored, rendered, segmented and resumed like the built-in ones."""

import subprocess
import sys
from pathlib import Path

import pytest

from blender_tests.engine.conftest import QUICK, ROOT
from blender_tests.engine.fields import example_field
from karf_engine.cli import main
from karf_engine.errors import BadRequest, Cancelled
from karf_engine.fields.registry import FieldKind, field_kind, field_kinds, register_field
from karf_engine.io.images import read_mask, read_photo
from karf_engine.metrics.images import psnr
from karf_engine.metrics.masks import iou
from karf_engine.project import Project


@pytest.fixture(scope="module")
def project(still_life, tmp_path_factory):
    folder = tmp_path_factory.mktemp("balls") / "project"
    assert main(still_life.command(folder, "geometry.field=balls")) == 0
    return Project(folder)


def test_later_stages_run_on_the_example_field(project, still_life, tmp_path):
    assert len(Path(example_field.__file__).read_text(encoding="utf-8").splitlines()) <= 100
    assert project.finished("geometry")["balls"] == example_field.BALLS
    command = ["render", str(project.folder), "--views", "test", "--out", str(tmp_path), "--threads", "1"]
    assert main(command) == 0
    for stem in ("r_0", "r_1"):
        photo = still_life.photos[f"test/{stem}"]
        assert psnr(read_photo(tmp_path / "render" / f"test_{stem}.png")[..., :3], photo.color) >= 18
        for label, name in ((1, "ball"), (2, "block")):
            assert iou(read_mask(tmp_path / "masks" / name / f"test_{stem}.png"), photo.labels == label) >= 0.5


@pytest.mark.parametrize(
    ("module", "printed", "error"),
    [
        ("blender_tests.engine.fields.example_field", "BallField\n", ""),
        ("sys", "", "a field of the unknown kind 'balls'"),
    ],
)
def test_scene_loads_only_where_its_field_kind_is_registered(project, module, printed, error):
    code = f"import {module}, sys, pathlib; from karf_engine.fields.files import load_scene"
    code += "; print(type(load_scene(pathlib.Path(sys.argv[1])).field).__name__)"
    command = [sys.executable, "-c", code, project.geometry_file]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.stdout == printed and error in done.stderr and bool(done.returncode) == bool(error)


def learn_geometry(still_life, folder):
    settings = [part for text in (*QUICK, "geometry.field=balls") for part in ("--set", text)]
    return main(["geometry", str(still_life.capture), "--project", str(folder), "--threads", "1", *settings])


def test_interrupted_fit_of_the_example_field_resumes_byte_identically(
    project, still_life, tmp_path, monkeypatch, capsys
):
    step = example_field.BallFit._step

    def interrupted_step(fit, iteration, batch_scale):
        if iteration == 40:
            raise KeyboardInterrupt
        return step(fit, iteration, batch_scale)

    with monkeypatch.context() as patch:
        patch.setattr("karf_engine.fields.fit.CHECKPOINT_INTERVAL", 0.0)
        patch.setattr(example_field.BallFit, "_step", interrupted_step)
        assert learn_geometry(still_life, tmp_path) == Cancelled.exit_code
    assert learn_geometry(still_life, tmp_path) == 0
    assert "resuming at iteration 40 of 150" in capsys.readouterr().err
    assert Project(tmp_path).geometry_file.read_bytes() == project.geometry_file.read_bytes()


def test_unknown_field_is_rejected_before_photos_are_read(tmp_path, capsys):
    project = tmp_path / "p"
    command = ["geometry", str(tmp_path / "no_capture"), "--project", str(project), "--set", "geometry.field=fog"]
    assert main(command) == BadRequest.exit_code and not project.exists()
    error = capsys.readouterr().err
    assert "geometry.field = 'fog' is not allowed." in error and "voxels, nerf" in error


def test_field_name_cannot_be_taken_twice():
    register_field(field_kind("voxels"))  # again, as a module that is imported twice does
    with pytest.raises(BadRequest, match="'voxels'"):
        register_field(FieldKind("voxels", example_field.BallFit, example_field.BallField.restore))
    assert field_kinds()[:2] == ["voxels", "nerf"]
