"""Memory runs out: a limit of address space, some megabytes above what the engine has when it starts."""

from __future__ import annotations

import resource
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

from .bench import Bench
from .engine import Run, run
from .trial import Trial, trial

MEGABYTES = (2, 6, 15, 40, 90)


def memory_limits(bench: Bench, few: bool) -> Iterator[Trial]:
    """Every stage with little memory: it does its work or says in a sentence that it cannot."""
    for scenario in bench.some(few):
        for megabytes in MEGABYTES[1:2] if few else MEGABYTES:
            bench.restore(scenario.start)
            ended = run(scenario.command, limit(megabytes))
            exact = ended.code != 0  # what was finished all the same may have taken smaller batches
            lost = bench.lost(exact)
            case = f"{scenario.title}, {megabytes} MB more"
            yield trial("memory runs out", case, lost, _flaw(ended), bench.rerun(scenario, exact), seen=_seen(ended))


def _flaw(ended: Run) -> str | None:
    if _died(ended) or ended.code in (0, 5) or ended.flaw:
        return None if _died(ended) else ended.flaw
    return f"ends with {ended.code} and not 5 (out of memory): {ended.sentence}"


def _seen(ended: Run) -> str:
    if _died(ended):
        return "the engine's process ends; the sidebar says so"
    return ended.sentence if ended.code else ""


def _died(ended: Run) -> bool:
    """Whether a library below Python gave up: nothing above can prevent it, and nothing must be lost by it."""
    return ended.code in (-signal.SIGABRT, -signal.SIGSEGV, -signal.SIGBUS)


def limit(megabytes: int) -> Callable[[], None]:
    """What to call in a process so that it gets only so much more memory than it has."""

    def set_limit() -> None:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + (megabytes << 20)
        resource.setrlimit(resource.RLIMIT_AS, (most, most))

    return set_limit
