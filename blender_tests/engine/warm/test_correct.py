"""A stroke corrects the masks of all views at once, and the stage afterwards obeys it too."""

import shutil

import imageio.v3 as iio
import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("scipy")

import karf_engine as karf
from karf_engine.errors import BadRequest
from karf_engine.project import Project
from karf_engine.segmentation.correcting import Correcting
from karf_engine.warm.answers import ANSWERS
from karf_engine.warm.session import Session


@pytest.fixture
def project(learned, tmp_path):
    return Project(shutil.copytree(learned.project, tmp_path / "project"))


@pytest.fixture
def session(tmp_path):
    return Session(tmp_path, threads=1, device="cpu")


def ask(session, project, view):
    return ANSWERS["correct"](session, {"project": str(project.folder), "view": view})


def masks_of(answer, view):
    return {name: iio.imread(path) > 127 for name, path in answer["masks"][view].items()}


def stroke_on(project, name, view, mask, value):
    """A disk in the middle of a mask; returns where it is."""
    rows, columns = np.indices(mask.shape)
    row, column = np.argwhere(mask).mean(0)
    disk = (rows - row) ** 2 + (columns - column) ** 2 <= 2.5**2
    picture = np.zeros((*mask.shape, 2), np.uint8)
    picture[disk] = value, 255
    path = project.corrections_folder / name / f"{view}.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    iio.imwrite(path, picture)
    return disk


def test_masks_are_those_of_the_stage_before_anything_is_corrected(session, project):
    model = karf.load(project.folder)
    view = model.capture.split("test")[0]
    found = masks_of(ask(session, project, view.name), view.name)
    learned = dict(zip(model.objects, model.render_view(view).masks, strict=True))
    for name, mask in found.items():
        assert (mask & learned[name]).sum() / (mask | learned[name]).sum() > 0.8


def test_a_stroke_in_any_view_is_obeyed_at_once_and_by_the_stage(session, project):
    view = karf.load(project.folder).capture.split("test")[0]
    before = masks_of(ask(session, project, view.name), view.name)["block"]
    disk = stroke_on(project, "block", view.name, before, 0)
    after = masks_of(ask(session, project, view.name), view.name)["block"]
    assert before[disk].all() and not after[disk].any()
    karf.segment(project.folder, threads=1)
    model = karf.load(project.folder)
    assert model.render_view(view).masks[model.objects.index("block")][disk].mean() < 0.2
    assert (project.corrections_folder / "block" / f"{view.name}.png").is_file()


def test_the_scene_is_looked_at_once(session, project, monkeypatch):
    views = [view.name for view in karf.load(project.folder).capture.split("test")[:2]]
    ask(session, project, views[0])
    monkeypatch.setattr(Correcting, "__init__", None)
    assert set(ask(session, project, ",".join(views))["masks"]) == set(views)


def test_a_project_without_geometry_is_refused(session, tmp_path):
    project = Project(tmp_path / "empty")
    project.create("capture")
    with pytest.raises(BadRequest, match="no finished geometry"):
        ask(session, project, "a")
