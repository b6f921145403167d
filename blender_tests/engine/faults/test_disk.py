"""No room on the disk: simulated at every change of a file, by a limit of the system, and truly where we may mount."""

import os
import shutil
import subprocess
from functools import partial

import pytest

pytest.importorskip("torch")

import resource

from blender_tests.engine.faults.engine import run
from blender_tests.engine.faults.traps import no_room_from_change

FEW_STEP = 16  # of the changes of files, where only a few are tried
FILE_SIZES = (0, 3_000, 12_000)  # bytes that a file may have
FREE_KILOBYTES = (0, 16, 80)


def test_no_room_from_one_change_of_a_file_on(bench, few, subtests):
    for scenario in bench.repeated(few):
        count = len(bench.changes(scenario, flushes=True))
        for number in range(1, count + 1, FEW_STEP if few else 1):
            with subtests.test(stage=scenario.title, number=number):
                bench.restore(scenario.start)
                bench.survives(scenario, run(scenario.command, partial(no_room_from_change, bench.project, number)))


def test_files_are_cut_off_while_they_are_written(bench, few, subtests):
    """Files cannot grow beyond some bytes: RLIMIT_FSIZE, which stops every library's writing, half-way."""
    for scenario in bench.some(few):
        for size in FILE_SIZES[-1:] if few else FILE_SIZES:
            with subtests.test(stage=scenario.title, bytes=size):
                bench.restore(scenario.start)
                limit = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
                bench.survives(scenario, run(scenario.command, limit))


@pytest.fixture
def small_disk(bench):
    """A disk of 4 MB on which the project lies; only where this user may mount one."""
    disk = bench.folder / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=4m", "tmpfs", str(disk)]
    if shutil.which("mount") is None or subprocess.run(mount, capture_output=True).returncode:
        disk.rmdir()
        pytest.skip("this user may not mount a disk")
    shutil.rmtree(bench.project, ignore_errors=True)
    bench.project.symlink_to(disk / "project")
    yield disk
    bench.project.unlink()
    subprocess.run(["umount", str(disk)], check=True)


def test_the_disk_is_full(bench, few, small_disk, subtests):
    project, ballast = small_disk / "project", small_disk / "ballast"
    for scenario in bench.some(few):
        for free in FREE_KILOBYTES[1:2] if few else FREE_KILOBYTES:
            with subtests.test(stage=scenario.title, free=f"{free} kB"):
                shutil.rmtree(project, ignore_errors=True)
                if scenario.start is None:
                    project.mkdir()
                else:
                    shutil.copytree(scenario.start, project)
                state = os.statvfs(small_disk)
                ballast.write_bytes(b"x" * max(0, state.f_bavail * state.f_bsize - free * 1024))
                ended = run(scenario.command)
                ballast.unlink()
                bench.survives(scenario, ended)
