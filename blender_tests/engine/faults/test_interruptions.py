"""An interrupted stage loses nothing, and the same command completes it: see the fixture `throw`."""

import errno
import itertools
import os
import resource
import signal
import time
from functools import partial
from pathlib import Path

import pytest

from blender_tests.engine.faults.engine import Child, run
from blender_tests.engine.faults.traps import die_at_change, refuse_changes

MEGABYTES = (2, 6, 15, 40, 90)  # of memory, more than the engine has when it starts
OUT_OF_MEMORY = 5
DEATHS = (-signal.SIGABRT, -signal.SIGSEGV, -signal.SIGBUS)  # of a native library, which the engine cannot prevent
NOBODY = 65534  # root can write everywhere, so it becomes a user who cannot


def run_and_act(scenario, share, act):
    """Run a command and act on its process after a share of its time."""
    child = Child(scenario.command)
    time.sleep(share * scenario.seconds)
    act(child)
    return child.wait()


def in_rotation(bench, tries):
    """All scenarios equally often, those in which old and new could mix first."""
    ordered = sorted(bench.scenarios, key=lambda scenario: scenario.title.endswith("first"))
    return itertools.islice(itertools.cycle(ordered), tries)


def test_kills_at_random_moments_lose_nothing(bench, throw, kills, chance):
    for scenario in in_rotation(bench, kills):
        throw(scenario, partial(run_and_act, scenario, chance.uniform(0, 1.05), Child.stop))


def test_cancelling_at_random_moments_loses_nothing(bench, throw, kills, chance):
    for scenario in in_rotation(bench, max(1, kills // 5)):
        throw(scenario, partial(run_and_act, scenario, chance.uniform(0, 1.0), lambda child: child.stop(signal.SIGINT)))


def run_killed_at_change(bench, scenario, number):
    ended = run(scenario.command, partial(die_at_change, bench.project, number))
    assert ended.code in (0, -signal.SIGKILL)  # 0: this run made fewer changes


def test_kills_before_each_file_change_lose_nothing(bench, throw, few):
    for scenario in bench.repeated(few):
        changes = bench.changes(scenario, flushes=False)  # a kill cannot tell whether a file was flushed
        for number in range(1, len(changes) + 1, 12 if few else 1):
            killed = partial(run_killed_at_change, bench, scenario, number)
            throw(scenario, killed, before=changes[number - 1], number=number)


def test_full_disk_at_each_file_change_loses_nothing(bench, throw, few):
    for scenario in bench.repeated(few):
        count = len(bench.changes(scenario, flushes=True))
        for number in range(1, count + 1, 16 if few else 1):
            full = partial(refuse_changes, bench.project, errno.ENOSPC, number, names=False)
            throw(scenario, partial(run, scenario.command, full), number=number)


def limit_memory(megabytes):
    """Limit the further memory of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + (megabytes << 20),) * 2)


def test_stage_in_little_memory_succeeds_or_exits_with_5(bench, throw, few):
    def in_little_memory(scenario, megabytes):
        ended = run(scenario.command, partial(limit_memory, megabytes))
        assert ended.code in (0, OUT_OF_MEMORY, *DEATHS), ended.text
        return None if ended.code in DEATHS else ended

    def is_exact(ended):  # a stage that finished may have used smaller batches
        return ended is None or ended.code != 0

    for scenario, megabytes in itertools.product(bench.some(few), MEGABYTES[1:2] if few else MEGABYTES):
        throw(scenario, partial(in_little_memory, scenario, megabytes), is_exact, megabytes=megabytes)


def project_moved_away_and_back(bench, scenario):
    away = bench.folder / "away"
    ended = run_and_act(scenario, 0.5, lambda _: bench.project.rename(away))
    bench.restore(None)
    away.rename(bench.project)
    return ended


def project_deleted(bench, scenario):
    ended = run_and_act(scenario, 0.5, lambda _: bench.restore(None))
    bench.restore(scenario.start)
    return ended


def project_read_only(bench, scenario):
    become_nobody = partial(os.setuid, NOBODY) if os.getuid() == 0 else None
    for path in (bench.folder, *bench.folder.parents[:-1]):  # NOBODY must be able to enter the workspace
        if path.owner() == bench.folder.owner() and not path.stat().st_mode & 0o005:
            path.chmod(0o755)
    bench.project.mkdir(exist_ok=True)
    paths = [bench.project, *bench.project.rglob("*")]
    for path in paths:
        path.chmod(0o555 if path.is_dir() else 0o444)
    ended = run(scenario.command, become_nobody)
    for path in paths:
        path.chmod(0o755 if path.is_dir() else 0o644)
    return ended


def photos_missing(bench, scenario):
    photos, away = bench.capture / "train", bench.capture / "away"
    photos.rename(away)
    try:
        return run(scenario.command)
    finally:
        away.rename(photos)


@pytest.mark.parametrize("fault", [project_moved_away_and_back, project_deleted, project_read_only, photos_missing])
def test_vanished_or_read_only_folders_lose_nothing(bench, throw, few, fault):
    for scenario in bench.some(few):
        if scenario.start is not None or fault in (project_read_only, photos_missing):
            throw(scenario, partial(fault, bench, scenario))


@pytest.mark.parametrize("name", ["capture/transforms_test.json", "capture/transforms_test.json/project", "x" * 300])
def test_impossible_project_path_is_rejected(bench, name):
    command = bench.command("geometry")
    command[command.index("--project") + 1] = str(bench.folder / name)
    ended = run(command)
    assert ended.code and ended.flaw is None


def repetitions(bench, few):
    """The scenarios in which a stage runs again, each once or five times."""
    return [scenario for scenario in bench.some(few) if scenario.title.endswith("again")] * (1 if few else 5)


def test_concurrent_engines_do_the_work_once(bench, throw, few, chance):
    def run_two(scenario):
        first = Child(scenario.command)
        time.sleep(chance.uniform(0, 0.9) * scenario.seconds)
        second = Child(scenario.command)
        ends = [first.wait(), second.wait()]
        assert [end.flaw for end in ends] == [None, None]
        assert any(end.code == 0 for end in ends)

    for scenario in repetitions(bench, few):
        throw(scenario, partial(run_two, scenario))


def test_render_during_a_stage_never_mixes_scenes(bench, throw, few, chance):
    valid = [{n: d for n, d in state.pictures.items() if n[:7] != "planes/"} for state in bench.states.values()]

    def render_meanwhile(scenario):
        found = []
        ended = run_and_act(scenario, chance.uniform(0, 1.0), lambda _: found.extend(bench.pictures(planes=False)))
        pictures, rendered = found
        assert rendered.flaw is None
        assert rendered.code or pictures in valid, "a mixture of two scenes"
        return ended

    for scenario in repetitions(bench, few):
        throw(scenario, partial(render_meanwhile, scenario))
