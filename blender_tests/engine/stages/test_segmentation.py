"""What the label solve is given of a learned scene."""

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("scipy")

from karf_engine.fields.files import load_scene
from karf_engine.segmentation.coarse_masks import find_masks
from karf_engine.stages import segmentation
from karf_engine.stages.job import open_job
from karf_engine.wire import Request


def test_the_surface_has_no_more_points_than_rays_can_fill(learned, monkeypatch):
    request = Request("segmentation", learned.project, {"threads": 1, "device": "cpu"})
    job = open_job(request, lambda *_, **__: None, lambda: False)
    scene, capture = load_scene(job.project.geometry_file), job.capture()
    masks = find_masks(job.project.masks_folder, capture)
    cached = segmentation.cache_views(job, scene, masks, list(capture.split("train")))
    fine = segmentation._surface_points(cached, scene.field.voxel)
    assert fine.grain == scene.field.voxel
    monkeypatch.setattr(segmentation, "MOST_POINTS", len(fine) // 4)
    coarse = segmentation._surface_points(cached, scene.field.voxel)
    assert coarse.grain == pytest.approx(2 * fine.grain, rel=0.01)
    assert len(fine) / 6 < len(coarse) < len(fine) / 2
