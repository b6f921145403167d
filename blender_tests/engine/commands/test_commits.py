"""A project is never changed by a job that does not finish, and a plain rerun mends what was damaged."""

import json
import os
import shutil

import pytest

pytest.importorskip("torch")

from blender_tests.engine.commands.conftest import geometry_command
from blender_tests.engine.conftest import QUICK
from karf_engine.cli import main
from karf_engine.commands.dispatch import run_command
from karf_engine.commands.options import LearnOptions, SegmentationOptions
from karf_engine.errors import Cancelled
from karf_engine.project import STAGE_ORDER, STAGE_VERSIONS, Project
from karf_engine.project.locking import write_lock


def contents(folder):
    """Return the contents of a folder's files, with those of a project's stages as `<stage>/<file>`."""
    # lock files, previews of learning and cached renderings are not results
    skipped = {"lock", "preview.png"}
    files = {
        path.relative_to(folder): path for path in folder.rglob("*") if path.is_file() and path.name not in skipped
    }
    found = {str(name): path for name, path in files.items() if not {"looks", "results"} & set(name.parts)}
    if (folder / "project.json").exists():
        project = Project(folder)
        stages = project.state()["stages"]
        found |= {f"{stage}/{name}": project.output(name, stage) for stage in stages for name in stages[stage]["files"]}
    return {name: path.read_bytes() for name, path in found.items() if "unfinished" not in path.name}


def learned_contents(folder):
    """The contents, but not what another run in another folder rightly changes: seconds, and the way to the photos."""
    found = contents(folder)
    del found["project.json"]
    capture = json.loads(found["geometry/capture.json"])
    for view in capture["views"]:
        del view["image_from_here"]
    return found | {"geometry/capture.json": capture}


def pictures(project, out):
    assert main(["render", str(project.folder), "--views", "test", "--out", str(out), "--threads", "1"]) == 0
    return contents(out)


def stages_run(printed):
    return [stage for stage in STAGE_ORDER if f"{stage}: already done" not in printed]


# ------------------------------------------------------------------------------------------------------------- cancelling
@pytest.mark.parametrize("change", ["seed=7", "segmentation.width=8"])
def test_a_cancelled_job_leaves_the_project_as_it_was(still_life, copy, tmp_path, change):
    before, shown = contents(copy.folder), pictures(copy, tmp_path / "before")
    options = {"capture": str(still_life.capture), "masks": str(still_life.masks), "threads": 1}
    options["overrides"] = [*QUICK, change]
    steps = iter(range(5))
    with pytest.raises(Cancelled):
        learning = LearnOptions.of(project=copy.folder, **options)
        run_command(learning, lambda *_, **__: None, lambda: next(steps, None) is None)
    after = contents(copy.folder)
    if change.startswith(("segmentation", "recoloring")):  # it knows what was asked for of stages to come
        assert after.pop("project.json") != before.pop("project.json")
    assert after == before
    assert all(copy.finished(stage) for stage in STAGE_ORDER)
    assert pictures(copy, tmp_path / "after") == shown


def test_masks_of_a_cancelled_segmentation_are_not_kept(still_life, copy, tmp_path):
    masks = shutil.copytree(still_life.masks, tmp_path / "masks")
    shutil.copy(masks / "ball" / "r_0.png", masks / "block" / "r_0.png")
    before, fitting = contents(copy.folder), []

    def listen(kind, /, **values):
        fitting.extend([1] if kind == "progress" and values["stage"] == "segmentation" else [])

    with pytest.raises(Cancelled):
        options = {"masks": str(masks), "threads": 1}
        run_command(SegmentationOptions.of(project=copy.folder, **options), listen, lambda: bool(fitting))
    assert contents(copy.folder) == before


def test_masks_of_an_earlier_segmentation_are_set_aside(still_life, copy, tmp_path):
    masks = shutil.copytree(still_life.masks, tmp_path / "masks")
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
    assert main(["render", str(copy.folder), "--views", "test", "--out", str(tmp_path / "out")]) == 4
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
    before = learned_contents(copy.folder)
    for name in names:
        flip_a_bit(copy.output(name))
    assert main(still_life.command(copy.folder)) == 0
    assert stages_run(capsys.readouterr().err) == list(run)
    assert learned_contents(copy.folder) == before


# ------------------------------------------------------------------------------------------------------------ fingerprints
def test_a_stage_whose_code_gives_another_result_runs_again(still_life, copy, capsys, monkeypatch):
    monkeypatch.setitem(STAGE_VERSIONS, "palette", STAGE_VERSIONS["palette"] + 1)
    assert main(still_life.command(copy.folder)) == 0
    assert stages_run(capsys.readouterr().err) == ["palette", "recoloring"]


def test_photos_count_by_what_they_show_and_not_by_their_time(still_life, copy, capsys):
    geometry = geometry_command(still_life, copy.folder)
    photo, other, *_ = (still_life.capture / "train").iterdir()
    kept, stamp = photo.read_bytes(), photo.stat()
    try:
        os.utime(photo)
        assert main(geometry) == 0 and "geometry: already done" in capsys.readouterr().err
        photo.write_bytes(other.read_bytes())
        os.utime(photo, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
        assert main(geometry) == 0 and "geometry: already done" not in capsys.readouterr().err
    finally:
        photo.write_bytes(kept)
        os.utime(photo, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))


# ------------------------------------------------------------------------------------------------------------------- reading
def test_a_project_that_is_being_learned_anew_can_be_rendered(copy, tmp_path):
    with write_lock(copy):
        assert pictures(copy, tmp_path / "out")
        # planes belong to the project: they wait for the job's end
        assert main(["render", str(copy.folder), "--views", "test", "--planes", "--out", str(tmp_path)]) == 2
