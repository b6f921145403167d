"""Inputs for fits: photos, views and sparse points of the still life, and small trainings of heads."""

import numpy as np
import torch

from blender_tests.engine.reference.still_life import BALL_CENTER, BALL_RADIUS
from karf_engine.capture.capture import SparsePoints, View
from karf_engine.capture.training_images import solid_pixels
from karf_engine.compute.progress import Progress
from karf_engine.fields.rendering.rays import PixelDataset
from karf_engine.fields.rendering.surface_cache import SurfaceCache
from karf_engine.heads.fields import RecoloringField, SegmentationField
from karf_engine.heads.fit import ObjectRays, fit_on_points, fit_on_rays, fit_recoloring


def silent(should_stop=lambda: False):
    return Progress(lambda *_, **__: None, should_stop, "geometry", 1)


def pixel_dataset(photos, kind, device="cpu"):
    alphas = [p.alpha for p in photos] if kind == "alpha" else None
    solids = [solid_pixels(p.color, "black") for p in photos] if kind == "black" else None
    colors = [p.color / p.alpha[..., None].clip(1e-6) if kind == "alpha" else p.color for p in photos]
    return PixelDataset([p.camera for p in photos], [c.clip(0, 1) for c in colors], alphas, solids, device=device)


def views_of(cameras):
    return [View(f"view{n}", f"view{n}", camera, None, "train") for n, camera in enumerate(cameras)]


def sparse_points(positions, view, point, pixels=None):
    """Points [n, 3], and the views and pixels that show them."""
    colors, errors = np.zeros((len(positions), 3), np.uint8), np.full(len(positions), 0.3, np.float32)
    pixels = np.zeros((len(point), 2), np.float32) if pixels is None else np.array(pixels, np.float32)
    return SparsePoints(positions, colors, errors, np.array(view, np.int32), np.array(point, np.int32), pixels)


def observed_by_all(positions, n_views):
    n = len(positions)
    return sparse_points(positions, np.repeat(np.arange(n_views), n), np.tile(np.arange(n), n_views))


def points_on_the_still_life(cameras, photos, spread=1.0):
    """Points on the ball and the block's top, observed wherever a photo shows them."""
    random = np.random.default_rng(0)
    directions = random.normal(size=(150, 3))
    ball = BALL_CENTER + BALL_RADIUS * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    top = np.stack([random.uniform(0.15, 0.75, 150), random.uniform(-0.35, 0.35, 150), np.full(150, 0.25)], 1)
    positions, labels = spread * np.concatenate([ball, top]), np.repeat([1, 2], 150)
    view, point, pixels = [], [], []
    for number, (camera, photo) in enumerate(zip(cameras, photos, strict=True)):
        projected, _ = camera.project(positions)
        u, v = np.floor(projected).astype(int).clip(0, camera.width - 1).T
        # the ball's far side projects onto the ball too
        faces_camera = ((positions - BALL_CENTER) * (camera.position - positions)).sum(1) > 0
        seen = np.flatnonzero((photo.labels[v, u] == labels) & (faces_camera | (labels == 2)))
        view += [number] * len(seen)
        point += seen.tolist()
        pixels += projected[seen].tolist()
    return sparse_points(positions, view, point, pixels)


def learn_head(kind, field, settings, runtime, progress, checkpoint=None):
    """Train a head (kind: points, rays or recoloring) on 200 random rays; return its tensors."""
    random = torch.Generator().manual_seed(1)
    positions = (torch.rand(200, 3, 3, generator=random) * 2 - 1).to(runtime.device)
    first, ones = positions[:, 0], torch.ones(200, device=runtime.device)
    classes, bounds = (first[:, 0] > 0).long(), torch.tensor([[-1.0] * 3, [1.0] * 3], device=runtime.device)
    common = (settings, runtime, progress, checkpoint)
    if kind == "recoloring":
        head = RecoloringField(bounds, field.n_features, [3, 3], settings).to(runtime.device)
        colors, weights = torch.rand(200, 3, generator=random).to(runtime.device), torch.full_like(first, 1 / 3)
        rays = ObjectRays(positions, first, colors, classes, classes, weights, first[:, 1] < 0.3, ones)
        palettes = torch.rand(2, 3, 3, generator=random).to(runtime.device)
        return [fit_recoloring(head, field, rays, palettes, *common), *head.state_dict().values()]
    head = SegmentationField(bounds[None], field.n_features, settings).to(runtime.device)
    if kind == "points":
        fit_on_points(head, field, first, classes, ones, first[:, 0].abs() < 0.2, first[:, 1] > 0.9, *common)
    else:
        number = torch.arange(200, device=runtime.device)
        cache = SurfaceCache(positions, positions[..., 0].sort(1).values, first, ones, number)
        fit_on_rays(head, field, cache, torch.eye(2, device=runtime.device)[classes], *common)
    return list(head.state_dict().values())
