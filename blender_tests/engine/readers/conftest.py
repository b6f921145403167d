"""How many files are changed, and the project whose files are."""

import os

import pytest

collect_ignore_glob = ["*"] if os.name == "nt" else []  # readers are interrupted by a timer, which Windows has not


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--mutants", type=int, help="changed files for each reader; a tenth for those that render")


@pytest.fixture(scope="session")
def project(tmp_path_factory):
    """A project with every stage done, planes and an edit."""
    torch = pytest.importorskip("torch")
    from blender_tests.engine.readers import samples

    threads = torch.get_num_threads()
    learned = samples.learned_project(tmp_path_factory.mktemp("learned"))
    torch.set_num_threads(threads)
    return learned
