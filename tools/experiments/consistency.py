"""Table 3: how alike views of a camera path show the edited objects, and how alike neighboring photos do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import View
from karf_engine.recolor.frames import Frame
from karf_engine.recolor.model import Model
from tools.metrics.consistency import (
    Correspondence,
    DepthView,
    flicker,
    flow_rmse,
    match_by_depth,
    mean_of_pairs,
)

from ..judging.new_cameras import model_of
from ..judging.views import terminal_progress
from .bench import Bench
from .laenerf import laenerf_error
from .recolors import composed, on_photo
from .table import Row, Table

# a path of cameras round the still life
PATH_VIEWS, PATH_STEP, PATH_CENTER = 24, np.radians(2.5), np.array([0.0, 0.02, 0.27])
SHORT, LONG = 1, 7

Pairs = Callable[[int, int], Correspondence]  # of two views by their numbers


@dataclass(frozen=True)
class Way:
    """A way to recolor views: their frames, and how an edit meets their bases (`delta`, `paper`); without it no edit."""

    frames: list[Frame]
    compositing: str | None = None

    def shown(self, model: Model, edited: np.ndarray) -> list[np.ndarray]:
        """The views with edited palettes [K, M, 3]."""
        if self.compositing is None:
            return [frame.base for frame in self.frames]
        return [composed(model, frame, edited, self.compositing) for frame in self.frames]


def consistency_table(bench: Bench) -> Table:
    """How alike views of a camera path show the edited objects, and how alike neighboring photos do."""
    return Table(
        "View consistency (Table 3)",
        f"RMSE between what two frames of a camera path show of the same surface points, {SHORT} and {LONG} frames apart "
        f"({PATH_VIEWS} frames, 2.5 degrees a frame), mean over pairs and both edits. RMSE and flicker take "
        "points of the edited objects and carry them over by our own depth (the voxels'); hidden ones are left out where "
        "depths differ by 1 %. A ratio says what the edit adds to the same pictures without it: 1 is nothing. *Flicker* is "
        "the deviation of a frame from its two neighbors, `sqrt(mean((c[t-1] - 2 c[t] + c[t+1])^2) / 6)` for the colors c "
        "of points that all three show: what changes steadily cancels, and noise of deviation s in each frame gives s. "
        "*Photos*: each test photo beside the training photo nearest to it, recolored as the render stage does. "
        "*By flow*: the protocol of Lai et al. 2018 on "
        "the whole picture, with OpenCV's DIS flow of the scene that is not edited instead of a network's. *By script*: "
        "what LAENeRF's published script computes (sums of squares, over hidden pixels), with the same flow. The paper's "
        "RMSE is by flow, with steps between views that it does not tell. LPIPS between views is not measured: its package "
        "brings the linear layers alone, and the AlexNet or VGG below them comes from no package index. Highlights "
        "move over the objects, so that even the scene that is not edited differs. A smaller figure is not always "
        "better: a flat color is perfectly consistent.",
        (
            ("recolored", ""),
            ("RMSE short", ".4f"),
            ("RMSE long", ".4f"),
            ("ratio short", ".2f"),
            ("ratio long", ".2f"),
            ("flicker", ".4f"),
            ("flicker, ratio", ".2f"),
            ("by flow, short", ".4f"),
            ("by flow, long", ".4f"),
            ("by script, short", ".4f"),
            ("by script, long", ".4f"),
        ),
        [*path_rows(bench), *photo_rows(bench), *published_rows()],
    )


def path_rows(bench: Bench) -> list[Row]:
    """The rows of the camera path, as voxels and as splats show it."""
    model, cameras = bench.model, path_cameras(bench)
    voxels, splats = (path_frames(cameras, model_of(model.project.folder, source)) for source in ("field", "splats"))
    per_frame = [on_photo(model, frame) for frame in voxels]
    of_voxels = {
        "not edited": Way(voxels),
        "delta, weights from F_w": Way(voxels, "delta"),
        "delta, weights from each frame's own colors": Way(per_frame, "delta"),
        "paper (Eq. 9), weights from F_w": Way(voxels, "paper"),
        "paper (Eq. 9), weights from each frame's own colors": Way(per_frame, "paper"),
    }
    of_splats = {
        "splats, not edited": Way(splats),
        "splats, delta, weights from their colors": Way(splats, "delta"),
    }

    def rows_of(ways: dict[str, Way]) -> list[Row]:
        plain = [frame.base for frame in next(iter(ways.values())).frames]

        def figures(pairs: Pairs, shown: list[np.ndarray]) -> list[float]:
            return path_figures(pairs, plain, shown)

        mean = mean_over_edits(bench, cameras, voxels, ways, figures)
        still = next(iter(mean.values()))
        return [[label, *v[:2], *(v / still)[:2], v[2], (v / still)[2], *v[3:]] for label, v in mean.items()]

    return [*rows_of(of_voxels), *rows_of(of_splats)]


def photo_rows(bench: Bench) -> list[Row]:
    """The rows of the test photos, each beside the training photo that was taken nearest to it."""
    model = model_of(bench.model.project.folder, "field")
    pairs = nearest_photos(model.capture.split("test"), model.capture.split("train"))
    views = [view for pair in pairs for view in pair]
    frames = [model.preview(view, model.settings.geometry.long_side) for view in views]
    cameras = [model.working_camera(view).without_distortion() for view in views]
    ways = {"photos, not edited": Way(frames), "photos, delta, weights from their colors": Way(frames, "delta")}

    def figures(pairs: Pairs, shown: list[np.ndarray]) -> list[float]:
        found = [pairs(a, a + 1).rmse(shown[a], shown[a + 1]) for a in range(0, len(shown), 2)]
        return [float(np.nanmean(found))]

    mean = mean_over_edits(bench, cameras, frames, ways, figures)
    (still,) = mean["photos, not edited"]
    return [[label, rmse, None, rmse / still, *[None] * 7] for label, (rmse,) in mean.items()]


def published_rows() -> list[Row]:
    """The paper's figures."""
    published = {"PaletteNeRF with LSeg": (0.136, 0.262), "LAENeRF": (0.131, 0.260), "KaRF": (0.127, 0.250)}
    return [[f"paper: {name}, mean of other captures", *[None] * 6, *v, None, None] for name, v in published.items()]


