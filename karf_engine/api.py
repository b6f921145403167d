"""The library: from a capture to recolored pictures, a function each step, in this process. Importing this needs no torch.

What is learned lies in a project, a folder that any later call, the command line and Blender can open. A stage that is
finished with the same inputs is not run again, and one that was interrupted resumes where it stood.

Each function takes the options of its command (`commands.options`) as keywords, whose names, types and ranges are
checked before anything is done, and these:

- `progress`: called with a line of text now and then, for example `print`.
- `emit`: instead of `progress`, called with the events themselves, `emit(kind, **values)`; see `worker.protocol`.
- `should_stop`: asked often; once it returns true, the call raises Cancelled, and what is learned so far is kept.

They raise `KarfError`: its subclasses (see `errors`) say whose fault it is, its `sentence` what is wrong and its `hint`
what to do about it. Full disks, missing rights and memory that ran out are reported in the same way.

Ctrl-C saves what is learned so far and then raises KeyboardInterrupt; a second one does not wait. Torch's number of
threads, its random state and its treatment of denormal numbers are as before after each call.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection
from dataclasses import MISSING
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, TypeVar

from .commands.dispatch import run_command
from .commands.options import (
    ColorwaysOptions,
    ExportSplatOptions,
    FarmOptions,
    GeometryOptions,
    ImportSplatOptions,
    InspectOptions,
    LearnOptions,
    MarkOptions,
    PaletteOptions,
    PointsOptions,
    PosesOptions,
    RecoloringOptions,
    RenderOptions,
    SegmentationOptions,
    SplatsOptions,
)
from .compute.interrupts import stop_on_interrupt
from .compute.progress import Emit, TerminalEmit
from .compute.torch_state import preserved_torch_state
from .errors import missing_package
from .io.arguments import check_type, checked
from .io.failures import translated
from .io.options import Options, listed

if TYPE_CHECKING:
    from .capture.capture import Capture
    from .capture.quality.advice import Advice
    from .recolor.model import Model

PathLike = Path | str
Function = TypeVar("Function", bound=Callable[..., Any])


class Run(TypedDict, total=False):
    """Who listens to a command while it runs, see the module's docstring."""

    progress: Callable[[str], None] | None
    emit: Emit | None
    should_stop: Callable[[], bool] | None


def _takes(kind: type[Options], *, hidden: Collection[str] = (), is_run: bool = True) -> Callable[[Function], Function]:
    """Give a function that takes `**options` the signature and the docstring of a command's options.

    Args:
        kind: The options.
        hidden: Names of those that the function sets itself.
        is_run: Whether the function takes the listeners of `Run` too.
    """

    def documented(function: Function) -> Function:
        signature = inspect.signature(function)
        own = [each for each in signature.parameters.values() if each.kind is not each.VAR_KEYWORD]
        more = [item for item in listed(kind) if item.name not in {*signature.parameters, *hidden}]
        named = {item.name: inspect.Parameter.empty if item.default is MISSING else item.default for item in more}
        named |= dict.fromkeys(Run.__annotations__) if is_run else {}
        keywords = [inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=named[name]) for name in named]
        function.__signature__ = signature.replace(parameters=[*own, *keywords])
        text = inspect.cleandoc(function.__doc__)
        lines = [f"    {item.name}: {item.metadata['help']}." for item in listed(kind) if f" {item.name}:" not in text]
        function.__doc__ = "\n".join([text, "", "Options:", *lines])
        return function

    return documented


# -------------------------------------------------------------------------------------------------------------- capture
@_takes(PosesOptions)
def find_poses(photos: PathLike, out: PathLike, **options: Any) -> None:
    """Make a capture of photos without camera poses, or of a video; needs the extra `photos`.

    Args:
        photos: A folder of photos, or a video file.
        out: The new capture's folder.

    Raises:
        KarfError: Too few photos could be placed, or a photo is damaged.

    Example:
        find_poses("photos", "garden")
    """
    _run(PosesOptions, photos=photos, out=out, **options)


@_takes(ImportSplatOptions)
def import_splat(splat: PathLike, out: PathLike, **options: Any) -> None:
    """Make a capture of Gaussian splats that another program has learned; needs the extra `fast`, and `splats` for some files.

    Args:
        splat: The file.
        out: The new capture's folder, which is learned, marked and recolored as any other; its splats stay as they are.

    Raises:
        KarfError: The file is damaged, or does not show the photos.

    Example:
        import_splat("garden.ply", "garden")
    """
    _run(ImportSplatOptions, splat=splat, out=out, **options)


@_takes(InspectOptions, is_run=False)
def inspect_capture(capture: Capture | PathLike, **options: Any) -> Advice:
    """Look at photos, cameras and masks before anything is learned of them, in seconds; needs no torch.

    Args:
        capture: What `open_capture` gave, or the path of a capture of any known format.

    Returns:
        What is expected of it (`psnr`, `is_poor`), in a `sentence`, and what to mend (`findings`); its `inspection` has
        the figures.

    Raises:
        KarfError: It has less than three photos, or one is missing or damaged.

    Example:
        print(inspect_capture("garden", out="inspected").sentence)
    """
    given = InspectOptions.of(capture=_path_of(capture), **options)
    try:
        from .commands.inspect import look
    except ModuleNotFoundError as error:
        raise missing_package(error.name) from error
    with translated():
        return look(given)


