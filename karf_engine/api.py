"""The library's functions: each stage of KaRF with plain values, in this process. Importing this needs no torch.

What is learned lies in a project, a folder that any later call, the command line and Blender can open. A stage that is
finished with the same inputs is not run again, and one that was interrupted resumes where it stood.

Every function that learns or renders also takes:

- `threads`: processor threads; by default all cores, at most 4.
- `device`: `cpu`, `cuda` or `cuda:<number>`; by default CUDA where there is one.
- `progress`: called with a line of text now and then, for example `print`.
- `emit`: instead of `progress`, called with the events themselves, `emit(kind, **values)`; see `wire`.
- `should_stop`: asked often; once it returns true, the call raises Cancelled, and what is learned so far is kept.

They raise `KarfError`: its subclasses (see `errors`) say whose fault it is, its `sentence` what is wrong and its `hint`
what to do about it. Full disks, missing rights and memory that ran out are told in the same way.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from .commands.dispatch import run_request
from .compute.progress import Emit, TerminalEmit
from .errors import missing_package
from .io.failures import translated
from .wire import Request

if TYPE_CHECKING:
    from .capture.capture import Capture
    from .recolor.model import Model

PathLike = Path | str


class Run(TypedDict, total=False):
    """How a stage is run, see the module's docstring."""

    threads: int | None
    device: str | None
    progress: Callable[[str], None] | None
    emit: Emit | None
    should_stop: Callable[[], bool] | None


def learn(
    capture: Capture | PathLike,
    masks: PathLike,
    *,
    project: PathLike,
    preset: str = "demo",
    overrides: Sequence[str] = (),
    nerf: PathLike | None = None,
    holdout: int | None = None,
    **run: Unpack[Run],
) -> Model:
    """Learn everything: geometry, segmentation, palettes and their weights.

    Args:
        capture: what `open_capture` gave, or the path of a capture of any known format.
        masks: a folder of rough masks, MASKS/<object>/<photo stem>.png.
        project: the project's folder, made if needed.
        preset: `demo`, `fast`, `quality` or `paper` (see `PRESETS`).
        overrides: single settings, each as `stage.field=value`.
        nerf: checkpoint of a NeRF that another program has trained on this capture, to take as geometry.
        holdout: hold out every so many-th photo as test view, unless it is marked, where the capture declares none; 0:
            learn from all. By default as the project was learned, else 0.
        **run: see the module's docstring.

    Returns:
        The learned model.

    Raises:
        KarfError: an input is missing, damaged or contradicts another, or the computer ran out of memory.
    """
    chosen = {"preset": preset, "overrides": overrides, "nerf": nerf, "holdout": holdout}
    learn_geometry(capture, project=project, masks=masks, **chosen, **run)
    segment(project, masks, **run)
    extract_palettes(project, **run)
    learn_recoloring(project, **run)
    return load(project, device=run.get("device"))


def learn_geometry(
    capture: Capture | PathLike,
    *,
    project: PathLike,
    preset: str = "demo",
    overrides: Sequence[str] = (),
    nerf: PathLike | None = None,
    holdout: int | None = None,
    masks: PathLike | None = None,
    **run: Unpack[Run],
) -> None:
    """Learn the radiance field of a capture into a project; marked photos are among those that it learns from.

    Arguments and errors as for `learn`.
    """
    is_open = not isinstance(capture, PathLike)
    source = capture.source if is_open else capture
    options = {"capture": str(source), "preset": preset, "overrides": list(overrides)}
    options |= {name: str(path) for name, path in (("nerf", nerf), ("masks", masks)) if path is not None}
    if holdout is not None:
        options["holdout"] = holdout
    _run("geometry", project, options, run, **({"capture": capture} if is_open else {}))


def segment(
    project: PathLike,
    masks: PathLike | None = None,
    corrections: PathLike | None = None,
    volumes: PathLike | None = None,
    **run: Unpack[Run],
) -> None:
    """Learn F_s: which part of the scene is which object.

    Args:
        project: one whose geometry is learned.
        masks: a folder of rough masks, MASKS/<object>/<photo stem>.png; by default the project's own.
        corrections: a folder of partial marks, CORRECTIONS/<object>/<view>.png; by default the project's own.
        volumes: a file of boxes and meshes that objects must be inside or outside of; by default the project's own.
        **run: see the module's docstring.

    Raises:
        KarfError: a mask fits no photo, marks nothing, or the project's geometry is missing or damaged.
    """
    given = {"masks": masks, "corrections": corrections, "volumes": volumes}
    _run("segmentation", project, {name: str(path) for name, path in given.items() if path is not None}, run)


