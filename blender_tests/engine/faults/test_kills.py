"""The engine is killed: at random moments, before each change of a file, and asked to stop by the user."""

import itertools
import signal
import time
from functools import partial

import pytest

pytest.importorskip("torch")

from blender_tests.engine.faults.engine import Child, run
from blender_tests.engine.faults.traps import die_at_change

FEW_STEP = 8  # of the changes of files, where only a few are tried


def test_killed_at_a_random_moment(bench, kills, chance, subtests):
    for scenario in in_turn(bench, kills):
        with subtests.test(stage=scenario.title):
            interrupt(bench, scenario, chance.uniform(0, 1.05), signal.SIGKILL)


def test_cancelled_at_a_random_moment(bench, kills, chance, subtests):
    """Ctrl-C: the last state is kept, with its settings."""
    for scenario in in_turn(bench, max(1, kills // 5)):
        with subtests.test(stage=scenario.title):
            interrupt(bench, scenario, chance.uniform(0, 1.0), signal.SIGINT)


def in_turn(bench, tries):
    """All scenarios equally often; those in which old and new can mix come first."""
    ordered = sorted(bench.scenarios, key=lambda scenario: scenario.title.endswith("first"))
    return itertools.islice(itertools.cycle(ordered), tries)


def interrupt(bench, scenario, share, number):
    bench.restore(scenario.start)
    child = Child(scenario.command)
    time.sleep(share * scenario.seconds)
    child.stop(number)
    bench.survives(scenario, child.wait())


def test_killed_before_each_change_of_a_file(bench, few, subtests):
    for scenario in bench.repeated(few):
        changes = bench.changes(scenario, flushes=False)  # a flush leaves what a kill finds as it was
        for number in range(1, len(changes) + 1, FEW_STEP if few else 1):
            with subtests.test(stage=scenario.title, before=changes[number - 1], number=number):
                bench.restore(scenario.start)
                ended = run(scenario.command, partial(die_at_change, bench.project, number))
                assert ended.code in (0, -signal.SIGKILL)  # a change may not come again
                bench.survives(scenario)
