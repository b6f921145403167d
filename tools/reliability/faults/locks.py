"""Two engines at one project, and locks that others have left behind."""

from __future__ import annotations

import json
import os
import random
import time
from collections.abc import Iterator
from pathlib import Path

from .bench import Bench, Scenario
from .engine import Child, run
from .trial import Trial, trial

TOMORROW = 86_400


def locks(bench: Bench, few: bool, seed: int) -> Iterator[Trial]:
    """All of them, few: each once with one stage."""
    chance = random.Random(seed)
    for scenario in bench.some(few):
        if not scenario.title.endswith("anew"):
            continue
        for _ in range(1 if few else 5):
            yield _two_at_once(bench, scenario, chance.uniform(0, 0.9))
            yield _render_meanwhile(bench, scenario, chance.uniform(0, 1.0))
    for case, plant in PLANTED.items():
        yield _planted(bench, case, plant)


def _two_at_once(bench: Bench, scenario: Scenario, delay: float) -> Trial:
    """The same stage twice: one does the work, the other is refused or finds it done."""
    bench.restore(scenario.start)
    first = Child(scenario.command)
    time.sleep(delay * scenario.seconds)
    second = Child(scenario.command)
    ends = [first.wait(), second.wait()]
    done = sum(end.code == 0 for end in ends)
    flaws = [end.flaw for end in ends] + ["neither completes" if not done else None]
    seen = next((end.sentence for end in ends if end.code), "")
    return trial("two engines at one project", scenario.title, bench.lost(), *flaws, bench.rerun(scenario), seen=seen)


def _render_meanwhile(bench: Bench, scenario: Scenario, delay: float) -> Trial:
    """A render while a stage is learned anew shows the old scene or the new one, or is refused."""
    bench.restore(scenario.start)
    child = Child(scenario.command)
    time.sleep(delay * scenario.seconds)
    pictures, shown = bench.pictures(planes=False)
    ended = child.wait()
    plain = [{n: d for n, d in state.pictures.items() if n[:7] != "planes/"} for state in bench.states.values()]
    lost = "a mixture of two scenes is rendered" if shown.code == 0 and pictures not in plain else None
    seen = shown.sentence if shown.code else ""
    after = bench.lost()
    return trial("a render while a stage runs", scenario.title, lost or after, shown.flaw, ended.flaw,
                 bench.rerun(scenario), seen=seen)  # fmt: skip


def _empty(path: Path) -> None:
    path.touch()
    os.utime(path, (time.time() + TOMORROW,) * 2)


PLANTED = {
    "empty, dated tomorrow": _empty,
    "of a process that has ended": lambda path: path.write_text(json.dumps({"pid": 4_190_000, "start": "1"})),
    "of another computer, with our number": lambda path: path.write_text(json.dumps({"pid": os.getpid(), "start": ""})),
    "of the system's first process": lambda path: path.write_text(json.dumps({"pid": 1, "start": "0"})),
    "cut off": lambda path: path.write_text('{"pid": 12'),
    "absurd": lambda path: path.write_text('{"pid": 1e999, "start": []}'),
}


def _planted(bench: Bench, case: str, plant) -> Trial:
    """A lock that no living job holds keeps nobody out."""
    scenario = bench.anew("palette")
    bench.restore(scenario.start)
    plant(bench.project / "lock")
    ended = run(scenario.command)
    blocked = f"is kept out: {ended.sentence}" if ended.code else None
    lost = bench.lost()
    return trial("a lock left behind", case, lost, ended.flaw or blocked, bench.rerun(scenario), seen=ended.sentence)