@_takes(MarkOptions, is_run=False)
def mark(capture: Capture | PathLike, view: str, object_name: str, masks: PathLike, **options: Any) -> Path:
    """Write the mask of an object in one photo as MASKS/<object>/<view>.png, from a box, clicks or a lasso.

    Args:
        capture: What `open_capture` gave, or the path of a capture of any known format.
        view: Its name.
        object_name: What the object is called.
        masks: The folder of masks.

    Returns:
        The file.

    Raises:
        KarfError: The view is unknown, or nothing says where in it the object is.

    Example:
        mark("garden", "r_003", "pot", "masks", box=(120, 80, 310, 260))
    """
    given = MarkOptions.of(capture=_path_of(capture), view=view, object_name=object_name, masks=masks, **options)
    try:
        from .commands.mark import write
    except ModuleNotFoundError as error:
        raise missing_package(error.name) from error
    with translated():
        return write(given)


# ------------------------------------------------------------------------------------------------------------- learning
@_takes(LearnOptions)
def learn(capture: Capture | PathLike, masks: PathLike, *, project: PathLike, **options: Any) -> Model:
    """Learn everything: geometry, segmentation, palettes and their weights.

    Args:
        capture: What `open_capture` gave, or the path of a capture of any known format.
        masks: A folder of rough masks, MASKS/<object>/<photo stem>.png.
        project: The project's folder, made if needed.

    Returns:
        The learned model.

    Raises:
        KarfError: An input is missing, damaged or contradicts another, or the computer ran out of memory.

    Example:
        model = learn("garden", "masks", project="garden_karf", preset="fast", progress=print)
    """
    _run(LearnOptions, capture=capture, masks=masks, project=project, **options)
    return load(project, device=options.get("device"))


@_takes(GeometryOptions)
def learn_geometry(capture: Capture | PathLike, *, project: PathLike, **options: Any) -> None:
    """Learn the radiance field of a capture into a project; marked photos are among those that it learns from.

    Arguments and errors are those of `learn`.

    Example:
        learn_geometry("garden", project="garden_karf", preset="fine", holdout=8)
    """
    _run(GeometryOptions, capture=capture, project=project, **options)


@_takes(SegmentationOptions)
def segment(project: PathLike, masks: PathLike | None = None, **options: Any) -> None:
    """Learn F_s: which part of the scene is which object.

    Args:
        project: One whose geometry is learned.
        masks: A folder of rough masks, MASKS/<object>/<photo stem>.png; by default the project's own.

    Raises:
        KarfError: A mask fits no photo or marks nothing, or the project's geometry is missing or damaged.

    Example:
        segment("garden_karf", masks="masks")
    """
    _run(SegmentationOptions, project=project, masks=masks, **options)


@_takes(PaletteOptions)
def extract_palettes(project: PathLike, **options: Any) -> None:
    """Extract a palette from the colors of every segmented object. Raises KarfError where none is segmented.

    Example:
        extract_palettes("garden_karf")
    """
    _run(PaletteOptions, project=project, **options)


@_takes(RecoloringOptions)
def learn_recoloring(project: PathLike, **options: Any) -> None:
    """Learn F_w, the palette weights of every point, and adapt the palettes. Raises KarfError where none is extracted.

    Example:
        learn_recoloring("garden_karf", threads=2)
    """
    _run(RecoloringOptions, project=project, **options)


@_takes(SplatsOptions)
def learn_splats(project: PathLike, **options: Any) -> None:
    """Learn the scene as Gaussians, which show it sharply from any camera. Raises KarfError where no scene is learned.

    Example:
        learn_splats("garden_karf", overrides=["splats.iterations=2000"])
    """
    _run(SplatsOptions, project=project, **options)


@checked
def load(project: PathLike, device: str | None = None) -> Model:
    """The model in a project's folder, see `Model.load`.

    Example:
        model = load("garden_karf")
    """
    try:
        from .recolor.model import Model
    except ModuleNotFoundError as error:
        raise missing_package(error.name) from error
    with translated(), preserved_torch_state():
        return Model.load(project, device)


# ------------------------------------------------------------------------------------------------------------- pictures
@_takes(RenderOptions)
def render(project: PathLike, out: PathLike, **options: Any) -> None:
    """Write frames of many views as files: OUT/render, OUT/masks/<object>, and with an edit OUT/recolor.

    Args:
        project: One whose geometry is learned.
        out: The folder to write to.

    Raises:
        KarfError: A view or an object of the edit is unknown, or what they need is not learned.

    Example:
        render("garden_karf", "frames", views="test", edit="edit.json", depth=True)
    """
    _run(RenderOptions, project=project, out=out, **options)