def mean_over_edits(
    bench: Bench,
    cameras: list[Camera],
    seen: list[Frame],
    ways: dict[str, Way],
    figures: Callable[[Pairs, list[np.ndarray]], list[float]],
) -> dict[str, np.ndarray]:
    """The figures of each way to recolor views, mean over the edits.

    Args:
        bench: What is measured on.
        cameras: Of the views.
        seen: Frames whose depth and masks say which points the views show.
        ways: By their labels; frames of the same views.
        figures: Of the points that pairs of views share, and of the views as they are shown.
    """
    model = bench.model
    found: dict[str, list[list[float]]] = {label: [] for label in ways}
    for edit in bench.truth.edits:
        numbers = [model.objects.index(name) for name in bench.truth.edits[edit]["objects"]]
        views = [depth_view(camera, frame, numbers) for camera, frame in zip(cameras, seen, strict=True)]
        pairs, edited = pairs_of(views), bench.edited(model, edit)
        for label, way in ways.items():
            found[label].append(figures(pairs, way.shown(model, edited)))
    return {label: np.mean(values, 0) for label, values in found.items()}


def pairs_of(views: list[DepthView]) -> Pairs:
    """What pairs of these views share; each pair is looked at once."""

    @cache
    def pairs(a: int, b: int) -> Correspondence:
        return match_by_depth(views[a], views[b])

    return pairs


def path_figures(pairs: Pairs, plain: list[np.ndarray], shown: list[np.ndarray]) -> list[float]:
    """Short and long RMSE by geometry; flicker; short and long RMSE by flow, and the script's error.

    plain: the frames without the edit.
    """

    def by_geometry(a: int, b: int) -> float:
        return pairs(a, b).rmse(shown[a], shown[b])

    def by_three(a: int, b: int) -> float:
        return flicker(pairs(a + 1, a), pairs(a + 1, b), shown[a : b + 1])

    def by_flow(a: int, b: int) -> float:
        return flow_rmse(plain[a], plain[b], shown[a], shown[b])

    def by_script(a: int, b: int) -> float:
        return laenerf_error(plain[a], plain[b], shown[a], shown[b])

    geometry, flow, script = (
        [mean_of_pairs(len(shown), k, measure) for k in (SHORT, LONG)] for measure in (by_geometry, by_flow, by_script)
    )
    return [*geometry, mean_of_pairs(len(shown), 2, by_three), *flow, *script]


def nearest_photos(views: list[View], others: list[View]) -> list[tuple[View, View]]:
    """Each view with that one of the others whose camera stands nearest to its own."""
    places = np.array([view.camera.camera_to_world[:3, 3] for view in others])
    nearest = [np.linalg.norm(places - view.camera.camera_to_world[:3, 3], axis=1).argmin() for view in views]
    return [(view, others[number]) for view, number in zip(views, nearest, strict=True)]


def path_cameras(bench: Bench) -> list[Camera]:
    """Cameras on an arc round the still life, from the first test camera on."""
    model = bench.model
    camera = model.working_camera(model.capture.split("test")[0]).without_distortion()
    cameras = []
    for number in range(PATH_VIEWS):
        turn = np.eye(4)
        cosine, sine = np.cos(number * PATH_STEP), np.sin(number * PATH_STEP)
        turn[:2, :2] = [[cosine, -sine], [sine, cosine]]
        turn[:3, 3] = PATH_CENTER - turn[:3, :3] @ PATH_CENTER
        cameras.append(replace(camera, camera_to_world=turn @ camera.camera_to_world))
    return cameras


def path_frames(cameras: list[Camera], model: Model) -> list[Frame]:
    """The path as learned, without photos."""
    progress = terminal_progress("path", len(cameras))
    frames = []
    for camera in cameras:
        frames.append(model.render(camera))
        progress.step()
    return frames


def depth_view(camera: Camera, frame: Frame, numbers: list[int]) -> DepthView:
    """What a frame shows of the objects with these numbers."""
    return DepthView(camera, frame.depth, frame.masks[numbers].any(0) & (frame.opacity > 0.95))
