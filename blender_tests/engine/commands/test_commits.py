"""An unfinished job never changes a project, and a rerun resumes it or repairs damage."""

import json
import os
import shutil

import pytest
import torch

from blender_tests.engine.commands.conftest import Events, geometry_command, run, stages_run
from blender_tests.engine.conftest import QUICK
from karf_engine.commands.dispatch import run_command
from karf_engine.commands.options import LearnOptions, SegmentationOptions
from karf_engine.compute.progress import Progress
from karf_engine.errors import Cancelled, Diverged
from karf_engine.io.checkpoints import load_tensors
from karf_engine.project import STAGE_ORDER, STAGE_VERSIONS, Project
from karf_engine.project.locking import write_lock
from karf_engine.project.state import without_stage, write_state


def contents(project):
    """The files of a project except locks, previews and caches; outputs of stages as `<stage>/<file>`."""
    stages = project.state()["stages"]
    files = {f"{stage}/{name}": project.output(name, stage) for stage in stages for name in stages[stage]["files"]}
    files["project.json"] = project.state_file
    files |= {str(path.relative_to(project.folder)): path for path in project.masks_folder.rglob("*.png")}
    return {name: path.read_bytes() for name, path in files.items()}


def learned_contents(project):
    """The contents except what a run in another folder may change: seconds and relative paths to the photos."""
    found = contents(project)
    del found["project.json"]
    capture = json.loads(found["geometry/capture.json"])
    for view in capture["views"]:
        del view["image_from_here"]
    return found | {"geometry/capture.json": capture}


def render(project, out, *more):
    return run("render", project.folder, "--views", "test", "--out", out, "--threads", 1, *more)


@pytest.mark.parametrize("change", ["seed=7", "segmentation.width=8"])
def test_cancelled_job_leaves_the_project_unchanged(still_life, copy, change):
    before, steps = contents(copy), iter(range(5))
    inputs = {"capture": str(still_life.capture), "masks": str(still_life.masks)}
    options = LearnOptions.of(project=copy.folder, threads=1, overrides=[*QUICK, change], **inputs)
    with pytest.raises(Cancelled):
        run_command(options, Events(), lambda: next(steps, None) is None)
    after = contents(copy)
    if change.startswith("segmentation"):  # settings of later stages are stored first
        assert after.pop("project.json") != before.pop("project.json")
    assert after == before and all(copy.finished(stage) for stage in STAGE_ORDER)


def test_only_finished_segmentation_replaces_masks(still_life, copy, tmp_path):
    masks = shutil.copytree(still_life.masks, tmp_path / "masks")
    shutil.copy(masks / "ball" / "r_0.png", masks / "block" / "r_0.png")
    before, events = contents(copy), Events()
    options = SegmentationOptions.of(project=copy.folder, masks=str(masks), threads=1)
    with pytest.raises(Cancelled):
        run_command(options, events, lambda: "segmentation" in events.values("progress", "stage"))
    assert contents(copy) == before
    shutil.rmtree(masks / "block")
    assert run("segmentation", copy.folder, "--masks", masks, "--threads", 1) == 0
    assert {path.name for path in copy.masks_folder.iterdir()} == {"ball"}
    assert {path.name for path in (copy.folder / "earlier_masks").iterdir()} == {"ball", "block"}


@pytest.mark.parametrize("stage", ["segmentation", "recoloring"])
def test_cancelled_head_resumes_to_the_same_file(copy, learned, stage, monkeypatch, capsys):
    write_state(copy.state_file, without_stage(copy.state(), stage))
    count, steps = Progress.step, []

    def cancel(progress, number=1, **metrics):
        count(progress, number, **metrics)
        steps.extend([1] if "loss" in metrics or "palette" in metrics else [])
        if len(steps) > 25:
            raise Cancelled("The test wants it.")

    masks = ("--masks", copy.masks_folder) if stage == "segmentation" else ()
    command = (stage, copy.folder, *masks, "--threads", 1)
    with monkeypatch.context() as patch:
        patch.setattr(Progress, "step", cancel)
        assert run(*command) == Cancelled.exit_code
    assert copy.checkpoint_file(stage).exists()
    assert run(*command) == 0
    assert "resuming at iteration 26 of" in capsys.readouterr().err
    (a, facts), (b, other) = (
        load_tensors(project.output(f"{stage}.safetensors"), f"karf-{stage}/1")
        for project in (Project(learned.project), copy)
    )
    assert facts == other and a.keys() == b.keys() and all(torch.equal(a[name], b[name]) for name in a)
    assert not copy.checkpoint_file(stage).exists()