@_takes(ColorwaysOptions)
def colorways(project: PathLike, sheet: PathLike, out: PathLike, **options: Any) -> None:
    """Write every colorway of a sheet in every view: OUT/<colorway>/<view>, OUT/colorways.csv, OUT/contact_sheet.png.

    The table says of each color what it will be, how far that is from the target color, and why not closer; after the
    pictures, what was measured in them. Pictures of an earlier call that would come out the same are kept.

    Args:
        project: One whose palettes are learned.
        sheet: CSV or JSON with a colorway, an object and a color a row; see `palettes.colorways.sheet`.
        out: The folder to write to.

    Raises:
        KarfError: The sheet has a row that is wrong, a view is unknown, or palettes are not learned.

    Example:
        colorways("garden_karf", "sheet.csv", "colorways", size=1024)
    """
    _run(ColorwaysOptions, project=project, sheet=sheet, out=out, **options)


@_takes(PointsOptions)
def write_points(project: PathLike, out: PathLike, **options: Any) -> None:
    """Write the scene as points on its surface, for viewers.

    Args:
        project: One whose palettes are learned.
        out: The file: `.npz`, with all that recoloring needs (`read_points`), or `.ply`, colored points.

    Raises:
        KarfError: Nothing is learned, the count is out of range, or the file is of another kind.

    Example:
        write_points("garden_karf", "garden.ply", count=200_000)
    """
    _run(PointsOptions, project=project, out=out, **options)


@_takes(ExportSplatOptions)
def export_splat(project: PathLike, out: PathLike, **options: Any) -> None:
    """Write the scene as Gaussian splats for other programs, with an edit baked in; some files need the extra `splats`.

    Args:
        project: One whose splats are learned or imported; with an edit or objects, its palettes too.
        out: The file, whose end says its kind.

    Raises:
        KarfError: No splats are there, an object is unknown, or the file cannot hold what is asked for.

    Example:
        export_splat("garden_karf", "garden_blue.ply", edit="edit.json")
    """
    _run(ExportSplatOptions, project=project, out=out, **options)


# ------------------------------------------------------------------------------------------------------- other computers
@_takes(FarmOptions, hidden=("source", "masks", "preset", "holdout"), is_run=False)
def render_bundle(project: PathLike, out: PathLike, **options: Any) -> Path:
    """Write a job bundle that renders frames of a learned project on a render farm, a task for every few of them.

    Args:
        project: The project's folder.
        out: The bundle's folder, new or empty.

    Returns:
        The bundle's folder, absolute.

    Raises:
        KarfError: The project is not learned, a view is unknown, an edit is not of this project, or `out` is taken.

    Example:
        render_bundle("garden_karf", "job", views="cameras.json", edit="edit.json", per_task=20)
    """
    from .commands.farm.bundle import write_bundle  # needs numpy

    return write_bundle(FarmOptions.of(source=project, out=out, **options))


@_takes(FarmOptions, hidden=("source",), is_run=False)
def learning_bundle(capture: Capture | PathLike, masks: PathLike, out: PathLike, **options: Any) -> Path:
    """Write a job bundle that learns a capture, a step for every stage, and then renders frames of it.

    Args:
        capture: A capture, or its path, whose photos lie below its folder.
        masks: A folder of rough masks.
        out: The bundle's folder, new or empty.

    Returns:
        The bundle's folder, absolute.

    Raises:
        KarfError: The capture or the masks cannot be read, a photo lies elsewhere, or `out` is taken.

    Example:
        learning_bundle("garden", "masks", "job", preset="fine")
    """
    from .commands.farm.bundle import write_bundle  # needs numpy

    return write_bundle(FarmOptions.of(source=_path_of(capture), masks=masks, out=out, **options))


# -------------------------------------------------------------------------------------------------------------- running
def _run(kind: type[Options], **given: Any) -> None:
    """Run a command with these options, or with the listeners of `Run` among them."""
    run: Run = {name: given.pop(name) for name in Run.__annotations__ if name in given}
    in_memory = {}
    for name, listener in run.items():
        check_type(kind.command, name, listener, Callable | None)
    if _is_opened(given.get("capture")):
        in_memory["capture"] = given["capture"]
        given["capture"] = _path_of(given["capture"])
    emit = run.get("emit") or _events_to(run.get("progress"))
    with translated(), preserved_torch_state(), stop_on_interrupt(run.get("should_stop")) as should_stop:
        run_command(kind.of(**given), emit, should_stop, **in_memory)


def _is_opened(capture: Any) -> bool:
    from .capture.capture import Capture  # needs numpy

    return isinstance(capture, Capture)


def _path_of(capture: Any) -> Any:
    """The path of an opened capture, or what else was given."""
    return capture.source if _is_opened(capture) else capture


class _Lines:
    """A text stream whose lines go to a function."""

    def __init__(self, receive: Callable[[str], None]) -> None:
        self._receive = receive

    def isatty(self) -> bool:
        return False

    def write(self, text: str) -> None:
        if text.strip():
            self._receive(text.rstrip("\n"))

    def flush(self) -> None:
        pass


def _events_to(progress: Callable[[str], None] | None) -> Emit:
    """Events for a function of lines; without one they are dropped."""
    return TerminalEmit(_Lines(progress)) if progress else lambda kind, /, **values: None
