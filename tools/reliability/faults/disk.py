"""No room on the disk: simulated at every change of a file, by a limit of the system, and truly where we may mount."""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
from collections.abc import Callable, Iterator

from .bench import Bench, Scenario
from .engine import run
from .kills import FEW_STEP, file_changes
from .traps import file_events, from_then_on, no_room
from .trial import Trial, trial

FILE_SIZES = (0, 3_000, 12_000)  # bytes that a file may have
FREE_KILOBYTES = (0, 16, 80)


def full_at_events(bench: Bench, few: bool) -> Iterator[Trial]:
    """From each single change of a file on (few: from some of one stage) there is no room: ENOSPC."""
    for scenario in bench.repeated(few):
        count = len(file_changes(bench, scenario, flushes=True))
        for number in range(1, count + 1, 2 * FEW_STEP if few else 1):
            trap = file_events(bench.project, from_then_on(number, no_room), flushes=True)
            yield _full(bench, scenario, "no room from one change of a file on", trap)


def small_files(bench: Bench, few: bool) -> Iterator[Trial]:
    """Files cannot grow beyond some bytes: RLIMIT_FSIZE, which stops every library's writing, half-way."""
    for scenario in bench.some(few):
        for size in FILE_SIZES[-1:] if few else FILE_SIZES:
            yield _full(bench, scenario, "files are cut off while they are written", _limit(size))


def _limit(size: int) -> Callable[[], None]:
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))


def full_disk(bench: Bench, few: bool) -> Iterator[Trial]:
    """A small disk that is truly full; only where this user may mount one."""
    disk = bench.folder / "disk"
    disk.mkdir(exist_ok=True)
    mount = ["mount", "-t", "tmpfs", "-o", "size=4m", "tmpfs", str(disk)]
    if shutil.which("mount") is None or subprocess.run(mount, capture_output=True).returncode:
        return
    project = bench.project
    shutil.rmtree(project, ignore_errors=True)
    project.symlink_to(disk / "project")
    try:
        for scenario in bench.some(few):
            for free in FREE_KILOBYTES[1:2] if few else FREE_KILOBYTES:
                yield _on_disk(bench, scenario, disk, free)
    finally:
        project.unlink()
        subprocess.run(["umount", str(disk)], check=True)


def _on_disk(bench: Bench, scenario: Scenario, disk, free: int) -> Trial:
    shutil.rmtree(disk / "project", ignore_errors=True)
    if scenario.start is None:
        (disk / "project").mkdir()
    else:
        shutil.copytree(scenario.start, disk / "project")
    ballast = disk / "ballast"
    state = os.statvfs(disk)
    ballast.write_bytes(b"x" * max(0, state.f_bavail * state.f_bsize - free * 1024))
    ended = run(scenario.command)
    ballast.unlink()
    return _judged(bench, scenario, "the disk is full", ended)


def _full(bench: Bench, scenario: Scenario, fault: str, trap: Callable[[], None]) -> Trial:
    bench.restore(scenario.start)
    return _judged(bench, scenario, fault, run(scenario.command, trap))


def _judged(bench: Bench, scenario: Scenario, fault: str, ended) -> Trial:
    lost = bench.lost()
    rerun = bench.rerun(scenario)
    return trial(fault, scenario.title, lost, ended.flaw, rerun, seen=ended.sentence if ended.code else "")
