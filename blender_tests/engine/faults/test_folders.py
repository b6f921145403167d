"""Folders that vanish, move, or cannot be written, and photos that are gone."""

import os
import shutil
import time
from functools import partial

import pytest

pytest.importorskip("torch")

from blender_tests.engine.faults.engine import Child, run

NOBODY = 65534  # root may write everywhere, so it becomes somebody who may not


def during(scenario, act):
    """The end of a stage half-way through which something happens."""
    child = Child(scenario.command)
    time.sleep(0.5 * scenario.seconds)
    act()
    return child.wait()


def begun(bench, few):
    return [scenario for scenario in bench.some(few) if scenario.start is not None]


def test_the_project_is_taken_away_and_brought_back(bench, few, subtests):
    away = bench.folder / "away"
    for scenario in begun(bench, few):
        with subtests.test(stage=scenario.title):
            bench.restore(scenario.start)
            ended = during(scenario, partial(bench.project.rename, away))
            shutil.rmtree(bench.project, ignore_errors=True)
            away.rename(bench.project)
            bench.survives(scenario, ended)


def test_the_project_is_deleted_while_a_stage_runs(bench, few, subtests):
    """Nothing can be kept, but it is said."""
    for scenario in begun(bench, few):
        with subtests.test(stage=scenario.title):
            bench.restore(scenario.start)
            ended = during(scenario, partial(shutil.rmtree, bench.project, ignore_errors=True))
            bench.restore(scenario.start)
            bench.survives(scenario, ended)


def test_the_project_cannot_be_written(bench, few, subtests):
    become_nobody = partial(os.setuid, NOBODY) if os.getuid() == 0 else None
    open_to_all(bench.folder)
    for scenario in bench.some(few):
        with subtests.test(stage=scenario.title):
            bench.restore(scenario.start)
            bench.project.mkdir(exist_ok=True)
            paths = [bench.project, *bench.project.rglob("*")]
            for path in paths:
                path.chmod(0o555 if path.is_dir() else 0o444)
            ended = run(scenario.command, become_nobody)
            for path in paths:
                path.chmod(0o755 if path.is_dir() else 0o644)
            bench.survives(scenario, ended)


def open_to_all(folder):
    """Let everybody read the workspace and write its logs."""
    for path in (folder, *folder.parents[:-1]):
        if path.owner() == folder.owner() and not path.stat().st_mode & 0o005:
            path.chmod(0o755)


def test_the_photos_are_gone(bench, few, subtests):
    photos, away = bench.capture / "train", bench.capture / "away"
    for scenario in bench.some(few):
        with subtests.test(stage=scenario.title):
            bench.restore(scenario.start)
            photos.rename(away)
            try:
                ended = run(scenario.command)
            finally:
                away.rename(photos)
            bench.survives(scenario, ended)


@pytest.mark.parametrize("name", ["capture/transforms_test.json", "capture/transforms_test.json/project", "x" * 300])
def test_a_project_where_none_can_be(bench, name):
    """A file, in a file, and a name of 300 letters."""
    command = bench.command("geometry")
    command[command.index("--project") + 1] = str(bench.folder / name)
    ended = run(command)
    assert ended.code and ended.flaw is None
