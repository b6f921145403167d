"""A stroke corrects the masks of all views at once, and the stage afterwards obeys it too."""

import shutil
from dataclasses import replace

import imageio.v3 as iio
import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("scipy")

import karf_engine as karf
from karf_engine.capture.camera import Camera
from karf_engine.errors import BadRequest
from karf_engine.project import Project
from karf_engine.project.volumes import Volume, write_volumes
from karf_engine.segmentation.labels import CorrectionSession
from karf_engine.worker.queries import QUERIES
from karf_engine.worker.queries.photos import _distorted
from karf_engine.worker.queries.session import Session


@pytest.fixture
def project(learned, tmp_path):
    return Project(shutil.copytree(learned.project, tmp_path / "project"))


@pytest.fixture
def session(tmp_path):
    return Session(tmp_path, threads=1, device="cpu")


def query(session, project, view):
    return QUERIES["correct"](session, {"project": str(project.folder), "view": view})


def masks_of(answer):
    return {name: iio.imread(path) > 127 for name, path in answer["masks"].items()}


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
    found = masks_of(query(session, project, view.name))
    learned = dict(zip(model.objects, model.render_view(view).masks, strict=True))
    for name, mask in found.items():
        assert (mask & learned[name]).sum() / (mask | learned[name]).sum() > 0.8


def test_a_stroke_in_any_view_is_obeyed_at_once_and_by_the_stage(session, project):
    view = karf.load(project.folder).capture.split("test")[0]
    before = masks_of(query(session, project, view.name))["block"]
    disk = stroke_on(project, "block", view.name, before, 0)
    after = masks_of(query(session, project, view.name))["block"]
    assert before[disk].all() and not after[disk].any()
    karf.segment(project.folder, threads=1)
    model = karf.load(project.folder)
    assert model.render_view(view).masks[model.objects.index("block")][disk].mean() < 0.2
    assert (project.corrections_folder / "block" / f"{view.name}.png").is_file()


def test_masks_are_as_large_as_the_photo_and_bent_by_its_lens():
    plain = Camera(40, 20, 30.0, 30.0, 20.0, 10.0, np.eye(4))
    mask = np.zeros((10, 20), bool)
    mask[2:8, 2:6] = True
    large = _distorted(mask, plain)
    assert large.shape == (20, 40) and large.sum() == 4 * mask.sum()
    barrel = _distorted(mask, replace(plain, distortion=(-0.3, 0.0, 0.0, 0.0)))
    assert np.argwhere(barrel).mean(0)[1] > np.argwhere(large).mean(0)[1]  # nearer to the middle


def test_the_scene_is_looked_at_once(session, project, monkeypatch):
    views = [view.name for view in karf.load(project.folder).capture.split("test")[:2]]
    query(session, project, views[0])
    monkeypatch.setattr(CorrectionSession, "__init__", None)
    assert set(query(session, project, views[1])["masks"]) == {"ball", "block"}


def test_an_object_ends_where_its_volume_does(session, project):
    model = karf.load(project.folder)
    view = model.capture.split("test")[0]
    camera = model.working_camera(view)
    origins, directions = camera.rays(camera.pixel_centers())
    depth = model.render_field(camera).depth
    x = (origins + depth.reshape(-1, 1) * directions)[:, 0].reshape(depth.shape)
    before = masks_of(query(session, project, view.name))
    half = np.diag([0.2, 2.0, 2.0, 1.0])
    half[0, 3] = 0.25  # x from 0.05 to 0.45; the block's is from 0.15 to 0.75
    write_volumes(project.volumes_file, {"block": [Volume("inside", half)]})
    after = masks_of(query(session, project, view.name))
    inside, outside = before["block"] & (x < 0.4), before["block"] & (x > 0.5)
    # pixels at its silhouette hit what lies behind, too
    assert after["block"][inside].mean() > 0.6 and after["block"][outside].mean() < 0.1
    assert (after["ball"] != before["ball"]).sum() <= 5


def test_a_project_without_geometry_is_refused(session, tmp_path):
    project = Project(tmp_path / "empty")
    project.create("capture")
    with pytest.raises(BadRequest, match="no finished geometry"):
        query(session, project, "a")
