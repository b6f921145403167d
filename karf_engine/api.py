"""The library: one function for each step from a capture to recolored pictures. Importing this needs no torch.

Results are stored in a project, a folder that the command line and Blender open too. Stages finished with the same inputs
are skipped; interrupted ones resume.

Each function takes the options of its command (`commands.options`) as keywords and checks their names, types and ranges
first. Functions that learn or render take these as well:

- `progress`: receives a line of text now and then, for example `print`.
- `emit`: receives the events instead, `emit(kind, **values)`; see `worker.protocol`.
- `should_stop`: polled often; once it returns true, the call saves what is learned so far and raises Cancelled.

Three options also take objects: `device` a `torch.device`, `overrides` a dictionary of settings by their dotted names,
and `edit` an `Edit`.

Errors are `KarfError`s: the subclass (see `errors`) tells whose fault it is, `sentence` what is wrong and `hint` what to
do about it. This includes full disks, missing rights and exhausted memory.

Ctrl-C saves what is learned so far and then raises KeyboardInterrupt; a second one does not wait. Each call restores
torch's number of threads, random state and treatment of denormal numbers.
"""

from __future__ import annotations

import inspect
import json
import sys
import tempfile
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import MISSING, asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

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
from .io.arguments import check_type
from .io.failures import translate_errors
from .io.options import Options, fields_in_help_order
from .project.settings import Level

if TYPE_CHECKING:
    import torch

    from .capture.capture import Capture
    from .capture.quality.advice import Advice
    from .recolor.model import Model

PathLike = Path | str
Function = TypeVar("Function", bound=Callable[..., Any])

# keyword -> type, of the functions that learn or render
LISTENERS = {
    "progress": "Callable[[str], None] | None",
    "emit": "Emit | None",
    "should_stop": "Callable[[], bool] | None",
}
# option -> type that the library takes in addition to the option's own, or in place of a path
OBJECTS = {
    "device": "torch.device",
    "overrides": "Mapping[str, Any]",
    "edit": "Edit",
    "edges": "Edit",
}


def _takes(
    kind: type[Options], *, hidden: Collection[str] = (), listens: bool = True
) -> Callable[[Function], Function]:
    """Give a function that takes `**options` the signature and the docstring of a command's options.

    Args:
        kind: The options.
        hidden: Names of options that the function sets.
        listens: Whether the function takes `LISTENERS` too.
    """

    def documented(function: Function) -> Function:
        signature = inspect.signature(function)
        own = [each for each in signature.parameters.values() if each.kind is not each.VAR_KEYWORD]
        more = [item for item in fields_in_help_order(kind) if item.name not in {*signature.parameters, *hidden}]
        defaults = {item.name: inspect.Parameter.empty if item.default is MISSING else item.default for item in more}
        defaults |= dict.fromkeys(LISTENERS) if listens else {}
        keywords = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=defaults[name]) for name in defaults
        ]
        function.__signature__ = signature.replace(parameters=[*own, *keywords])
        function.options = kind
        text = inspect.cleandoc(function.__doc__ or "")
        lines = [
            f"    {item.name}: {item.metadata['help']}."
            for item in fields_in_help_order(kind)
            if f" {item.name}:" not in text
        ]
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
    """Make a capture of Gaussian splats of another program; needs the extra `fast`, and `splats` for some files.

    Args:
        splat: The file.
        out: The new capture's folder. It is learned, marked and recolored like any other, with its own splats.

    Raises:
        KarfError: The file is damaged, or does not show the photos.

    Example:
        import_splat("garden.ply", "garden")
    """
    _run(ImportSplatOptions, splat=splat, out=out, **options)


@_takes(InspectOptions, listens=False)
def inspect_capture(capture: Capture | PathLike, **options: Any) -> Advice:
    """Check photos, cameras and masks before learning, in seconds; needs no torch.

    Args:
        capture: The result of `open_capture`, or the path of a capture of any known format.

    Returns:
        The expected quality (`psnr`, `is_poor`) in a `sentence`, and what to improve (`findings`); `inspection` has the
        figures.

    Raises:
        KarfError: It has less than three photos, or one is missing or damaged.

    Example:
        print(inspect_capture("garden", out="inspected").sentence)
    """
    return _answer(InspectOptions, capture=capture, **options)


