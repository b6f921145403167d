"""A learned project with splats, for the tests of steps."""

import pytest


@pytest.fixture
def with_splats(addon, learned):
    project = addon.folders.project_of(learned)
    project.splats_file.touch()
    project.finish("splats", "fake", gaussians=3)
    return learned
