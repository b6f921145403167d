"""Two engines at one project, and locks that others have left behind."""

import json
import os
import time

import pytest

pytest.importorskip("torch")

from blender_tests.engine.faults.engine import Child, run

TOMORROW = 86_400


def tries(bench, few):
    return [scenario for scenario in bench.some(few) if scenario.title.endswith("anew") for _ in range(1 if few else 5)]


def test_two_engines_at_one_project(bench, few, chance, subtests):
    """The same stage twice: one does the work, the other is refused or finds it done."""
    for scenario in tries(bench, few):
        with subtests.test(stage=scenario.title):
            bench.restore(scenario.start)
            first = Child(scenario.command)
            time.sleep(chance.uniform(0, 0.9) * scenario.seconds)
            second = Child(scenario.command)
            ends = [first.wait(), second.wait()]
            assert [end.flaw for end in ends] == [None, None]
            assert any(end.code == 0 for end in ends)
            bench.survives(scenario)


def test_a_render_while_a_stage_runs(bench, few, chance, subtests):
    """It shows the old scene or the new one, or is refused."""
    plain = [{n: d for n, d in state.pictures.items() if n[:7] != "planes/"} for state in bench.states.values()]
    for scenario in tries(bench, few):
        with subtests.test(stage=scenario.title):
            bench.restore(scenario.start)
            child = Child(scenario.command)
            time.sleep(chance.uniform(0, 1.0) * scenario.seconds)
            pictures, shown = bench.pictures(planes=False)
            ended = child.wait()
            assert shown.flaw is None
            assert shown.code or pictures in plain, "a mixture of two scenes"
            bench.survives(scenario, ended)


def empty_and_dated_tomorrow(path):
    path.touch()
    os.utime(path, (time.time() + TOMORROW,) * 2)


PLANTED = {
    "empty, dated tomorrow": empty_and_dated_tomorrow,
    "of a process that has ended": lambda path: path.write_text(json.dumps({"pid": 4_190_000, "start": "1"})),
    "of another computer, with our number": lambda path: path.write_text(json.dumps({"pid": os.getpid(), "start": ""})),
    "of the system's first process": lambda path: path.write_text(json.dumps({"pid": 1, "start": "0"})),
    "cut off": lambda path: path.write_text('{"pid": 12'),
    "absurd": lambda path: path.write_text('{"pid": 1e999, "start": []}'),
}


@pytest.mark.parametrize("case", PLANTED)
def test_a_lock_that_no_living_job_holds_keeps_nobody_out(bench, case):
    scenario = bench.anew("palette")
    bench.restore(scenario.start)
    PLANTED[case](bench.project / "lock")
    ended = run(scenario.command)
    assert ended.code == 0, ended.text
    bench.survives(scenario, ended)