@_takes(MarkOptions, listens=False)
def mark(capture: Capture | PathLike, view: str, object_name: str, masks: PathLike, **options: Any) -> Path:
    """Write the mask of an object in one photo as MASKS/<object>/<view>.png, from a box, clicks or a lasso.

    Args:
        capture: The result of `open_capture`, or the path of a capture of any known format.
        view: The photo's name.
        object_name: The object's name.
        masks: The folder of masks.

    Returns:
        The file.

    Raises:
        KarfError: The view is unknown, or there is neither a box, a click nor a lasso.

    Example:
        mark("garden", "r_003", "pot", "masks", box=(120, 80, 310, 260))
    """
    return _answer(MarkOptions, capture=capture, view=view, object_name=object_name, masks=masks, **options)


# ------------------------------------------------------------------------------------------------------------- learning
@_takes(LearnOptions)
def learn(capture: Capture | PathLike, masks: PathLike, *, project: PathLike, **options: Any) -> Model:
    """Learn everything: geometry, segmentation, palettes and their weights.

    Args:
        capture: The result of `open_capture`, or the path of a capture of any known format.
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
    """Learn the radiance field of a capture, from all marked photos among others. Arguments and errors are those of `learn`.

    Example:
        learn_geometry("garden", project="garden_karf", preset="fine", holdout=8)
    """
    _run(GeometryOptions, capture=capture, project=project, **options)


@_takes(SegmentationOptions)
def segment(project: PathLike, masks: PathLike | None = None, **options: Any) -> None:
    """Learn the segmentation field F_s: which part of the scene is which object.

    Args:
        project: A project with learned geometry.
        masks: A folder of rough masks, MASKS/<object>/<photo stem>.png; by default the project's own.

    Raises:
        KarfError: A mask matches no photo or is empty, or the project's geometry is missing or damaged.

    Example:
        segment("garden_karf", masks="masks")
    """
    _run(SegmentationOptions, project=project, masks=masks, **options)


@_takes(PaletteOptions)
def extract_palettes(project: PathLike, **options: Any) -> None:
    """Extract a palette from the colors of every segmented object. Raises KarfError before segmentation.

    Example:
        extract_palettes("garden_karf")
    """
    _run(PaletteOptions, project=project, **options)


@_takes(RecoloringOptions)
def learn_recoloring(project: PathLike, **options: Any) -> None:
    """Finish the palettes; with `recoloring.iterations`, train F_w, the palette weights of every point, and adapt them.

    Raises:
        KarfError: No palettes are extracted, or a setting is not one of `recoloring`.

    Example:
        learn_recoloring("garden_karf", overrides={"recoloring.iterations": 1000})
    """
    _run(RecoloringOptions, project=project, **options)


@_takes(SplatsOptions)
def learn_splats(project: PathLike, **options: Any) -> None:
    """Learn the scene as Gaussians, which show it sharply from any camera. Raises KarfError without learned geometry.

    Example:
        learn_splats("garden_karf", overrides={"splats.iterations": 2000})
    """
    _run(SplatsOptions, project=project, **options)


def load(project: PathLike, device: torch.device | str | None = None) -> Model:
    """Load the model in a project's folder, see `Model.load`.

    Example:
        model = load("garden_karf")
    """
    name = _device_name(device)
    check_type("load", "project", project, PathLike)
    check_type("load", "device", name, str | None)
    try:
        from .recolor.model import Model
    except ModuleNotFoundError as error:
        raise missing_package(str(error.name)) from error
    with translate_errors(), preserved_torch_state():
        return Model.load(project, name)


# ------------------------------------------------------------------------------------------------------------- pictures
@_takes(RenderOptions)
def render(project: PathLike, out: PathLike, **options: Any) -> None:
    """Write frames of many views as files: OUT/render, OUT/masks/<object>, and with an edit OUT/recolor.

    Args:
        project: A project with learned geometry.
        out: The folder to write to.

    Raises:
        KarfError: A view or an object of the edit is unknown, or a stage that they need is not finished.

    Example:
        render("garden_karf", "frames", views="test", edit="edit.json", depth=True)
    """
    _run(RenderOptions, project=project, out=out, **options)


@_takes(ColorwaysOptions)
def colorways(project: PathLike, sheet: PathLike, out: PathLike, **options: Any) -> None:
    """Write every colorway of a sheet in every view: OUT/<colorway>/<view>, OUT/colorways.csv, OUT/contact_sheet.png.

    For each color the table has the predicted and the measured color, their distance from the target, and the reason
    where the target is missed. Pictures of an earlier call that would be the same are kept.

    Args:
        project: A project with learned palettes.
        sheet: CSV or JSON, each row a colorway, an object and a color; see `palettes.colorways.sheet`.
        out: The folder to write to.

    Raises:
        KarfError: A row of the sheet is wrong, a view is unknown, or palettes are not learned.

    Example:
        colorways("garden_karf", "sheet.csv", "colorways", size=1024)
    """
    _run(ColorwaysOptions, project=project, sheet=sheet, out=out, **options)


@_takes(PointsOptions)
def write_points(project: PathLike, out: PathLike, **options: Any) -> None:
    """Write the scene as points on its surface, for viewers.

    Args:
        project: A project with learned palettes.
        out: The file: `.npz`, with palette weights for recoloring (`read_points`), or `.ply`, colored points.

    Raises:
        KarfError: Palettes are not learned, the count is out of range, or the file is of another kind.

    Example:
        write_points("garden_karf", "garden.ply", count=200_000)
    """
    _run(PointsOptions, project=project, out=out, **options)


@_takes(ExportSplatOptions)
def export_splat(project: PathLike, out: PathLike, **options: Any) -> None:
    """Write the scene as Gaussian splats for other programs, with an edit baked in; some files need the extra `splats`.

    Args:
        project: A project with learned or imported splats; with an edit or objects, with learned palettes too.
        out: The file; its suffix chooses the format.

    Raises:
        KarfError: The project has no splats, an object is unknown, or the format cannot store the request.

    Example:
        export_splat("garden_karf", "garden_blue.ply", edit="edit.json")
    """
    _run(ExportSplatOptions, project=project, out=out, **options)


# ------------------------------------------------------------------------------------------------------- other computers
@_takes(FarmOptions, hidden=("source", "masks", "preset", "holdout"), listens=False)
def render_bundle(project: PathLike, out: PathLike, **options: Any) -> Path:
    """Write a job bundle that renders frames of a learned project on a render farm, some frames in each task.

    Args:
        project: The project's folder.
        out: The bundle's folder, new or empty.

    Returns:
        The bundle's folder, absolute.

    Raises:
        KarfError: The project is not learned, a view is unknown, an edit is of another project, or `out` is not empty.

    Example:
        render_bundle("garden_karf", "job", views="cameras.json", edit="edit.json", per_task=20)
    """
    return _answer(FarmOptions, source=project, out=out, **options)


@_takes(FarmOptions, hidden=("source",), listens=False)
def learning_bundle(capture: Capture | PathLike, masks: PathLike, out: PathLike, **options: Any) -> Path:
    """Write a job bundle that learns a capture, a step for every stage, and then renders frames of it.

    Args:
        capture: A capture, or its path, with its photos below its folder.
        masks: A folder of rough masks.
        out: The bundle's folder, new or empty.

    Returns:
        The bundle's folder, absolute.

    Raises:
        KarfError: The capture or the masks cannot be read, a photo is elsewhere, or `out` is not empty.

    Example:
        learning_bundle("garden", "masks", "job", preset="fine")
    """
    return _answer(FarmOptions, source=capture, masks=masks, out=out, **options)


# -------------------------------------------------------------------------------------------------------------- running
def _run(kind: type[Options], **given: Any) -> None:
    """Run a command that learns or renders, with the keywords of its options and of `LISTENERS`."""
    listeners = {name: given.pop(name, None) for name in LISTENERS}
    for name, listener in listeners.items():
        check_type(kind.command, name, listener, Callable | None)
    emit = listeners["emit"] or _emit_to(listeners["progress"])
    with translate_errors(), preserved_torch_state(), stop_on_interrupt(listeners["should_stop"]) as should_stop:
        _carry_out(kind, given, emit, should_stop)


def _answer(kind: type[Options], **given: Any) -> Any:
    """Run a command that takes seconds and return its result."""
    with translate_errors():
        return _carry_out(kind, given, _emit_to(None), lambda: False)


def _carry_out(kind: type[Options], given: dict[str, Any], emit: Emit, should_stop: Callable[[], bool]) -> Any:
    """Run a command, with objects among the keywords converted to what its options take."""
    in_memory = {}
    for name in ("capture", "source"):
        if _is_capture(given.get(name)):
            if issubclass(kind, GeometryOptions):
                in_memory["capture"] = given[name]
            given[name] = given[name].source
    with ExitStack() as until_done:
        for name in {"edit", "edges"} & given.keys():
            folder = until_done.enter_context(tempfile.TemporaryDirectory(prefix="karf-edit-"))
            given[name] = _edit_files(given[name], Path(folder))
        if isinstance(given.get("overrides"), Mapping):
            given["overrides"] = list(_override_texts(given["overrides"]))
        if "device" in given:
            given["device"] = _device_name(given["device"])
        return run_command(kind.of(**given), emit, should_stop, **in_memory)


def _is_capture(value: Any) -> bool:
    if value is None:
        return False
    from .capture.capture import Capture  # needs numpy

    return isinstance(value, Capture)


def _device_name(device: Any) -> Any:
    """Return the name of a `torch.device`; other values as they are."""
    torch = sys.modules.get("torch")
    return str(device) if torch is not None and isinstance(device, torch.device) else device


def _override_texts(settings: Mapping[str, Any], group: str = "") -> Iterator[str]:
    """Yield `geometry.long_side=512` for {"geometry.long_side": 512} or {"geometry": {"long_side": 512}}."""
    for name, value in settings.items():
        if isinstance(value, Mapping):
            yield from _override_texts(value, f"{group}{name}.")
        else:
            yield f"{group}{name}={json.dumps(value, default=_plain)}"


def _plain(value: Any) -> Any:
    """Return a JSON value for a level of the geometry or a number of numpy."""
    if isinstance(value, Level):
        return asdict(value)
    if hasattr(value, "item"):
        return value.item()
    raise TypeError(f"overrides takes texts, numbers and lists, not {value!r:.80}.")


def _edit_files(edit: Any, folder: Path) -> Any:
    """Write an edit, or each of a list, to a file in a folder and return the path; other values as they are."""
    from .palettes.edit_files import write_edit  # needs numpy
    from .palettes.palette import Edit

    if isinstance(edit, list | tuple):
        return [_edit_files(each, folder / str(number)) for number, each in enumerate(edit)]
    if not isinstance(edit, Edit):
        return edit
    path = folder / "edit.json"
    write_edit(path, edit)
    return path


class _Lines:
    """A text stream that passes its lines to a function."""

    def __init__(self, receive: Callable[[str], None]) -> None:
        self._receive = receive

    def isatty(self) -> bool:
        return False

    def write(self, text: str) -> None:
        if text.strip():
            self._receive(text.rstrip("\n"))

    def flush(self) -> None:
        pass


def _emit_to(progress: Callable[[str], None] | None) -> Emit:
    """Return a receiver of events that passes lines to a function, or drops them where there is none."""
    return TerminalEmit(_Lines(progress)) if progress else lambda kind, /, **values: None
