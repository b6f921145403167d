"""The engine is killed: at random moments, before each change of a file, and asked to stop by the user."""

from __future__ import annotations

import itertools
import os
import random
import signal
import time
from collections.abc import Iterator
from dataclasses import replace

from .bench import Bench, Scenario
from .engine import Child, Run, run
from .traps import at, die, file_events, recorder
from .trial import Trial, trial

FEW_STEP = 8  # of the changes of files, where only a few are tried


def random_kills(bench: Bench, tries: int, seed: int) -> Iterator[Trial]:
    """SIGKILL after a random time, in a random stage, learned for the first time or anew."""
    chance = random.Random(seed)
    for scenario in _in_turn(bench, tries):
        yield _interrupted(bench, scenario, "killed at a random moment", chance.uniform(0, 1.05), signal.SIGKILL)


def cancels(bench: Bench, tries: int, seed: int) -> Iterator[Trial]:
    """Ctrl-C after a random time: the last state is kept, with its settings."""
    chance = random.Random(seed)
    for scenario in _in_turn(bench, tries):
        yield _interrupted(bench, scenario, "cancelled at a random moment", chance.uniform(0, 1.0), signal.SIGINT)


def _in_turn(bench: Bench, tries: int) -> Iterator[Scenario]:
    """All scenarios equally often; those in which old and new can mix come first."""
    ordered = sorted(bench.scenarios, key=lambda scenario: scenario.title.endswith("first"))
    return itertools.islice(itertools.cycle(ordered), tries)


def _interrupted(bench: Bench, scenario: Scenario, fault: str, share: float, number: int) -> Trial:
    bench.restore(scenario.start)
    child = Child(scenario.command)
    time.sleep(share * scenario.seconds)
    child.stop(number)
    return _judge(bench, scenario, fault, child.wait())


def _judge(bench: Bench, scenario: Scenario, fault: str, ended: Run, case: str = "") -> Trial:
    lost, rerun = bench.lost(), bench.rerun(scenario)
    seen = ended.sentence if ended.code else ""
    if ended.killed and rerun is None:
        seen = "the project as it was; the same command completes it"
    return trial(fault, case or scenario.title, lost, ended.flaw, rerun, seen=seen)


def kills_at_events(bench: Bench, few: bool) -> Iterator[Trial]:
    """SIGKILL before each single change of a file (few: of some of one stage), while a stage is learned anew."""
    for scenario in bench.repeated(few):
        events = file_changes(bench, scenario, flushes=False)  # a flush leaves what a kill finds as it was
        for number in range(1, len(events) + 1, FEW_STEP if few else 1):
            bench.restore(scenario.start)
            trap = file_events(bench.project, at(number, die), flushes=False)
            ended = run(scenario.command, trap)
            ended = replace(ended, killed=ended.code == -signal.SIGKILL)
            case = f"{scenario.title}, before {events[number - 1]}"
            yield _judge(bench, scenario, "killed before each change of a file", ended, case)


def file_changes(bench: Bench, scenario: Scenario, flushes: bool) -> list[str]:
    """The changes of files that the scenario makes, in order."""
    bench.restore(scenario.start)
    record = bench.folder / "events.txt"
    handle = os.open(record, os.O_CREAT | os.O_WRONLY | os.O_TRUNC)
    try:
        run(scenario.command, file_events(bench.project, recorder(handle), flushes))
    finally:
        os.close(handle)
    return record.read_text().splitlines()