def extract_palettes(project: PathLike, **run: Unpack[Run]) -> None:
    """Extract a palette from the colors of every segmented object. Raises KarfError where none is segmented."""
    _run("palette", project, {}, run)


def learn_recoloring(project: PathLike, **run: Unpack[Run]) -> None:
    """Learn F_w, the palette weights of every point, and adapt the palettes. Raises KarfError where none is extracted."""
    _run("recoloring", project, {}, run)


def render(
    project: PathLike,
    out: PathLike,
    *,
    views: str = "all",
    first: int | None = None,
    last: int | None = None,
    count: int | None = None,
    edit: PathLike | None = None,
    base: str | None = None,
    size: str | int = "photo",
    depth: bool = False,
    unsure: bool = False,
    planes: bool = False,
    alpha: bool = False,
    jpeg: bool = False,
    format: str = "png8",
    overrides: Sequence[str] = (),
    layers: bool = False,
    skip_existing: bool = False,
    **run: Unpack[Run],
) -> None:
    """Write frames of many views as files: OUT/render, OUT/masks/<object>, and with an edit OUT/recolor.

    Args:
        project: one whose geometry is learned.
        out: the folder to write to.
        views: `train`, `test`, `val`, `all`, names with commas, or the path of a CAMERAS.json (transforms.json with sizes).
        first: number of the first of these views to write, counted from 1.
        last: number of the last one; beyond the end: the end.
        count: how many views to write at most.
        edit: file of an edit (`ProjectEdit.save`), or a folder with `<view>.json` for each view.
        base: what an edit of a captured view changes, `photo` or `render`; by default the photo, with the paper's
            compositing the rendering.
        size: of masks and recolored pictures of captured views: `photo`, all pixels of the photo as stored; `learned`,
            as its pinhole shows it at the size that was learned from, as all with the rendering as base; or the long
            side in pixels to which the photo is reduced.
        depth: write OUT/depth too, float32 .npy along the optical axis, world units.
        unsure: write OUT/unsure/<object> too, white where nothing is sure that is said of the object, of the size learned.
        planes: write OUT/planes too, what Blender recolors from.
        alpha: write renderings without what is behind the scene, with alpha.
        jpeg: write recolored JPEG photos as JPEG, not as PNG: pixels that no edit reaches change a little.
        format: of recolored frames of cameras without photos: `png8`, `png16`, `exr16` or `exr32` (scene-linear).
        overrides: single settings of how to render, each as `render.field=value`.
        layers: write OUT/layers too, OpenEXR files for compositors.
        skip_existing: keep frames that an earlier call has finished with the same model, camera, edit and arguments.
        **run: see the module's docstring.

    Raises:
        KarfError: a view or an object of the edit is unknown, or what they need is not learned.
    """
    options = {
        "out": str(out),
        "views": views,
        "size": size,
        "overrides": list(overrides),
        "alpha": alpha,
        "jpeg": jpeg,
        "format": format,
    }
    options |= {"depth": depth, "unsure": unsure, "planes": planes, "layers": layers, "skip_existing": skip_existing}
    options |= {name: str(value) for name, value in (("edit", edit), ("base", base)) if value is not None}
    part = {"first": first, "last": last, "count": count}
    options |= {name: number for name, number in part.items() if number is not None}
    _run("render", project, options, run)


def colorways(
    project: PathLike,
    sheet: PathLike,
    out: PathLike,
    *,
    views: str = "all",
    size: str | int = "photo",
    predict_only: bool = False,
    **run: Unpack[Run],
) -> None:
    """Write every colorway of a sheet in every view: OUT/<colorway>/<view>, OUT/colorways.csv, OUT/contact_sheet.png.

    The table says of each color what it will be, how far that is from the target color, and why not closer; after the
    pictures, what was measured in them. Pictures of an earlier call that would come out the same are kept.

    Args:
        project: one whose palettes are learned.
        sheet: CSV or JSON with a colorway, an object and a color a row; see `palettes.colorways.sheet`.
        out: the folder to write to.
        views: as for `render`.
        size: of captured views, as for `render`.
        predict_only: render nothing; only write the table.
        **run: see the module's docstring.

    Raises:
        KarfError: the sheet has a row that is wrong, a view is unknown, or palettes are not learned.
    """
    options = {"sheet": str(sheet), "out": str(out), "views": views, "size": size, "predict_only": predict_only}
    _run("colorways", project, options, run)


