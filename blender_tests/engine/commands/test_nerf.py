"""A NeRF as geometry: all stages with a small version of the paper's preset, and NeRFs of other programs."""

import json
import shutil
from unittest.mock import Mock

import numpy as np
import pytest
import torch

from blender_tests.engine.commands.conftest import assert_renders_well, geometry_command, run
from karf_engine.errors import Cancelled
from karf_engine.fields.files import SCHEMA
from karf_engine.io.checkpoints import load_tensors
from karf_engine.io.images import read_photo, resize
from karf_engine.metrics.images import psnr
from karf_engine.palettes.palette import read_palettes
from karf_engine.project import Project

SMALL = tuple(
    f"geometry.nerf.{setting}"
    for setting in """
    depth=4 width=32 position_frequencies=6 direction_frequencies=2 coarse_samples=16 fine_samples=16
    iterations=700 look_every=700 rays=64 rate=0.005 crop_iterations=50
    """.split()
)
PAPER = ("segmentation.samples_per_ray=3", "recoloring.frequencies=4", "segmentation.frequencies=4")


def sets(*settings):
    return [part for text in settings for part in ("--set", text)]


@pytest.fixture(scope="module")
def project(still_life, tmp_path_factory):
    """The still life with every stage learned on a NeRF by the paper's preset."""
    folder = tmp_path_factory.mktemp("nerf") / "project"
    assert run(*still_life.command(folder, *SMALL, *PAPER), "--preset", "paper") == 0
    return Project(folder)


@pytest.fixture(scope="module")
def checkpoint(project, tmp_path_factory):
    """That NeRF as nerf-pytorch would save it; its world is the capture's, scaled."""
    tensors, _ = load_tensors(project.geometry_file, SCHEMA)
    content = {"global_step": 700}
    for part, name in (("field.coarse.", "network_fn_state_dict"), ("field.fine.", "network_fine_state_dict")):
        content[name] = {n.removeprefix(part): tensor for n, tensor in tensors.items() if n.startswith(part)}
    path = tmp_path_factory.mktemp("checkpoint") / "000700.tar"
    torch.save(content, path)
    return path


@pytest.fixture(scope="module")
def imported(still_life, checkpoint, tmp_path_factory):
    """A project with every stage learned on the checkpoint by the default preset."""
    folder = tmp_path_factory.mktemp("imported") / "project"
    assert run(*still_life.command(folder, *SMALL), "--nerf", checkpoint) == 0
    return Project(folder)


def rendered(project, out, *more):
    assert run("render", project.folder, "--views", "test", "--out", out, "--threads", 1, *more) == 0
    return out


def test_paper_preset_learns_every_stage_on_a_nerf(project, still_life, tmp_path):
    geometry = project.finished("geometry")
    assert geometry["space"] == "box" and geometry["parameters"] > 10_000
    palettes = read_palettes(project.palette_file)
    assert np.array_equal(palettes[0].colors, palettes[1].colors)  # one for all
    assert_renders_well(rendered(project, tmp_path), still_life, 22, 0.6)


def test_killed_job_resumes_from_its_last_checkpoint(still_life, tmp_path, monkeypatch, capsys):
    """Of 120 iterations with a preview every 40, saved after every iteration; at last only validation is left."""
    monkeypatch.setattr("karf_engine.fields.fit.CHECKPOINT_INTERVAL", 0.0)
    project = Project(tmp_path / "project")
    words = ("geometry", still_life.capture, "--project", project.folder, "--preset", "paper", "--threads", 1)
    few = sets(*SMALL, "geometry.nerf.iterations=120", "geometry.nerf.look_every=40")
    with monkeypatch.context() as patch:
        for printed in ("geometry", "resuming at iteration 80 of 120"):
            killed_in_the_second = Mock(side_effect=[None, KeyboardInterrupt])
            patch.setattr("karf_engine.commands.geometry.preview", killed_in_the_second)
            assert run(*words, *few) == Cancelled.exit_code and printed in capsys.readouterr().err
            assert project.finished("geometry") is None
    assert run(*words, *few) == 0 and "resuming at iteration 120 of 120" in capsys.readouterr().err
    assert project.finished("geometry") and not project.checkpoint_file("geometry").exists()


