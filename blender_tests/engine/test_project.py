"""The project folder: nothing half-written, one writer, and clear words for what is damaged."""

import json
import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from karf_engine.errors import BadRequest, DataError
from karf_engine.project import STAGE_ORDER, Project, atomic_write, read_json, write_json


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
        raise RuntimeError("the disk is full")

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
    assert seen[0].suffix == ".png" and seen[0].parent == tmp_path / "new" and not seen[0].exists()
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
    with pytest.raises(DataError, match=r"is no KaRF project \(project.json is missing\)"):
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


def test_finishing_a_stage_forgets_the_later_ones_and_keeps_the_earlier(project):
    for stage in STAGE_ORDER:
        project.finish(stage, f"mark of {stage}", seconds=1.5)
    project.finish("segmentation", "new")
    assert [project.finished(stage) is not None for stage in STAGE_ORDER] == [True, True, False, False]
    assert project.finished("geometry") == {"fingerprint": "mark of geometry", "seconds": 1.5}
    with pytest.raises(BadRequest, match="no finished palette stage") as caught:
        project.require("palette")
    assert "palette" in caught.value.hint


def test_job_folders_are_new_every_time(project):
    jobs = {project.new_job("render") for _ in range(5)}
    assert len(jobs) == 5 and all(job.is_dir() and job.name.endswith("-render") for job in jobs)


# ------------------------------------------------------------------------------------------------------------------ lock
HOLD = """
import sys
sys.path.insert(0, sys.argv[1])
from karf_engine.project import Project
with Project(sys.argv[2]).lock():
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def holder(project):
    root = Path(__file__).resolve().parents[2]
    child = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(root), str(project.folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert child.stdout.readline() == "held\n"
    yield child
    child.kill()
    child.wait()
    child.stdin.close()
    child.stdout.close()


def test_a_project_that_a_living_process_holds_is_refused(project, holder):
    with pytest.raises(BadRequest, match=f"in use by process {holder.pid}"), project.lock():
        pass


def test_the_lock_of_a_killed_process_is_taken_over(project, holder):
    holder.kill()
    holder.wait()
    assert (project.folder / "lock").exists()
    with project.lock():
        assert json.loads((project.folder / "lock").read_text())["pid"] == os.getpid()
    assert not (project.folder / "lock").exists()


def test_the_lock_is_given_back_after_an_error_and_is_not_entered_twice(project):
    with pytest.raises(RuntimeError), project.lock():
        with pytest.raises(BadRequest, match=f"in use by process {os.getpid()}"), project.lock():
            pass
        raise RuntimeError
    with project.lock():
        pass


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux tells when a process started")
def test_a_lock_whose_process_number_now_belongs_to_another_is_taken_over(project):
    (project.folder / "lock").write_text(json.dumps({"pid": os.getpid(), "start": "long ago"}))
    with project.lock():
        pass


def test_an_unreadable_lock_counts_while_it_is_young_and_not_when_it_is_old(project):
    path = project.folder / "lock"
    path.write_text("")
    with pytest.raises(BadRequest, match="in use"), project.lock():
        pass
    os.utime(path, (0, 0))
    with project.lock():
        pass
