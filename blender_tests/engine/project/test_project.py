"""The project folder: its state, committed results, masks, and the removal of leftovers."""

import json
import os
import shutil
import subprocess
import sys
from unittest.mock import Mock

import pytest

from blender_tests.engine.conftest import ROOT
from karf_engine.errors import BadRequest, DataError
from karf_engine.io.files import HOST, checksum, write_json
from karf_engine.project import STAGE_ORDER, Project
from karf_engine.project.state import result_fingerprint

SETTINGS = {stage: {"rate": 1} for stage in STAGE_ORDER}
HEADS = ("geometry", "segmentation", "palette", "recoloring")


def commit(project, stage, **files):
    """Finish a stage with outputs of these contents; `_` in names stands for `.`."""
    result = project.new_result(stage)
    for name, words in files.items():
        (result / name.replace("_", ".")).write_text(words)
    project.commit(stage, result, f"fingerprint of {stage}", SETTINGS)


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


def test_project_belongs_to_one_capture(project):
    project.finish("geometry", "abc")
    project.create("/captures/pots")
    assert project.finished("geometry") == {"fingerprint": "abc"}
    with pytest.raises(BadRequest, match=r"already holds a project of /captures/pots\..* /captures/other"):
        project.create("/captures/other")


@pytest.mark.parametrize(("facts", "holdout"), [(None, 0), ({}, 8), ({"holdout": 5}, 5)])
def test_holdout_defaults_to_eight_in_older_projects(project, tmp_path, facts, holdout):
    if facts is not None:
        project.finish("geometry", "abc", **facts)
    assert project.holdout() == holdout
    assert Project(tmp_path / "none").holdout() == 0


EMPTY = {"schema": "karf-project/1", "capture": "/film/pots", "stages": {}, "settings": {}}
BAD_STATES = [
    (None, r"is not a KaRF project \(project.json is missing\)"),
    ('{"schema": ', r"project\.json \(project state\) is broken JSON"),
    *((content, "has schema") for content in ('{"schema": "karf-project/2"}', "[]", "{}", "null")),
    *((EMPTY | {name: None}, "lacks its capture or its stages") for name in ("capture", "stages")),
    (EMPTY | {"stages": []}, "lacks its capture or its stages"),
    *((EMPTY | {"settings": value}, "has the settings") for value in (5, [1])),
    (EMPTY | {"outdated": 5}, "has the outdated stages 5"),
    *(
        (EMPTY | {"stages": {"geometry": value}}, "has no fingerprint, or no list of files, of its 'geometry' stage")
        for value in (7, None, {}, {"fingerprint": 3}, {"fingerprint": "g", "files": 3.5})
    ),
]


@pytest.mark.parametrize(("content", "sentence"), BAD_STATES)
def test_malformed_project_files_are_rejected(project, content, sentence):
    if content is None:
        project.state_file.unlink()
    else:
        project.state_file.write_text(content if isinstance(content, str) else json.dumps(content))
    with pytest.raises(DataError, match=sentence) as caught:
        project.state()
    assert str(project.folder) in caught.value.sentence and caught.value.hint and len(caught.value.sentence) < 1000


def test_project_file_needs_its_checksum_or_none(project):
    project.finish("geometry", "fingerprint")
    content = json.loads(project.state_file.read_text())
    content["stages"]["geometry"]["fingerprint"] = "other"
    write_json(project.state_file, content)
    with pytest.raises(DataError, match=r"project\.json is damaged, or was changed by hand") as caught:
        project.state()
    assert "remove its entry 'checksum'" in caught.value.hint
    del content["checksum"]
    write_json(project.state_file, content)
    assert project.finished("geometry")["fingerprint"] == "other"


@pytest.mark.parametrize(
    ("again", "left"),
    [
        ("geometry", ["geometry"]),
        ("segmentation", ["geometry", "segmentation", "splats"]),
        ("palette", ["geometry", "segmentation", "palette", "splats"]),
        ("recoloring", list(STAGE_ORDER)),
        ("splats", list(STAGE_ORDER)),
    ],
)
def test_finished_stage_outdates_only_dependent_stages(project, again, left):
    for stage in STAGE_ORDER:
        project.finish(stage, "old", seconds=1.5)
    project.finish(again, "new")
    assert [stage for stage in STAGE_ORDER if project.finished(stage)] == left
    assert project.finished(again) == {"fingerprint": "new"}
    assert all(project.finished(stage) == {"fingerprint": "old", "seconds": 1.5} for stage in left if stage != again)
    for stage in set(STAGE_ORDER) - set(left):
        with pytest.raises(BadRequest, match=f"no finished {stage} stage") as caught:
            project.require(stage)
        assert stage in caught.value.hint


