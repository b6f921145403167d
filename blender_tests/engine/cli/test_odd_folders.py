"""The engine where users have their files: folders with spaces, letters of all alphabets, and long paths.

What is learned for the tests, `still_life` and `learned`, lies in such a folder.
"""

import shutil
import subprocess
import sys

import pytest

pytest.importorskip("torch")

from blender_tests.engine.conftest import LONG_PATH, ROOT, odd_folder, run_engine
from karf_engine.project import Project
from karf_engine.worker.protocol import EventReader, Request

FEW_LETTERS = {"PYTHONIOENCODING": "ascii"}  # a console that knows no letters but those of English


@pytest.fixture
def project(learned, tmp_path):
    """The learned still life, copied."""
    folder = odd_folder(tmp_path) / "project 1"
    assert len(str(folder)) > LONG_PATH
    shutil.copytree(learned.project, folder)
    return folder


def test_every_kind_of_frame_is_written_there(project):
    out = project.with_name("frames 1")
    options = ["--views", "test", "--layers", "--planes", "--depth", "--threads", "1", "--out", out]
    done = run_engine("render", project, *options, environment=FEW_LETTERS)
    assert done.returncode == 0, done.stderr
    assert {path.name for path in out.iterdir()} >= {"render", "masks", "layers", "planes", "depth"}


def test_what_is_printed_of_it_survives_a_console_of_few_letters(project):
    done = run_engine("palette", project / "壺", environment=FEW_LETTERS)
    assert done.returncode == 4 and "is not a KaRF project" in done.stderr and "\\u58fa" in done.stderr


def test_an_extension_installed_there_runs_a_job_as_blender_starts_it(project):
    engine = project.with_name("karf engine 1") / "karf_engine"
    shutil.copytree(ROOT / "karf_engine", engine, ignore=shutil.ignore_patterns("__pycache__"))
    job, edit = Project(project).new_job("match"), project.with_name("Änderung 1.json")
    options = {"object": "ball", "source": "#c04030", "target": "#3059b8", "out": str(edit)}
    Request("match", project, options).write(job)
    command = [sys.executable, "-I", "-B", "-u", "-X", "utf8", engine, "run", job]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, cwd=job, capture_output=True, text=True, encoding="utf-8")
    assert done.returncode == 0, done.stderr
    assert [event.kind for event in EventReader(job).poll()][-1] == "done"
    assert edit.is_file()