def test_diverged_geometry_leaves_no_checkpoint(still_life, tmp_path, monkeypatch):
    def find_nothing(fit):
        assert Project(tmp_path).checkpoint_file("geometry").exists()
        raise Diverged("Nothing is solid.")

    levels = 'geometry.levels=[{"voxels":16,"iterations":60,"step":1.0},{"voxels":20,"iterations":60,"step":1.0}]'
    few = (levels, "geometry.samples=4000", "geometry.max_rays=512")
    monkeypatch.setattr("karf_engine.fields.fit.CHECKPOINT_INTERVAL", 0.0)
    monkeypatch.setattr("karf_engine.fields.voxels.fit.VoxelFit._pruned", find_nothing)
    assert run(*geometry_command(still_life, tmp_path, *few)) == Diverged.exit_code
    assert not Project(tmp_path).checkpoint_file("geometry").exists()


def flip_a_bit(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


TENSORS = [f"{stage}.safetensors" for stage in ("geometry", "segmentation", "recoloring", "splats")]


@pytest.mark.parametrize("name", [*TENSORS, "capture.json", "palette.json"])
def test_flipped_bit_is_rejected_before_writing(copy, tmp_path, capsys, name):
    flip_a_bit(copy.output(name))
    assert render(copy, tmp_path / "out") == 4
    assert f"{copy.output(name)} is damaged" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("names", "stages"),
    [
        (["capture.json"], STAGE_ORDER),
        (["surface.safetensors"], STAGE_ORDER[1:4]),
        (["recoloring.safetensors", "splats.safetensors"], STAGE_ORDER[3:]),
    ],
)
def test_rerun_repairs_only_damaged_stages(still_life, copy, capsys, names, stages):
    before = learned_contents(copy)
    for name in names:
        flip_a_bit(copy.output(name))
    assert run(*still_life.command(copy.folder)) == 0
    assert stages_run(capsys.readouterr().err) == list(stages)
    assert learned_contents(copy) == before


def test_new_stage_version_runs_the_stage_again(still_life, copy, capsys, monkeypatch):
    monkeypatch.setitem(STAGE_VERSIONS, "palette", STAGE_VERSIONS["palette"] + 1)
    assert run(*still_life.command(copy.folder)) == 0
    assert stages_run(capsys.readouterr().err) == ["palette", "recoloring"]


def test_photos_are_compared_by_content_and_not_by_time(still_life, copy, capsys):
    photo, other, *_ = (still_life.capture / "train").iterdir()
    kept, stamp = photo.read_bytes(), photo.stat()
    try:
        for content, later, is_done in ((kept, 1, True), (other.read_bytes(), 0, False)):
            photo.write_bytes(content)
            os.utime(photo, ns=(stamp.st_atime_ns, stamp.st_mtime_ns + later))
            assert run(*geometry_command(still_life, copy.folder)) == 0
            assert ("geometry: already done" in capsys.readouterr().err) == is_done
    finally:
        photo.write_bytes(kept)
        os.utime(photo, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))


def test_locked_project_can_be_rendered_without_planes(copy, tmp_path):
    with write_lock(copy):
        assert render(copy, tmp_path / "out") == 0 and len(list((tmp_path / "out" / "render").iterdir())) == 2
        assert render(copy, tmp_path, "--planes") == 2  # which are written into the project
