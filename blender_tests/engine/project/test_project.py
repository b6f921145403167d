"""The project folder: nothing half-written, one writer, and clear words for what is damaged."""

import json
import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from karf_engine.errors import BadRequest, DataError
from karf_engine.io.files import HOST, atomic_write, checksum, read_json, write_json
from karf_engine.project import BUILT_ON, STAGE_ORDER, Project

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def project(tmp_path):
    project = Project(tmp_path / "project")
    project.create("/captures/pots")
    return project


# --------------------------------------------------------------------------------------------------------------- writing
def test_a_failed_write_leaves_the_old_file_and_no_other(tmp_path):
    path = tmp_path / "a.json"
    write_json(path, {"old": True})

    def fail(temporary):
        temporary.write_text("half")
        raise RuntimeError("no such color")

    with pytest.raises(RuntimeError):
        atomic_write(path, fail)
    with pytest.raises(ValueError):
        write_json(path, {"bad": float("nan")})
    assert read_json(path, "test") == {"old": True}
    assert [file.name for file in tmp_path.iterdir()] == ["a.json"]


def test_a_written_file_keeps_its_suffix_on_the_way_and_has_the_usual_rights(tmp_path):
    seen = []

    def write(temporary):
        seen.append(temporary)
        temporary.write_text("x")

    atomic_write(tmp_path / "new" / "a.png", write)
    (tmp_path / "plain").write_text("x")
    assert seen[0].suffix == ".png" and seen[0].parent.parent == tmp_path / "new" and not seen[0].exists()
    rights = [stat.S_IMODE(file.stat().st_mode) for file in (tmp_path / "new" / "a.png", tmp_path / "plain")]
    assert rights[0] == rights[1]


def test_broken_json_is_named_with_its_line(tmp_path):
    (tmp_path / "a.json").write_text('{"a": 1,\n "b": }')
    with pytest.raises(DataError, match=r"a\.json \(test\) is broken JSON at line 2"):
        read_json(tmp_path / "a.json", "test")
    with pytest.raises(DataError, match="does not exist"):
        read_json(tmp_path / "b.json", "test")
    (tmp_path / "c.json").write_bytes(b"\xff\xfe\xfa")
    with pytest.raises(DataError, match="cannot be read"):
        read_json(tmp_path / "c.json", "test")


def test_a_byte_order_mark_does_no_harm(tmp_path):
    (tmp_path / "a.json").write_bytes(b"\xef\xbb\xbf[1]")
    assert read_json(tmp_path / "a.json", "test") == [1]


# ----------------------------------------------------------------------------------------------------------------- state
def test_a_project_is_made_once_and_for_one_capture(project):
    project.finish("geometry", "abc")
    project.create("/captures/pots")
    assert project.finished("geometry") == {"fingerprint": "abc"}
    with pytest.raises(BadRequest, match="already holds a project of /captures/pots"):
        project.create("/captures/other")


def test_a_folder_that_is_no_project_is_said_to_be_none(tmp_path):
    with pytest.raises(DataError, match=r"is not a KaRF project \(project.json is missing\)"):
        Project(tmp_path).state()


@pytest.mark.parametrize("content", ['{"schema": "karf-project/2"}', "[]", "{}", "null"])
def test_a_project_of_another_schema_is_refused(project, content):
    project.state_file.write_text(content)
    with pytest.raises(DataError, match="has schema"):
        project.state()


@pytest.mark.parametrize("content", ['{"schema": "karf-project/1"}', '{"schema": "karf-project/1", "capture": "c"}'])
def test_a_project_file_with_parts_missing_is_damaged(project, content):
    project.state_file.write_text(content)
    with pytest.raises(DataError, match="lacks its capture or its stages"):
        project.finished("geometry")


def test_a_broken_project_file_is_named(project):
    project.state_file.write_text('{"schema": ')
    with pytest.raises(DataError, match=r"project\.json \(project state\) is broken JSON"):
        project.finished("geometry")


def test_finishing_a_stage_outdates_the_later_ones_and_keeps_the_earlier(project):
    for stage in STAGE_ORDER:
        project.finish(stage, f"fingerprint of {stage}", seconds=1.5)
    project.finish("segmentation", "new")
    assert [project.finished(stage) is not None for stage in STAGE_ORDER] == [True, True, False, False, True]
    assert project.finished("geometry") == {"fingerprint": "fingerprint of geometry", "seconds": 1.5}
    with pytest.raises(BadRequest, match="no finished palette stage") as caught:
        project.require("palette")
    assert "palette" in caught.value.hint


@pytest.mark.parametrize(
    ("again", "left"),
    [
        ("geometry", {"geometry"}),
        ("segmentation", {"geometry", "segmentation", "splats"}),
        ("palette", {"geometry", "segmentation", "palette", "splats"}),
        ("recoloring", set(STAGE_ORDER)),
        ("splats", set(STAGE_ORDER)),
    ],
)
def test_a_stage_outdates_what_is_built_on_it_and_nothing_else(project, again, left):
    for stage in STAGE_ORDER:
        project.finish(stage, "old")
    project.finish(again, "new")
    assert {stage for stage in STAGE_ORDER if project.finished(stage)} == left


