"""Table 3: how alike frames of a camera path show the edited objects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from karf_engine.capture.camera import Camera
from karf_engine.project import Project
from karf_engine.project.contents import settings_for
from karf_engine.recolor.frames import Frame
from karf_engine.recolor.model import Model

from ..metrics.consistency import Correspondence, DepthView, flicker, flow_rmse, match_by_depth, mean_of_pairs
from .demo import Demo
from .store import Store
from .table import Figures, Table
from .ways import composed, on_photo

PATH_VIEWS, PATH_STEP, PATH_CENTER = 24, np.radians(2.5), np.array([0.0, 0.02, 0.27])
SHORT, LONG = 1, 7  # frames apart
PUBLISHED = {"PaletteNeRF with LSeg": (0.136, 0.262), "LAENeRF": (0.131, 0.260), "KaRF": (0.127, 0.250)}

Pairs = Callable[[int, int], Correspondence]  # of two frames by their numbers


@dataclass(frozen=True)
class Way:
    """A way to recolor frames: `delta` or `paper` compositing; None for no edit."""

    frames: list[Frame]
    compositing: str | None = None

    def pictures(self, model: Model, edited: np.ndarray) -> list[np.ndarray]:
        """Return the frames with edited palettes [K, M, 3]."""
        if self.compositing is None:
            return [frame.base for frame in self.frames]
        return [composed(model, frame, edited, self.compositing) for frame in self.frames]


def consistency_table(store: Store) -> Table:
    """Measure the voxels' frames and the splats' frames of one path, by geometry and by optical flow."""
    demo = Demo(store)
    cameras = path_cameras(demo.model)
    voxels, splats = (
        [model_of(demo.model, source).render(camera) for camera in cameras] for source in ("field", "splats")
    )
    per_frame = [on_photo(demo.model, frame) for frame in voxels]
    groups: tuple[dict[str, Way], ...] = (
        {
            "not edited": Way(voxels),
            "delta, weights from F_w": Way(voxels, "delta"),
            "delta, weights from each frame's own colors": Way(per_frame, "delta"),
            "paper (Eq. 9), weights from F_w": Way(voxels, "paper"),
        },
        {"splats, not edited": Way(splats), "**splats, delta** (new cameras)": Way(splats, "delta")},
    )
    rows: dict[str, Figures] = {}
    for ways in groups:
        rows |= path_rows(demo, cameras, voxels, ways)
    for name, (short, long) in PUBLISHED.items():
        rows[f"paper: {name}, mean of other captures"] = {"flow_short": short, "flow_long": long}
    return Table("recolored", rows)


def model_of(model: Model, source: str) -> Model:
    """Return the model whose other cameras are rendered from `field` or `splats`."""
    settings = settings_for(Project(model.project.folder), "render")
    return Model(
        Project(model.project.folder), settings=replace(settings, render=replace(settings.render, source=source))
    )


def path_cameras(model: Model) -> list[Camera]:
    """Return cameras on an arc round the still life, from the first test camera on."""
    camera = model.working_camera(model.capture.split("test")[0]).without_distortion()
    cameras = []
    for number in range(PATH_VIEWS):
        turn = np.eye(4)
        cosine, sine = np.cos(number * PATH_STEP), np.sin(number * PATH_STEP)
        turn[:2, :2] = [[cosine, -sine], [sine, cosine]]
        turn[:3, 3] = PATH_CENTER - turn[:3, :3] @ PATH_CENTER
        cameras.append(replace(camera, camera_to_world=turn @ camera.camera_to_world))
    return cameras


def path_rows(demo: Demo, cameras: list[Camera], seen: list[Frame], ways: dict[str, Way]) -> dict[str, Figures]:
    """Return a row for each way, means over the edits; ratios are to the first way.

    seen: frames whose depth and masks tell which points the cameras see.
    """
    model = demo.model
    plain = [frame.base for frame in next(iter(ways.values())).frames]
    found: dict[str, list[list[float]]] = {label: [] for label in ways}
    for edit in demo.truth.edits:
        numbers = [model.objects.index(name) for name in demo.truth.edits[edit]["objects"]]
        views = [depth_view(camera, frame, numbers) for camera, frame in zip(cameras, seen, strict=True)]
        pairs, edited = pairs_of(views), demo.edited(model, edit)
        for label, way in ways.items():
            found[label].append(path_figures(pairs, plain, way.pictures(model, edited)))
    means = {label: np.mean(values, 0) for label, values in found.items()}
    still = next(iter(means.values()))
    names = ("rmse_short", "rmse_long", "flicker", "flow_short", "flow_long")
    return {
        label: {"ratio_short": v[0] / still[0], "ratio_long": v[1] / still[1]}
        | dict(zip(names, v.tolist(), strict=True))
        for label, v in means.items()
    }


def path_figures(pairs: Pairs, plain: list[np.ndarray], pictures: list[np.ndarray]) -> list[float]:
    """Return short and long RMSE by geometry, flicker, and short and long RMSE by flow of the `plain` frames."""

    def by_geometry(a: int, b: int) -> float:
        return pairs(a, b).rmse(pictures[a], pictures[b])

    def by_three(a: int, b: int) -> float:
        return flicker(pairs(a + 1, a), pairs(a + 1, b), pictures[a : b + 1])

    def by_flow(a: int, b: int) -> float:
        return flow_rmse(plain[a], plain[b], pictures[a], pictures[b])

    geometry, flow = ([mean_of_pairs(len(pictures), k, by) for k in (SHORT, LONG)] for by in (by_geometry, by_flow))
    return [*geometry, mean_of_pairs(len(pictures), 2, by_three), *flow]


def pairs_of(views: list[DepthView]) -> Pairs:
    """Return the correspondences of pairs of views, each computed once."""

    @cache
    def pairs(a: int, b: int) -> Correspondence:
        return match_by_depth(views[a], views[b])

    return pairs


def depth_view(camera: Camera, frame: Frame, numbers: list[int]) -> DepthView:
    """Return what a frame shows of the objects with these numbers."""
    return DepthView(camera, frame.depth, frame.masks[numbers].any(0) & (frame.opacity > 0.95))
