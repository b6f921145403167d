"""Whatever befalls a stage at work, nothing is lost and the same command completes it: see the fixture `throw`."""

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
# a library below Python gave up: nothing above can prevent it, and nothing must be lost by it
DEATHS = (-signal.SIGABRT, -signal.SIGSEGV, -signal.SIGBUS)
NOBODY = 65534  # root may write everywhere, so it becomes somebody who may not


def interrupted(scenario, share, number):
    """How a command ends that is sent a signal after a share of its time."""
    child = Child(scenario.command)
    time.sleep(share * scenario.seconds)
    child.stop(number)
    return child.wait()


def in_turn(bench, tries):
    """All scenarios equally often; those in which old and new can mix come first."""
    ordered = sorted(bench.scenarios, key=lambda scenario: scenario.title.endswith("first"))
    return itertools.islice(itertools.cycle(ordered), tries)


def test_kills_at_random_moments(bench, throw, kills, chance):
    for scenario in in_turn(bench, kills):
        throw(scenario, partial(interrupted, scenario, chance.uniform(0, 1.05), signal.SIGKILL))


def test_cancelling_at_random_moments(bench, throw, kills, chance):
    """Ctrl-C: the last state is kept, with its settings."""
    for scenario in in_turn(bench, max(1, kills // 5)):
        throw(scenario, partial(interrupted, scenario, chance.uniform(0, 1.0), signal.SIGINT))


def killed_at_change(bench, scenario, number):
    ended = run(scenario.command, partial(die_at_change, bench.project, number))
    assert ended.code in (0, -signal.SIGKILL)  # a change may not come again


def test_kills_before_each_change_of_a_file(bench, throw, few):
    for scenario in bench.repeated(few):
        changes = bench.changes(scenario, flushes=False)  # a flush leaves what a kill finds as it was
        for number in range(1, len(changes) + 1, 12 if few else 1):
            killed = partial(killed_at_change, bench, scenario, number)
            throw(scenario, killed, before=changes[number - 1], number=number)


def test_no_room_from_one_change_of_a_file_on(bench, throw, few):
    for scenario in bench.repeated(few):
        count = len(bench.changes(scenario, flushes=True))
        for number in range(1, count + 1, 16 if few else 1):
            full = partial(refuse_changes, bench.project, errno.ENOSPC, number, names=False)
            throw(scenario, partial(run, scenario.command, full), number=number)


def limit_memory(megabytes):
    """Let this process get only so much more memory than it has."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + (megabytes << 20)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def test_every_stage_does_its_work_in_little_memory_or_says_that_it_cannot(bench, throw, few):
    def in_little_memory(scenario, megabytes):
        ended = run(scenario.command, partial(limit_memory, megabytes))
        assert ended.code in (0, OUT_OF_MEMORY, *DEATHS), ended.text
        return None if ended.code in DEATHS else ended

    def is_exact(ended):  # what was finished all the same may have taken smaller batches
        return ended is None or ended.code != 0

    for scenario, megabytes in itertools.product(bench.some(few), MEGABYTES[1:2] if few else MEGABYTES):
        throw(scenario, partial(in_little_memory, scenario, megabytes), is_exact, megabytes=megabytes)


def half_way(scenario, act):
    """How a command ends, half-way through which something happens."""
    child = Child(scenario.command)
    time.sleep(0.5 * scenario.seconds)
    act()
    return child.wait()


def project_taken_away_and_brought_back(bench, scenario):
    away = bench.folder / "away"
    ended = half_way(scenario, partial(bench.project.rename, away))
    bench.restore(None)
    away.rename(bench.project)
    return ended


def project_deleted(bench, scenario):
    """Nothing can be kept, but it is said."""
    ended = half_way(scenario, partial(bench.restore, None))
    bench.restore(scenario.start)
    return ended


def project_not_to_be_written(bench, scenario):
    become_nobody = partial(os.setuid, NOBODY) if os.getuid() == 0 else None
    for path in (bench.folder, *bench.folder.parents[:-1]):  # nobody reads the workspace and writes its logs
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


def photos_gone(bench, scenario):
    photos, away = bench.capture / "train", bench.capture / "away"
    photos.rename(away)
    try:
        return run(scenario.command)
    finally:
        away.rename(photos)


@pytest.mark.parametrize(
    "fault",
    [project_taken_away_and_brought_back, project_deleted, project_not_to_be_written, photos_gone],
    ids=lambda fault: fault.__name__,
)
def test_folders_vanish_or_cannot_be_written(bench, throw, few, fault):
    for scenario in bench.some(few):
        if scenario.start is not None or fault in (project_not_to_be_written, photos_gone):
            throw(scenario, partial(fault, bench, scenario))


@pytest.mark.parametrize("name", ["capture/transforms_test.json", "capture/transforms_test.json/project", "x" * 300])
def test_a_project_where_none_can_be_is_refused(bench, name):
    """A file, in a file, and a name of 300 letters."""
    command = bench.command("geometry")
    command[command.index("--project") + 1] = str(bench.folder / name)
    ended = run(command)
    assert ended.code and ended.flaw is None


def several(bench, few):
    return [scenario for scenario in bench.some(few) if scenario.title.endswith("anew") for _ in range(1 if few else 5)]


def test_of_two_engines_one_does_the_work_and_the_other_is_refused_or_finds_it_done(bench, throw, few, chance):
    def at_once(scenario):
        first = Child(scenario.command)
        time.sleep(chance.uniform(0, 0.9) * scenario.seconds)
        second = Child(scenario.command)
        ends = [first.wait(), second.wait()]
        assert [end.flaw for end in ends] == [None, None]
        assert any(end.code == 0 for end in ends)

    for scenario in several(bench, few):
        throw(scenario, partial(at_once, scenario))


def test_a_render_while_a_stage_runs_shows_the_old_scene_or_the_new_or_is_refused(bench, throw, few, chance):
    plain = [{n: d for n, d in state.pictures.items() if n[:7] != "planes/"} for state in bench.states.values()]

    def rendered(scenario):
        child = Child(scenario.command)
        time.sleep(chance.uniform(0, 1.0) * scenario.seconds)
        pictures, shown = bench.pictures(planes=False)
        ended = child.wait()
        assert shown.flaw is None
        assert shown.code or pictures in plain, "a mixture of two scenes"
        return ended

    for scenario in several(bench, few):
        throw(scenario, partial(rendered, scenario))
