"""A new project."""

import pytest

from karf_engine.project import Project


@pytest.fixture
def project(tmp_path):
    project = Project(tmp_path / "project")
    project.create("/captures/pots")
    return project