def write_points(
    project: PathLike, out: PathLike, *, count: int = 60_000, edit: PathLike | None = None, **run: Unpack[Run]
) -> None:
    """Write the scene as points on its surface, for viewers.

    Args:
        project: one whose palettes are learned.
        out: the file: `.npz`, with all that recoloring needs (`read_points`), or `.ply`, colored points.
        count: about how many points.
        edit: of a `.ply`, the file of an edit that its colors have.
        **run: see the module's docstring.

    Raises:
        KarfError: nothing is learned, the count is out of range, or the file is of another kind.
    """
    options = {"out": str(out), "count": count} | ({} if edit is None else {"edit": str(edit)})
    _run("points", project, options, run)


def find_poses(photos: PathLike, out: PathLike, *, matching: str = "auto", **run: Unpack[Run]) -> None:
    """Make a capture of photos without camera poses, or of a video; needs the extra `photos`.

    Args:
        photos: a folder of photos, or a video file.
        out: the new capture's folder.
        matching: which pairs are compared, `exhaustive`, `sequential` (neighbors by name) or `auto` (all of up to 250).
        **run: see the module's docstring.

    Raises:
        KarfError: too few photos could be placed, or a photo is damaged.
    """
    _run("poses", out, {"photos": str(photos), "out": str(out), "matching": matching}, run)


def mark(
    capture: PathLike,
    view: str,
    object_name: str,
    masks: PathLike,
    *,
    box: Sequence[float] | None = None,
    points: Sequence[tuple[float, float, bool]] = (),
    lasso: Sequence[tuple[float, float]] | None = None,
    weights: PathLike | None = None,
) -> Path:
    """Write the mask of an object in one photo as MASKS/<object>/<view>.png, from a box, clicks or a lasso.

    Args:
        capture: the path of a capture of any known format.
        view: its name.
        object_name: what the object is called.
        masks: the folder of masks.
        box: x0, y0, x1, y1 of a frame that it lies in, in pixels of the photo as stored.
        points: clicks x, y, is_object, in the order in which they were made.
        lasso: corners x, y of a line around it.
        weights: folder of a Segment Anything model, which then says what is meant; needs the extra `marks`.

    Returns:
        The file.

    Raises:
        KarfError: the view is unknown, or nothing says where in it the object is.
    """
    try:
        from .segmentation.marking.prompts import Prompts
        from .segmentation.marking.views import marker_of, write_mask
    except ModuleNotFoundError as error:
        raise missing_package(error.name) from error
    with translated():
        prompts = Prompts.from_json({"box": box, "points": points, "lasso": lasso})
        return write_mask(marker_of(capture, view, weights), prompts, Path(masks), object_name, view)


def load(project: PathLike, device: str | None = None) -> Model:
    """The model in a project's folder, see `Model.load`."""
    try:
        from .recolor.model import Model
    except ModuleNotFoundError as error:
        raise missing_package(error.name) from error
    with translated():
        return Model.load(project, device)


def _run(stage: str, project: PathLike, options: dict[str, Any], run: Run, **in_memory: Any) -> None:
    emit = run.get("emit") or _events_to(run.get("progress"))
    options |= {name: run[name] for name in ("threads", "device") if run.get(name) is not None}
    should_stop = run.get("should_stop") or (lambda: False)
    with translated():
        run_request(Request(stage, Path(project), options), emit, should_stop, **in_memory)


class _Lines:
    """A text stream whose lines go to a function."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say

    def isatty(self) -> bool:
        return False

    def write(self, text: str) -> None:
        if text.strip():
            self._say(text.rstrip("\n"))

    def flush(self) -> None:
        pass


def _events_to(progress: Callable[[str], None] | None) -> Emit:
    """Events for a function of lines; without one they are dropped."""
    return TerminalEmit(_Lines(progress)) if progress else lambda kind, /, **values: None
