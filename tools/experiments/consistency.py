"""Table 3: how alike views of a camera path show the edited objects."""

from __future__ import annotations

import numpy as np

from karf_engine.capture.capture import View
from karf_engine.metrics.consistency import DepthView, correspond, flow_rmse, mean_of_pairs
from karf_engine.recolor.frames import Frame
from karf_engine.recolor.model import Model

from ..judging.views import terminal_progress
from .bench import Bench
from .laenerf import laenerf_error
from .recolors import composed, on_photo
from .table import Table

# a path of cameras round the still life
PATH_VIEWS, PATH_STEP, PATH_CENTER = 24, np.radians(2.5), np.array([0.0, 0.02, 0.27])
SHORT, LONG = 1, 7


def consistency_table(bench: Bench) -> Table:
    """How alike views of a camera path show the edited objects."""
    model = bench.ours().model
    frames = path_frames(bench, model)
    per_frame = [on_photo(model, frame) for frame in frames]
    ways = {
        "not edited": None,
        "delta, weights from F_w": (frames, "delta"),
        "delta, weights from each frame's own colors": (per_frame, "delta"),
        "paper (Eq. 9), weights from F_w": (frames, "paper"),
        "paper (Eq. 9), weights from each frame's own colors": (per_frame, "paper"),
    }
    plain = [frame.base for frame in frames]
    figures: dict[str, list[list[float]]] = {label: [] for label in ways}
    for edit in bench.truth.edits:
        numbers = [model.objects.index(name) for name in bench.truth.edits[edit]["objects"]]
        views = [depth_view(view, frame, numbers) for view, frame in zip(path_views(bench), frames, strict=True)]
        edited = bench.edited(model, edit)
        for label, way in ways.items():
            shown = plain if way is None else [composed(model, frame, edited, way[1]) for frame in way[0]]
            figures[label].append(consistency_figures(views, plain, shown))
    mean = {label: np.mean(values, 0) for label, values in figures.items()}
    still = mean["not edited"]
    rows = [[label, *v[:2].tolist(), *(v / still)[:2].tolist(), *v[2:].tolist()] for label, v in mean.items()]
    published = {"PaletteNeRF with LSeg": (0.136, 0.262), "LAENeRF": (0.131, 0.260), "KaRF": (0.127, 0.250)}
    rows += [[f"paper: {name}, mean of other captures", *[None] * 4, *v, *[None] * 2] for name, v in published.items()]
    return Table(
        "View consistency (Table 3)",
        f"RMSE between what two frames of a camera path show of the same surface points, {SHORT} and {LONG} frames apart "
        f"({PATH_VIEWS} frames, 2.5 degrees a frame), mean over pairs and both edits. The first four columns take "
        "points of the edited objects and carry them over by our own depth; hidden ones are left out where depths "
        "differ by 1 %. The ratio says what the edit adds: 1 is nothing. *By flow*: the protocol of Lai et al. 2018 on "
        "the whole picture, with OpenCV's DIS flow of the scene that is not edited instead of a network's. *By script*: "
        "what LAENeRF's published script computes (sums of squares, over hidden pixels), with the same flow. The paper's "
        "RMSE is by flow, with steps between views that it does not tell. Highlights "
        "move over the objects, so that even the scene that is not edited differs. A smaller figure is not always "
        "better: a flat color is perfectly consistent.",
        (
            ("recolored", ""),
            ("RMSE short", ".4f"),
            ("RMSE long", ".4f"),
            ("ratio short", ".2f"),
            ("ratio long", ".2f"),
            ("by flow, short", ".4f"),
            ("by flow, long", ".4f"),
            ("by script, short", ".4f"),
            ("by script, long", ".4f"),
        ),
        rows,
    )


def consistency_figures(views: list[DepthView], plain: list[np.ndarray], shown: list[np.ndarray]) -> list[float]:
    """Short and long: RMSE by geometry, by flow, and the script's error.

    plain: the frames without the edit.
    """

    def by_geometry(a: int, b: int) -> float:
        return correspond(views[a], views[b]).rmse(shown[a], shown[b])

    def by_flow(a: int, b: int) -> float:
        return flow_rmse(plain[a], plain[b], shown[a], shown[b])

    def by_script(a: int, b: int) -> float:
        return laenerf_error(plain[a], plain[b], shown[a], shown[b])

    measures = (by_geometry, by_flow, by_script)
    return [mean_of_pairs(len(shown), k, measure) for measure in measures for k in (SHORT, LONG)]


def path_views(bench: Bench) -> list[View]:
    """Cameras on an arc round the still life, from the first test camera on."""
    training_image = bench.ours().training_images[0]
    views = []
    for number in range(PATH_VIEWS):
        turn = np.eye(4)
        cosine, sine = np.cos(number * PATH_STEP), np.sin(number * PATH_STEP)
        turn[:2, :2] = [[cosine, -sine], [sine, cosine]]
        turn[:3, 3] = PATH_CENTER - turn[:3, :3] @ PATH_CENTER
        camera = training_image.camera.without_distortion()
        moved = type(camera)(**vars(camera) | {"camera_to_world": turn @ camera.camera_to_world})
        views.append(View(f"path_{number}", f"path_{number}", moved, None, "test"))
    return views


def path_frames(bench: Bench, model: Model) -> list[Frame]:
    """The path as learned, without photos."""
    progress = terminal_progress("path", PATH_VIEWS)
    frames = []
    for view in path_views(bench):
        frames.append(model.render(view.camera))
        progress.step()
    return frames


def depth_view(view: View, frame: Frame, numbers: list[int]) -> DepthView:
    """What a frame shows of the objects with these numbers."""
    opacity, depth = frame.picture.opacity.cpu().numpy(), frame.picture.depth.cpu().numpy()
    return DepthView(view.camera, depth, frame.masks[numbers].any(0) & (opacity > 0.95))
