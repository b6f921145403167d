"""A project is never changed by a job that does not finish, and a plain rerun mends what was damaged."""

import json
import os
import shutil

import pytest

pytest.importorskip("torch")

from blender_tests.engine.commands.conftest import Events, geometry_command
from blender_tests.engine.conftest import QUICK
from karf_engine.cli import main
from karf_engine.commands.dispatch import run_command
from karf_engine.commands.options import LearnOptions, SegmentationOptions
from karf_engine.errors import Cancelled
from karf_engine.project import STAGE_ORDER, STAGE_VERSIONS
from karf_engine.project.locking import write_lock


def contents(project):
    """The files of a project but for locks, previews and caches; outputs of stages as `<stage>/<file>`."""
    stages = project.state()["stages"]
    files = {f"{stage}/{name}": project.output(name, stage) for stage in stages for name in stages[stage]["files"]}
    files["project.json"] = project.state_file
    files |= {str(path.relative_to(project.folder)): path for path in project.masks_folder.rglob("*.png")}
    return {name: path.read_bytes() for name, path in files.items()}


def learned_contents(project):
    """The contents, but not what another run in another folder rightly changes: seconds, and the way to the photos."""
    found = contents(project)
    del found["project.json"]
    capture = json.loads(found["geometry/capture.json"])
    for view in capture["views"]:
        del view["image_from_here"]
    return found | {"geometry/capture.json": capture}


def render(project, out, *more):
    return main(["render", str(project.folder), "--views", "test", "--out", str(out), "--threads", "1", *more])


def stages_run(printed):
    return [stage for stage in STAGE_ORDER if f"{stage}: already done" not in printed]


# ------------------------------------------------------------------------------------------------------------- cancelling
@pytest.mark.parametrize("change", ["seed=7", "segmentation.width=8"])
def test_a_cancelled_job_leaves_the_project_as_it_was(still_life, copy, change):
    before, steps = contents(copy), iter(range(5))
    options = {"capture": str(still_life.capture), "masks": str(still_life.masks), "overrides": [*QUICK, change]}
    with pytest.raises(Cancelled):
        learning = LearnOptions.of(project=copy.folder, threads=1, **options)
        run_command(learning, Events(), lambda: next(steps, None) is None)
    after = contents(copy)
    if change.startswith("segmentation"):  # it knows what was asked for of stages to come
        assert after.pop("project.json") != before.pop("project.json")
    assert after == before and all(copy.finished(stage) for stage in STAGE_ORDER)


def test_masks_of_a_cancelled_segmentation_are_not_kept_and_earlier_ones_are_set_aside(still_life, copy, tmp_path):
    masks = shutil.copytree(still_life.masks, tmp_path / "masks")
    shutil.copy(masks / "ball" / "r_0.png", masks / "block" / "r_0.png")
    before, events = contents(copy), Events()
    with pytest.raises(Cancelled):
        options = SegmentationOptions.of(project=copy.folder, masks=str(masks), threads=1)
        run_command(options, events, lambda: "segmentation" in events.values("progress", "stage"))
    assert contents(copy) == before
    shutil.rmtree(masks / "block")
    assert main(["segmentation", str(copy.folder), "--masks", str(masks), "--threads", "1"]) == 0
    assert {path.name for path in copy.masks_folder.iterdir()} == {"ball"}
    assert {path.name for path in (copy.folder / "earlier_masks").iterdir()} == {"ball", "block"}


# ----------------------------------------------------------------------------------------------------------------- damage
def flip_a_bit(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


SHOWN = ("geometry.safetensors", "capture.json", "segmentation.safetensors", "palette.json", "recoloring.safetensors")


@pytest.mark.parametrize("name", [*SHOWN, "splats.safetensors"])
def test_a_flipped_bit_is_noticed_before_anything_is_written(copy, tmp_path, capsys, name):
    flip_a_bit(copy.output(name))
    assert render(copy, tmp_path / "out") == 4
    assert f"{copy.output(name)} is damaged" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("names", "run"),
    [
        (("capture.json",), STAGE_ORDER),
        (("surface.safetensors",), STAGE_ORDER[1:4]),
        (("recoloring.safetensors", "splats.safetensors"), STAGE_ORDER[3:]),
    ],
)
def test_a_plain_rerun_mends_what_is_damaged_and_nothing_else(still_life, copy, capsys, names, run):
    before = learned_contents(copy)
    for name in names:
        flip_a_bit(copy.output(name))
    assert main(still_life.command(copy.folder)) == 0
    assert stages_run(capsys.readouterr().err) == list(run)
    assert learned_contents(copy) == before


# ------------------------------------------------------------------------------------------------------------ fingerprints
def test_a_stage_whose_code_gives_another_result_runs_again(still_life, copy, capsys, monkeypatch):
    monkeypatch.setitem(STAGE_VERSIONS, "palette", STAGE_VERSIONS["palette"] + 1)
    assert main(still_life.command(copy.folder)) == 0
    assert stages_run(capsys.readouterr().err) == ["palette", "recoloring"]


def test_photos_count_by_what_they_show_and_not_by_their_time(still_life, copy, capsys):
    photo, other, *_ = (still_life.capture / "train").iterdir()
    kept, stamp = photo.read_bytes(), photo.stat()
    try:
        for content, time, is_done in (
            (kept, stamp.st_mtime_ns + 1, True),
            (other.read_bytes(), stamp.st_mtime_ns, False),
        ):
            photo.write_bytes(content)
            os.utime(photo, ns=(stamp.st_atime_ns, time))
            assert main(geometry_command(still_life, copy.folder)) == 0
            assert ("geometry: already done" in capsys.readouterr().err) == is_done
    finally:
        photo.write_bytes(kept)
        os.utime(photo, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))


# ------------------------------------------------------------------------------------------------------------------- reading
def test_a_project_that_is_being_learned_anew_can_be_rendered(copy, tmp_path):
    with write_lock(copy):
        assert render(copy, tmp_path / "out") == 0 and len(list((tmp_path / "out" / "render").iterdir())) == 2
        # planes belong to the project: they wait for the job's end
        assert render(copy, tmp_path, "--planes") == 2