def fingerprint_of_result(project, stage, changed=None, change=("inputs", "sum"), **summary):
    """The fingerprint of a stage's result once all stages are finished, one of them changed."""
    for each in STAGE_ORDER:
        fingerprint, checksum = change if each == changed else ("inputs", "sum")
        project.finish(each, fingerprint, files={f"{each}.safetensors": checksum}, **summary)
    return result_fingerprint(project.state(), stage)


@pytest.mark.parametrize("change", [("others", "sum"), ("inputs", "other sum")])
@pytest.mark.parametrize("changed", STAGE_ORDER)
def test_result_fingerprint_depends_only_on_stages_up_to_its_own(project, changed, change):
    for stage in HEADS:
        depends = changed in HEADS[: HEADS.index(stage) + 1]
        found = fingerprint_of_result(project, stage, changed, change, seconds=3.5)
        assert (found != fingerprint_of_result(project, stage)) == depends
    assert result_fingerprint({}, "segmentation") not in ("", fingerprint_of_result(project, "segmentation"))


def test_commit_stores_outputs_checksums_and_settings(project):
    commit(project, "geometry", capture_json="{}", geometry_safetensors="field")
    done = project.finished("geometry")
    assert done["files"].keys() == {"capture.json", "geometry.safetensors"} and done["settings"] == {"rate": 1}
    assert project.state()["settings"] == SETTINGS
    assert project.verified(project.geometry_file).read_text() == "field" and project.is_intact("geometry")


@pytest.mark.parametrize(("content", "state"), [("fielf", "damaged"), ("fie", "damaged"), (None, "missing")])
def test_damaged_outputs_are_reported_with_the_stage_to_rerun(project, content, state):
    commit(project, "geometry", geometry_safetensors="field")
    project.geometry_file.write_text(content) if content else project.geometry_file.unlink()
    with pytest.raises(DataError, match=rf"geometry\.safetensors is {state}.*the geometry stage wrote") as caught:
        project.verified(project.geometry_file)
    assert "Run the geometry stage again" in caught.value.hint and not project.is_intact("geometry")


def test_shared_output_comes_from_the_stage_run_last(project):
    commit(project, "palette", palette_json="extracted")
    commit(project, "recoloring", palette_json="learned", recoloring_safetensors="F_w")
    assert project.palette_file.read_text() == "learned"
    project.palette_file.write_text("damaged")
    assert project.is_intact("palette") and not project.is_intact("recoloring")
    commit(project, "palette", palette_json="extracted again")
    assert project.palette_file.read_text() == "extracted again" and not project.recoloring_file.exists()


@pytest.mark.parametrize("step", ["checksum", "write_state"])
def test_killed_commit_leaves_the_project_unchanged(project, monkeypatch, step):
    commit(project, "geometry", geometry_safetensors="old")
    before = project.state()

    with monkeypatch.context() as patch, pytest.raises(SystemExit):
        patch.setattr(f"karf_engine.project.folder.{step}", Mock(side_effect=SystemExit))
        commit(project, "geometry", geometry_safetensors="new")
    assert project.state() == before and project.geometry_file.read_text() == "old" and project.is_intact("geometry")


def test_snapshot_keeps_reading_its_results_until_removal(project, monkeypatch):
    commit(project, "geometry", geometry_safetensors="old")
    snapshot = project.snapshot()
    commit(project, "geometry", geometry_safetensors="new")
    project.remove_leftovers()
    assert snapshot.verified(snapshot.geometry_file).read_text() == "old"
    assert project.verified(project.geometry_file).read_text() == "new"
    monkeypatch.setattr("karf_engine.project.folder.READING_SECONDS", -1)
    project.remove_leftovers()
    assert names_in(project.folder / "results") == ["geometry-2"]


