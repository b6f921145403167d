"""Memory runs out: a limit of address space, some megabytes above what the engine has when it starts."""

import signal
from functools import partial
from pathlib import Path

import pytest

pytest.importorskip("torch")

import resource

from blender_tests.engine.faults.engine import run

MEGABYTES = (2, 6, 15, 40, 90)
OUT_OF_MEMORY = 5
# a library below Python gave up: nothing above can prevent it, and nothing must be lost by it
DEATHS = (-signal.SIGABRT, -signal.SIGSEGV, -signal.SIGBUS)


def test_every_stage_does_its_work_or_says_that_it_cannot(bench, few, subtests):
    for scenario in bench.some(few):
        for megabytes in MEGABYTES[1:2] if few else MEGABYTES:
            with subtests.test(stage=scenario.title, megabytes=megabytes):
                bench.restore(scenario.start)
                ended = run(scenario.command, partial(limit_memory, megabytes))
                assert ended.code in (0, OUT_OF_MEMORY, *DEATHS), ended.text
                exact = ended.code != 0  # what was finished all the same may have taken smaller batches
                bench.survives(scenario, None if ended.code in DEATHS else ended, exact)


def limit_memory(megabytes):
    """Let this process get only so much more memory than it has."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + (megabytes << 20)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
