"""Queries for masks of captured views, and for strokes that correct them in all views."""

import shutil
from dataclasses import replace
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest

import karf_engine as karf
from karf_engine.capture.camera import Camera
from karf_engine.errors import BadRequest, KarfError
from karf_engine.io.images import read_pixels
from karf_engine.project import Project
from karf_engine.project.volumes import Volume, write_volumes
from karf_engine.segmentation.labels import CorrectionSession
from karf_engine.worker.queries.photos import _distorted


def test_masks_are_the_objects_probabilities(ask, model):
    view = model.capture.views[-1]
    answer = ask("masks", view=view.name)
    expected = dict(zip(model.objects, model.render_field(model.working_camera(view)).probabilities, strict=True))
    assert answer["masks"].keys() == expected.keys()
    for name, file in answer["masks"].items():
        pixels, _ = read_pixels(Path(file), False)
        assert np.abs(pixels.reshape(*pixels.shape[:2], -1)[..., 0] / 255 - expected[name]).max() < 1 / 255


@pytest.mark.parametrize("view", ["nowhere", 3])
def test_unknown_view_is_rejected(ask, view):
    with pytest.raises(KarfError, match="view"):
        ask("masks", view=view)


@pytest.fixture
def project(learned, tmp_path):
    return Project(shutil.copytree(learned.project, tmp_path / "project"))


@pytest.fixture
def corrected(ask, project):
    """Ask for the corrected masks of a view of the project's copy."""

    def corrected(view):
        answer = ask("correct", project=str(project.folder), view=view.name)
        return {name: iio.imread(path) > 127 for name, path in answer["masks"].items()}

    return corrected


def test_stroke_corrects_the_mask_at_once_and_when_segmented(corrected, project, model):
    view = model.capture.split("test")[0]
    before, learned = corrected(view), dict(zip(model.objects, model.render_view(view).masks, strict=True))
    for name, mask in before.items():
        assert (mask & learned[name]).sum() / (mask | learned[name]).sum() > 0.8
    pixels = np.moveaxis(np.indices(before["block"].shape), 0, -1)
    disk = np.linalg.norm(pixels - np.argwhere(before["block"]).mean(0), axis=-1) <= 2.5
    picture = np.zeros((*disk.shape, 2), np.uint8)
    picture[disk] = 0, 255
    path = project.corrections_folder / "block" / f"{view.name}.png"
    path.parent.mkdir(parents=True)
    iio.imwrite(path, picture)
    assert before["block"][disk].all() and not corrected(view)["block"][disk].any()
    karf.segment(project.folder, threads=1)
    again = karf.load(project.folder)
    assert again.render_view(view).masks[again.objects.index("block")][disk].mean() < 0.2
    assert path.is_file()


def test_correction_session_is_reused_between_views(corrected, model, monkeypatch):
    first, second = model.capture.split("test")[:2]
    corrected(first)
    monkeypatch.setattr(CorrectionSession, "__init__", None)
    assert set(corrected(second)) == {"ball", "block"}


def test_inside_volume_limits_its_object(corrected, project, model):
    view = model.capture.split("test")[0]
    camera = model.working_camera(view)
    origins, directions = camera.rays(camera.pixel_centers())
    depth = model.render_field(camera).depth
    x = (origins + depth.reshape(-1, 1) * directions)[:, 0].reshape(depth.shape)
    before = corrected(view)
    half = np.diag([0.2, 2.0, 2.0, 1.0])
    half[0, 3] = 0.25  # x from 0.05 to 0.45; the block's is from 0.15 to 0.75
    write_volumes(project.volumes_file, {"block": [Volume("inside", half)]})
    after = corrected(view)
    inside, outside = before["block"] & (x < 0.4), before["block"] & (x > 0.5)
    # some pixels at the silhouette see the background
    assert after["block"][inside].mean() > 0.6 and after["block"][outside].mean() < 0.1
    assert (after["ball"] != before["ball"]).sum() <= 5


def test_masks_have_the_size_and_distortion_of_the_photo():
    plain = Camera(40, 20, 30.0, 30.0, 20.0, 10.0, np.eye(4))
    mask = np.zeros((10, 20), bool)
    mask[2:8, 2:6] = True
    large = _distorted(mask, plain)
    assert large.shape == (20, 40) and large.sum() == 4 * mask.sum()
    barrel = _distorted(mask, replace(plain, distortion=(-0.3, 0.0, 0.0, 0.0)))
    assert np.argwhere(barrel).mean(0)[1] > np.argwhere(large).mean(0)[1]  # nearer to the middle


def test_correction_without_geometry_is_rejected(ask, tmp_path):
    Project(tmp_path / "empty").create("capture")
    with pytest.raises(BadRequest, match="no finished geometry"):
        ask("correct", project=str(tmp_path / "empty"), view="a")