def test_every_stage_but_the_first_is_built_on_an_earlier_one():
    assert BUILT_ON.keys() == set(STAGE_ORDER[1:])
    assert all(STAGE_ORDER.index(BUILT_ON[stage]) < STAGE_ORDER.index(stage) for stage in BUILT_ON)


def test_job_folders_are_new_every_time(project):
    jobs = {project.new_job("render") for _ in range(5)}
    assert len(jobs) == 5 and all(job.is_dir() and job.name.endswith("-render") for job in jobs)


# ----------------------------------------------------------------------------------------------------------------- files
SETTINGS = {stage: {"rate": 1} for stage in STAGE_ORDER}


def commit(project, stage, **files):
    """Finish a stage whose outputs hold these words; names have `_` for `.`."""
    result = project.new_result(stage)
    for name, words in files.items():
        (result / name.replace("_", ".")).write_text(words)
    project.commit(stage, result, f"fingerprint of {stage}", SETTINGS)


def test_outputs_take_their_places_with_their_checksums_and_settings(project):
    commit(project, "geometry", capture_json="{}", geometry_safetensors="field")
    done = project.finished("geometry")
    assert done["files"].keys() == {"capture.json", "geometry.safetensors"} and done["settings"] == {"rate": 1}
    assert project.state()["settings"] == SETTINGS
    assert project.verified(project.geometry_file).read_text() == "field" and project.is_intact("geometry")


@pytest.mark.parametrize("damage", ["flip", "cut", "gone"])
def test_an_output_that_is_not_what_was_written_is_named_with_the_stage_to_run(project, damage):
    commit(project, "geometry", geometry_safetensors="field")
    if damage == "gone":
        project.geometry_file.unlink()
    else:
        project.geometry_file.write_text({"flip": "fielf", "cut": "fie"}[damage])
    with pytest.raises(
        DataError, match=r"geometry\.safetensors is (damaged|missing).*the geometry stage wrote"
    ) as caught:
        project.verified(project.geometry_file)
    assert "Run the geometry stage again" in caught.value.hint and not project.is_intact("geometry")


def test_a_file_that_two_stages_write_is_the_later_ones_until_the_earlier_runs_again(project):
    commit(project, "palette", palette_json="extracted")
    commit(project, "recoloring", palette_json="learned", recoloring_safetensors="F_w")
    assert project.palette_file.read_text() == "learned"
    project.palette_file.write_text("damaged")
    assert project.is_intact("palette") and not project.is_intact("recoloring")
    commit(project, "palette", palette_json="extracted again")
    assert project.palette_file.read_text() == "extracted again" and not project.recoloring_file.exists()


@pytest.mark.parametrize("step", ["checksum", "write_state"])
def test_a_stage_that_is_killed_while_it_commits_leaves_the_project_as_it_was(project, monkeypatch, step):
    commit(project, "geometry", geometry_safetensors="old")
    before = project.state()

    def stop(*_):
        raise SystemExit

    with monkeypatch.context() as patch, pytest.raises(SystemExit):
        patch.setattr(f"karf_engine.project.folder.{step}", stop)
        commit(project, "geometry", geometry_safetensors="new")
    assert project.state() == before and project.geometry_file.read_text() == "old" and project.is_intact("geometry")


def test_a_snapshot_reads_the_results_of_its_time_until_they_are_removed(project, monkeypatch):
    commit(project, "geometry", geometry_safetensors="old")
    snapshot = project.snapshot()
    commit(project, "geometry", geometry_safetensors="new")
    project.remove_leftovers()
    assert snapshot.verified(snapshot.geometry_file).read_text() == "old"
    assert project.verified(project.geometry_file).read_text() == "new"
    monkeypatch.setattr("karf_engine.project.folder.READING_SECONDS", -1)
    project.remove_leftovers()
    assert [path.name for path in (project.folder / "results").iterdir()] == ["geometry-2"]


def test_results_that_an_earlier_version_wrote_beside_the_project_file_are_read_and_mended(project):
    for name, words in (("geometry.safetensors", "field"), ("palette.json", "learned")):
        (project.folder / name).write_text(words)
    sums = {name: checksum(project.folder / name) for name in ("geometry.safetensors", "palette.json")}
    project.finish("geometry", "g", files={"geometry.safetensors": sums["geometry.safetensors"]})
    project.finish("palette", "p", files={"palette.json": "of what recoloring replaced"})
    project.finish("recoloring", "r", files={"palette.json": sums["palette.json"]})
    assert project.geometry_file == project.folder / "geometry.safetensors"
    assert all(project.is_intact(stage) for stage in ("geometry", "palette", "recoloring"))
    commit(project, "recoloring", palette_json="learned again")
    assert project.palette_file.read_text() == "learned again" and project.is_intact("palette")