def test_results_of_earlier_versions_are_read_and_repaired(project):
    for name, words in (("geometry.safetensors", "field"), ("palette.json", "learned")):
        (project.folder / name).write_text(words)
    project.finish("geometry", "g")  # a version without checksums
    assert project.verified(project.geometry_file) == project.folder / "geometry.safetensors"
    project.finish("geometry", "g", files={"geometry.safetensors": checksum(project.geometry_file)})
    project.finish("palette", "p", files={"palette.json": "sum of the replaced file"})
    project.finish("recoloring", "r", files={"palette.json": checksum(project.folder / "palette.json")})
    assert project.geometry_file == project.folder / "geometry.safetensors"
    assert all(project.is_intact(stage) for stage in ("geometry", "palette", "recoloring"))
    commit(project, "recoloring", palette_json="learned again")
    assert project.palette_file.read_text() == "learned again" and project.is_intact("palette")


@pytest.mark.parametrize("folder", ["../elsewhere", "a/b", "", 3])
def test_invalid_result_folders_are_rejected(project, folder):
    project.finish("geometry", "g", folder=folder, files={"geometry.safetensors": "sum"})
    with pytest.raises(DataError, match=r"project\.json has a result named"):
        project.geometry_file  # noqa: B018


def test_foreign_folders_do_not_break_result_numbering(project):
    for name in ("geometry-x9", "geometry-²", "geometry-7"):
        (project.folder / "results" / name).mkdir(parents=True)
    assert project.new_result("geometry").name == "geometry-8"


def segment(project, mask):
    """Finish the segmentation with one mask of this name."""
    result = project.new_result("segmentation")
    (result / "masks").mkdir()
    (result / "masks" / mask).write_text(mask)
    (result / "segmentation.json").write_text("{}")
    project.commit("segmentation", result, "fingerprint", SETTINGS)


def test_replaced_masks_are_set_aside(project):
    for mask in ("first", "second", "second"):
        segment(project, mask)
        project.place_masks()
    assert project.masks_folder == project.folder / "masks" and names_in(project.masks_folder) == ["second"]
    assert names_in(project.folder / "earlier_masks") == ["first"]
    segment(project, "third")  # as if killed before place_masks: the new masks count at once
    assert names_in(project.masks_folder) == ["third"] and names_in(project.folder / "masks") == ["second"]
    project.remove_leftovers()
    assert project.masks_folder == project.folder / "masks" and names_in(project.masks_folder) == ["third"]


def test_masks_linked_from_outside_the_project_are_rejected(project, tmp_path):
    segment(project, "first")
    shutil.rmtree(project.masks_folder)
    (project.segmentation_report.parent / "masks").symlink_to(tmp_path.parent)
    with pytest.raises(DataError, match="outside of"):
        project.place_masks()


def test_only_leftovers_of_dead_processes_are_removed(project):
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    dead, alive, elsewhere = f"{HOST}-{ended.pid}", f"{HOST}-{os.getpid()}", f"{'0' * 8}-{ended.pid}"
    folders = [project.folder, project.planes_folder, project.photos_folder, project.masks_folder / "pot"]
    left = [folder / f".karf-{dead}-abcdefgh/new.png" for folder in folders]
    left.append(project.new_result("geometry") / "a.png")
    others = [folder / f".karf-{name}-abcdefgh/new.png" for folder in folders for name in (alive, elsewhere)]
    others += [project.folder / ".tmp.drivedownload/a.png", project.folder / ".tmp-1.png"]
    others += [project.folder / f".karf-{dead}/a.png", project.planes_folder / ".tmp-2.npz"]
    for path in left + others:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("half")
        os.utime(path, (0, 0))
    link = project.folder / ".tmp-nothing"
    link.symlink_to("nowhere")
    os.utime(project.state_file, (0, 0))
    project.remove_leftovers()
    assert not any(path.exists() for path in left) and all(path.exists() for path in others) and link.is_symlink()


def test_partial_file_of_a_killed_writer_is_removed(project):
    script = (
        "import os, sys; from pathlib import Path; from karf_engine.io.files import HOST, atomic_write\n"
        "atomic_write(Path(sys.argv[1]), lambda temporary: (temporary.write_text('half'), os._exit(9)))"
    )
    subprocess.run([sys.executable, "-c", script, str(project.palette_file)], cwd=ROOT, check=False)
    assert len(list(project.folder.glob(".karf-*/new.json"))) == 1 and not project.palette_file.exists()
    project.remove_leftovers()
    assert not list(project.folder.glob(".karf-*"))
