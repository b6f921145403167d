"""Captured views as frames with masks refined in their photos, and edits composited into frames.

Palette weights of a captured view come from the photo's own colors, times the object's probability: they are sharp and
include the highlights. Weights of any other camera come from the colors of the splats; without splats from F_w where it is trained,
so that they are consistent between views, else from the colors of the rendering.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from ..capture.capture import View
from ..capture.training_images import load_target_image, load_views
from ..errors import BadRequest
from ..io.arguments import check_choice
from ..io.color import to_bytes
from ..io.images import alpha_composite
from ..palettes.added import extended_palettes, split_weights_of_objects
from ..palettes.compositing import delta_composite, paper_composite, stack_palettes
from ..palettes.edge_planes import apply_edges_to_planes
from ..palettes.edge_shape import EdgeShape, active_edges
from ..palettes.exposure import to_mean_exposure, to_photo_exposure
from ..palettes.matching.painted import ObjectMatch, match_picture
from ..palettes.palette import Edit
from ..project.settings import Settings
from .field_rendering import in_bands
from .frames import Frame
from .full_resolution import FindMattes, PhotoView, dense_weights, make_photo_view
from .grain import denoise, estimate_noise
from .learned import Learned
from .matting.marks import Marks, read_marks, undistort_marks
from .matting.matte import dense_coverage, disputed_objects
from .render_cache import RenderCache

BASES = {"delta": "photo", "paper": "render"}  # by compositing


def base_of(settings: Settings, base: str | None) -> str:
    """Return the base of captured views, `photo` or `render`: the given one, or the default of the compositing."""
    if base is not None:
        check_choice("base", base, tuple(BASES.values()))
    return base or BASES[settings.compositing]


def photo_view(learned: Learned, cache: RenderCache, view: View, field: Frame, size: str | int) -> PhotoView:
    """Prepare a captured view for recoloring in its photo's own pixels. field: its camera, rendered from the field."""
    marks, find_mattes = _marks_of_view(learned, view), _mattes_from(cache, learned.settings)
    return make_photo_view(view, size, field, marks, find_mattes, learned.objects, learned.palettes)


def preview_frame(learned: Learned, cache: RenderCache, view: View, field: Frame, long_side: int) -> Frame:
    """Return a captured view as its pinhole sees it, with masks refined in the photo at this size.

    field: the pinhole at the working size, rendered from the field.
    """
    training_image = load_views([view], long_side)[0]
    base = alpha_composite(training_image.color, training_image.alpha)
    photo, rendered = to_bytes(base), to_bytes(field.color * np.array(view.gains, np.float32))
    marks = undistort_marks(_marks_of_view(learned, view), view.camera)
    mattes = _mattes_from(cache, learned.settings)(photo, field.probabilities, rendered, marks)
    coverages = dense_coverage(mattes, base.shape[:2])
    weights = None
    if learned.palettes:
        denoised = denoise(photo, estimate_noise(photo))
        own_colors = [matte.own_picture(denoised) for matte in mattes]
        weights = dense_weights(own_colors, learned.palettes, coverages, view.gains)
    disputed = disputed_objects(learned.objects, mattes)
    return Frame(field.picture, coverages, weights, base, disputed, gains=view.gains)


def _marks_of_view(learned: Learned, view: View) -> Marks:
    return read_marks(learned.project.check_inside(learned.project.masks_folder), learned.objects, view)


def _mattes_from(cache: RenderCache, settings: Settings) -> FindMattes:
    return partial(cache.mattes, settings.render.edges, seed=settings.seed)


def composite(learned: Learned, frame: Frame, edit: Edit) -> np.ndarray:
    """Composite an edit of the model's palettes into the base of a frame, [H, W, 3] float32 sRGB."""
    frame = with_edges(learned, frame, edit.edges)
    assert frame.palette_weights is not None
    edited = to_photo_exposure(stack_palettes(learned.objects, edit.colors), frame.gains)
    weights = split_weights_of_objects(frame.palette_weights, learned.palettes, edit.added)
    if edit.compositing == "paper":
        return paper_composite(frame.base, weights, frame.probabilities, edited)
    known = {each.name: each.colors for each in extended_palettes(learned.palettes, edit.added)}
    before = to_photo_exposure(stack_palettes(learned.objects, known), frame.gains)
    return delta_composite(frame.base, weights, before, edited)


def with_edges(learned: Learned, frame: Frame, edges: Mapping[str, EdgeShape]) -> Frame:
    """Move and fade the edges of objects in a frame; see `Model.with_edges`."""
    learned.check_frame(frame)
    if frame.palette_weights is None:
        raise BadRequest("The frame has no palette weights.", "Take one of render, render_view or preview.")
    if not set(edges) <= set(learned.objects):
        raise BadRequest(f"The edges are of {', '.join(edges):.200}.", f"Objects are: {', '.join(learned.objects)}.")
    if not active_edges(edges):
        return frame
    if frame.camera is not None and learned.splatted is not None:
        render = partial(learned.splatted.frame, edges=active_edges(edges), fades=frame.fades)
        shaped = in_bands(render, frame.camera, frame.supersampling)
        return replace(frame, palette_weights=shaped.palette_weights, probabilities=shaped.probabilities)
    scale = max(frame.base.shape[:2]) / learned.photo_side
    planes = to_mean_exposure(frame.base, frame.gains), frame.palette_weights, frame.probabilities
    weights, probabilities = apply_edges_to_planes(*planes, learned.palettes, edges, scale)
    return replace(frame, palette_weights=weights, probabilities=probabilities)


def match(learned: Learned, frame: Frame, view: View, picture: Path, edit: Edit) -> tuple[ObjectMatch, ...]:
    """Find the palettes that bring a preview of a view closest to a picture of it; see `Model.match`."""
    assert frame.palette_weights is not None
    wanted = load_target_image(view, picture, learned.settings.render.preview)
    weights = split_weights_of_objects(frame.palette_weights, learned.palettes, edit.added)
    palettes = extended_palettes(learned.palettes, edit.added)
    sets = {each.name: range(len(each.colors), len(edit.colors[each.name])) for each in learned.palettes}
    before, after = (to_mean_exposure(each, view.gains) for each in (frame.base, wanted))
    return match_picture(weights, frame.probabilities, before, after, palettes, edit.colors, sets)