@pytest.mark.parametrize("folder", ["../elsewhere", "a/b", "", 3])
def test_a_project_file_that_names_no_folder_of_results_is_refused(project, folder):
    project.finish("geometry", "g", folder=folder, files={"geometry.safetensors": "sum"})
    with pytest.raises(DataError, match=r"project\.json has a result named"):
        project.geometry_file  # noqa: B018


def segment(project, mask):
    """Finish the segmentation with a mask of this name."""
    result = project.new_result("segmentation")
    (result / "masks").mkdir()
    (result / "masks" / mask).write_text(mask)
    (result / "segmentation.json").write_text("{}")
    project.commit("segmentation", result, "fingerprint", SETTINGS)


def names_in(folder):
    return [path.name for path in folder.iterdir()]


def test_folders_that_another_program_named_like_results_do_no_harm(project):
    for name in ("geometry-x9", "geometry-²", "geometry-7"):
        (project.folder / "results" / name).mkdir(parents=True)
    assert project.new_result("geometry").name == "geometry-8"


def test_new_masks_that_are_a_link_out_of_the_project_are_refused(project, tmp_path):
    segment(project, "first")
    shutil.rmtree(project.masks_folder)
    (project.segmentation_report.parent / "masks").symlink_to(tmp_path.parent)
    with pytest.raises(DataError, match="outside of"):
        project.place_masks()


def test_masks_that_are_replaced_are_set_aside(project):
    for mask in ("first", "second", "second"):
        segment(project, mask)
        project.place_masks()
    assert project.masks_folder == project.folder / "masks" and names_in(project.masks_folder) == ["second"]
    assert names_in(project.folder / "earlier_masks") == ["first"]


def test_masks_belong_to_the_segmentation_at_once_and_the_next_job_puts_them_in_their_place(project):
    segment(project, "first")
    project.place_masks()
    segment(project, "second")  # and the job is killed
    assert names_in(project.masks_folder) == ["second"] and names_in(project.folder / "masks") == ["first"]
    project.remove_leftovers()
    assert project.masks_folder == project.folder / "masks" and names_in(project.masks_folder) == ["second"]


def test_a_damaged_project_file_is_refused_and_one_without_a_checksum_is_believed(project):
    commit(project, "geometry", geometry_safetensors="field")
    text = project.state_file.read_text()
    project.state_file.write_text(text.replace("fingerprint of geometry", "fingerprint of geometrz"))
    with pytest.raises(DataError, match=r"project\.json is damaged, or was changed by hand") as caught:
        project.state()
    assert "remove its entry 'checksum'" in caught.value.hint
    content = json.loads(project.state_file.read_text())
    del content["checksum"]
    write_json(project.state_file, content)
    assert project.finished("geometry")["fingerprint"] == "fingerprint of geometrz"


def test_a_project_made_before_there_were_checksums_is_believed(project):
    project.finish("geometry", "fingerprint")
    project.geometry_file.write_text("any")
    assert project.verified(project.geometry_file) == project.geometry_file and project.is_intact("geometry")


def test_what_killed_jobs_left_is_removed_and_what_others_may_be_writing_is_not(project):
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    dead, alive, elsewhere = f"{HOST}-{ended.pid}", f"{HOST}-{os.getpid()}", f"{'0' * 8}-{ended.pid}"
    folders = [project.folder, project.planes_folder, project.photos_folder, project.masks_folder / "pot"]
    left = [
        project.new_result("geometry") / "a.png",
        *(folder / f".karf-{dead}-abcdefgh/new.png" for folder in folders),
    ]
    others = [folder / f".karf-{name}-abcdefgh/new.png" for folder in folders for name in (alive, elsewhere)]
    others += [project.folder / ".tmp.drivedownload/a.png", project.folder / ".tmp-1.png"]
    others += [project.folder / f".karf-{dead}/a.png", project.planes_folder / ".tmp-2.npz"]
    for path in left + others:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("half")
        os.utime(path, (0, 0))
    (project.folder / ".tmp-nothing").symlink_to("nowhere")
    os.utime(project.state_file, (0, 0))
    project.remove_leftovers()
    assert not any(path.parent.exists() and path.exists() for path in left) and all(path.exists() for path in others)
    assert (project.folder / ".tmp-nothing").is_symlink()


def test_a_killed_writer_leaves_nothing_once_its_process_has_ended(project):
    script = (
        "import os, sys; from pathlib import Path; from karf_engine.io.files import HOST, atomic_write\n"
        "atomic_write(Path(sys.argv[1]), lambda temporary: (temporary.write_text('half'), os._exit(9)))"
    )
    subprocess.run([sys.executable, "-c", script, str(project.palette_file)], cwd=ROOT, check=False)
    assert len(list(project.folder.glob(".karf-*/new.json"))) == 1 and not project.palette_file.exists()
    project.remove_leftovers()
    assert not list(project.folder.glob(".karf-*"))


def test_a_file_whose_name_is_as_long_as_a_name_can_be_is_written(tmp_path):
    path = tmp_path / ("n" * 251 + ".png")
    atomic_write(path, lambda temporary: temporary.write_text("x"))
    assert path.read_text() == "x"