def test_default_compositing_is_that_of_the_paper(project, tmp_path):
    objects = {p.name: {"colors": [None] * len(p.colors)} for p in read_palettes(project.palette_file)}
    pictures = {}
    for mode in ("delta", "paper", None):
        edit = {"schema": "karf-edit/1", "objects": objects} | ({"compositing": mode} if mode else {})
        (tmp_path / "edit.json").write_text(json.dumps(edit))
        out = rendered(project, tmp_path / str(mode), "--edit", tmp_path / "edit.json")
        pictures[mode] = read_photo(out / "recolor" / "test_r_0.png")
    # paper compositing replaces the render's colors by mixed palette colors, even if the edit changes none
    render = read_photo(tmp_path / "delta" / "render" / "test_r_0.png")
    assert np.array_equal(pictures[None], pictures["paper"]) and np.array_equal(pictures["delta"], render)
    assert 0 < np.abs(pictures["paper"] - render).mean() < 0.1


def test_foreign_nerf_becomes_the_geometry(imported, checkpoint, still_life, tmp_path):
    geometry = imported.finished("geometry")
    assert geometry["space"] == "scaled" and geometry["psnr"] > 20 and geometry["nerf"] == str(checkpoint)
    assert (imported.folder / "preview.png").exists()
    assert_renders_well(rendered(imported, tmp_path), still_life, 22, 0.75)


def test_only_another_checkpoint_is_imported_again(imported, checkpoint, still_life, tmp_path):
    project = Project(shutil.copytree(imported.folder, tmp_path / "project"))
    command = [*geometry_command(still_life, project.folder, *SMALL), "--nerf"]
    before = project.finished("geometry")
    assert run(*command, checkpoint) == 0
    assert project.finished("geometry") == before
    content = torch.load(checkpoint, weights_only=True)
    torch.save(content | {"global_step": 701}, tmp_path / "000701.tar")
    assert run(*command, tmp_path / "000701.tar") == 0
    assert project.finished("geometry")["nerf"].endswith("000701.tar")


def test_unreadable_or_wrong_checkpoint_is_rejected(checkpoint, still_life, tmp_path, capsys):
    project = Project(tmp_path / "p")
    command = ("geometry", still_life.capture, "--project", project.folder, "--nerf")
    (tmp_path / "a.tar").write_bytes(b"no checkpoint")
    assert run(*command, tmp_path / "a.tar") == 4
    assert "a.tar cannot be read" in capsys.readouterr().err and not project.folder.exists()
    content = torch.load(checkpoint, weights_only=True)
    content["network_fine_state_dict"]["rgb_linear.weight"] *= -1
    torch.save(content, tmp_path / "other.tar")
    assert run(*command, tmp_path / "other.tar", *sets(*SMALL, "geometry.long_side=32")) == 4
    printed = capsys.readouterr().err
    assert "other.tar does not show this capture" in printed and "'scaled'" in printed and "near 2 and far 6" in printed
    assert project.finished("geometry") is None


def test_real_pretrained_nerf_renders_held_out_views(scenes, tmp_path):
    checkpoints = sorted((scenes / "checkpoints" / "chair-lowres").glob("*.ckpt"))
    if not checkpoints:
        pytest.skip("no pretrained NeRF among the real captures")
    command = ("geometry", scenes / "chair", "--project", tmp_path / "p", "--nerf", checkpoints[0], "--threads", 1)
    assert run(*command, *sets("geometry.long_side=48", "geometry.nerf.fine_samples=64")) == 0
    assert Project(tmp_path / "p").finished("geometry")["psnr"] >= 23
    options = ("--views", "test_r_0,test_r_48", "--out", tmp_path / "out", "--threads", 1)
    assert run("render", tmp_path / "p", *options) == 0
    for stem in ("r_0", "r_48"):
        photo = read_photo(scenes / "chair" / "test" / f"{stem}.png")
        on_white = photo[..., :3] * photo[..., 3:] + 1 - photo[..., 3:]
        found = read_photo(tmp_path / "out" / "render" / f"test_{stem}.png")[..., :3]
        assert psnr(found, resize(on_white, 48, 48)) >= 23
