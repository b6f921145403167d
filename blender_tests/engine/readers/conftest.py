"""The option for the number of mutants, and the project whose files are mutated."""

import os
import shutil
from pathlib import Path

import pytest

collect_ignore_glob = ["test_readers.py"] if os.name == "nt" else []  # a timer interrupts readers; Windows has none


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--mutants", type=int, help="mutated files for each reader; slow readers get fewer")


@pytest.fixture(scope="session")
def project(learned, tmp_path_factory) -> Path:
    """The learned project with an edit and the planes of one view."""
    import karf_engine as karf
    from blender_tests.engine.readers.samples import RENDERED

    folder = shutil.copytree(learned.project, tmp_path_factory.mktemp("readers") / "project")
    karf.load(folder, "cpu").edit().becomes("ball", "#b5302c", "#3059b8").save(folder / "edit.json")
    karf.render(folder, folder.parent / "frames", views=RENDERED, planes=True, threads=1)
    return folder
