"""A copied project, recorded events and command lines for the tests of commands."""

import shutil

import pytest

import karf_engine as karf
from blender_tests.engine.reference.still_life import camera_at
from karf_engine.capture import write_cameras
from karf_engine.capture.capture import View
from karf_engine.cli import main
from karf_engine.io.images import read_mask, read_photo
from karf_engine.metrics.images import psnr
from karf_engine.metrics.masks import iou
from karf_engine.project import STAGE_ORDER, Project


@pytest.fixture
def copy(learned, tmp_path):
    """The learned still life, copied."""
    return Project(shutil.copytree(learned.project, tmp_path / "project"))


@pytest.fixture(scope="module")
def model(learned):
    """The learned still life, loaded; not to be changed."""
    return karf.load(learned.project, "cpu")


def run(*words):
    """Run the command line; returns its exit code."""
    return main([*map(str, words)])


def assert_renders_well(frames, still_life, lowest_psnr, lowest_iou):
    """Assert that renders and masks of both held-out views agree with the truth."""
    for stem in ("r_0", "r_1"):
        truth = still_life.photos[f"test/{stem}"]
        assert psnr(read_photo(frames / "render" / f"test_{stem}.png")[..., :3], truth.color) > lowest_psnr
        for label, name in ((1, "ball"), (2, "block")):
            assert iou(read_mask(frames / "masks" / name / f"test_{stem}.png"), truth.labels == label) > lowest_iou


def stages_run(printed):
    """The stages that ran, by what `all` printed."""
    return [stage for stage in STAGE_ORDER if f"{stage}: already done" not in printed]


class Events:
    """A job's `emit` that records its events as (kind, values)."""

    def __init__(self):
        self.recorded = []

    def __call__(self, kind, /, **values):
        self.recorded.append((kind, values))

    def values(self, kind, name):
        """Return the value of this name in each event of a kind."""
        return [values.get(name) for own, values in self.recorded if own == kind]

    def is_done_already(self, stage):
        return ("stage", {"name": stage, "text": "already done"}) in self.recorded


@pytest.fixture
def events():
    return Events()


def cameras_file(path, count=1, size=16, angle=1.0):
    """Write new cameras, named frame_0, frame_1 .., to a file."""
    camera = camera_at(angle, 0.5, size=size)
    write_cameras(path, [View(f"frame_{n}", f"frame_{n}", camera, None, "train") for n in range(count)])
    return path


def geometry_command(still_life, project, *settings):
    """Arguments that learn only the geometry."""
    command = still_life.command(project, *settings)
    masks = command.index("--masks")
    return ["geometry", *command[1:masks], *command[masks + 2 :]]
