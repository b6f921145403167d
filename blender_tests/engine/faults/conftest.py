"""Options for the number of faults, the project that they strike, and the check after each."""

import os
import random

import pytest

collect_ignore_glob = ["*"] if os.name == "nt" else []  # Windows cannot fork and limit processes


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--all-faults", action="store_true", help="in every stage and at every change of a file")
    parser.addoption("--kills", type=int, help="kills at random moments (default: 200 with --all-faults, else 4)")
    parser.addoption("--seed", type=int, default=0, help="seed of all chance (default: 0)")


@pytest.fixture(scope="session")
def bench(tmp_path_factory):
    """The workspace with every valid state of a project."""
    from blender_tests.engine.faults import engine
    from blender_tests.engine.faults.bench import Bench

    with pytest.MonkeyPatch.context() as patch:
        engine.prepare(patch)
        yield Bench(tmp_path_factory.mktemp("faults"))


@pytest.fixture
def few(request) -> bool:
    """Tell whether a fault strikes only one stage, at some of its moments."""
    return not request.config.getoption("all_faults", False)


@pytest.fixture
def kills(request, few) -> int:
    return request.config.getoption("kills", None) or (4 if few else 200)


@pytest.fixture
def chance(request) -> random.Random:
    return random.Random(request.config.getoption("seed", 0))


@pytest.fixture
def throw(bench, subtests):
    """Throw a fault, which returns how the command ended, at a scenario; assert that it survives."""

    def throw_one(scenario, fault, exact=lambda ended: True, **named):
        with subtests.test(stage=scenario.title, **named):
            bench.restore(scenario.start)
            ended = fault()
            bench.assert_survives(scenario, ended, exact(ended))

    return throw_one
