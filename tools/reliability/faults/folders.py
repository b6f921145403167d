"""Folders that vanish, move, or cannot be written, and photos that are gone."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from .bench import Bench, Scenario
from .engine import Child, Run, run
from .trial import Trial, trial

NOBODY = 65534  # root may write everywhere, so it becomes somebody who may not


def folders(bench: Bench, few: bool) -> Iterator[Trial]:
    """All of them, few: each for one stage only."""
    for scenario in bench.some(few):
        if scenario.start is not None:
            yield _moved(bench, scenario)
            yield _deleted(bench, scenario)
        yield _unwritable(bench, scenario)
        yield _without_photos(bench, scenario)
    for case, project in _impossible(bench):
        command = bench.command("geometry")
        command[command.index("--project") + 1] = str(project)
        ended = run(command)
        refused = None if ended.code else "is not refused"
        yield trial("a project where none can be", case, None, ended.flaw or refused, seen=ended.sentence)


def _during(bench: Bench, scenario: Scenario, act: Callable[[], object]) -> Run:
    child = Child(scenario.command)
    time.sleep(0.5 * scenario.seconds)
    act()
    return child.wait()


def _moved(bench: Bench, scenario: Scenario) -> Trial:
    """The project's folder is taken away while a stage runs, and brought back after it."""
    away = bench.folder / "away"
    bench.restore(scenario.start)
    ended = _during(bench, scenario, lambda: bench.project.rename(away))
    shutil.rmtree(bench.project, ignore_errors=True)
    away.rename(bench.project)
    return _after(bench, scenario, "the project is taken away and brought back", ended)


def _deleted(bench: Bench, scenario: Scenario) -> Trial:
    """The project is deleted while a stage runs: nothing can be kept, but it is said."""
    bench.restore(scenario.start)
    ended = _during(bench, scenario, lambda: shutil.rmtree(bench.project, ignore_errors=True))
    bench.restore(scenario.start)
    return _after(bench, scenario, "the project is deleted while a stage runs", ended)


def _unwritable(bench: Bench, scenario: Scenario) -> Trial:
    bench.restore(scenario.start)
    bench.project.mkdir(exist_ok=True)
    paths = [bench.project, *bench.project.rglob("*")]
    for path in paths:
        path.chmod(0o555 if path.is_dir() else 0o444)
    before = (lambda: os.setuid(NOBODY)) if os.getuid() == 0 else None
    _open_to_all(bench.folder)
    ended = run(scenario.command, before)
    for path in paths:
        path.chmod(0o755 if path.is_dir() else 0o644)
    return _after(bench, scenario, "the project cannot be written", ended)


def _open_to_all(folder: Path) -> None:
    """Let everybody read the workspace and write its logs."""
    for path in (folder, *folder.parents[:-1]):
        if path.owner() == folder.owner() and not path.stat().st_mode & 0o005:
            path.chmod(0o755)


def _without_photos(bench: Bench, scenario: Scenario) -> Trial:
    bench.restore(scenario.start)
    photos, away = bench.capture / "train", bench.capture / "away"
    photos.rename(away)
    try:
        ended = run(scenario.command)
    finally:
        away.rename(photos)
    return _after(bench, scenario, "the photos are gone", ended)


def _after(bench: Bench, scenario: Scenario, fault: str, ended: Run) -> Trial:
    lost = bench.lost()
    seen = ended.sentence if ended.code else ""
    return trial(fault, scenario.title, lost, ended.flaw, bench.rerun(scenario), seen=seen)


def _impossible(bench: Bench) -> list[tuple[str, Path]]:
    file = bench.capture / "transforms_test.json"
    return [
        ("the folder is a file", file),
        ("the folder lies in a file", file / "project"),
        ("a name of 300 letters", bench.folder / ("x" * 300)),
    ]
