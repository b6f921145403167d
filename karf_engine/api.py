"""The library: one function for each step from a capture to recolored pictures. Importing this needs no torch.

Results are stored in a project, a folder that the command line and Blender open too. Stages finished with the same inputs
are skipped; interrupted ones resume.

Each function takes the options of its command (`commands.options`) as keywords and checks their names, types and ranges
first. Functions that learn or render take these as well:

- `progress`: receives a line of text now and then, for example `print`.
- `emit`: receives the events instead, `emit(kind, **values)`; see `worker.protocol`.
- `should_stop`: polled often; once it returns true, the call saves what is learned so far and raises Cancelled.

Five options also take objects: `capture` the result of `open_capture`, `device` a `torch.device`, `overrides` a dictionary
of settings by their dotted names, and `edit` and `edges` an `Edit`.

Errors are `KarfError`s, for missing, damaged or contradicting inputs and for stages that have to be finished first: the
subclass (see `errors`) names the kind of error, `sentence` what is wrong and `hint` what to do about it. This includes
full disks, missing rights and exhausted memory.

Ctrl-C saves what is learned so far and then raises KeyboardInterrupt; a second one does not wait. Each call restores
torch's number of threads, random state and treatment of denormal numbers.
"""
# functions of commands are declarations without a body
# pyright: reportReturnType=false

from __future__ import annotations

import inspect
import io
import json
import math
import sys
import tempfile
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import MISSING, asdict
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from .commands.dispatch import run_command
from .commands.options import COMMANDS, GeometryOptions
from .compute.progress import Emit, TerminalEmit, stop_on_interrupt
from .errors import missing_package
from .io.arguments import check_type
from .io.failures import translate_errors
from .io.options import Options, fields_in_help_order
from .project.settings import Level

if TYPE_CHECKING:
    import torch

    from .capture.advice import Advice
    from .capture.capture import Capture
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
OBJECTS = {"device": "torch.device", "overrides": "Mapping[str, Any]", "edit": "Edit", "edges": "Edit"}


def _command(
    name: str, *, hidden: Collection[str] = (), source: str = "", listens: bool = True
) -> Callable[[Function], Function]:
    """Make a function that runs a command, with its options as keywords, of a declaration with `**options`.

    The declaration's body, if it has one, runs after the command and makes the result.

    hidden: options that the function does not have. source: the parameter that is the option `source`. listens: whether
    the function takes `LISTENERS` too; others take seconds.
    """
    kind = COMMANDS[name]

    def declared(function: Function) -> Function:
        signature = inspect.signature(function)

        @wraps(function)
        def call(*arguments: Any, **keywords: Any) -> Any:
            given = signature.bind(*arguments, **keywords).arguments
            given |= given.pop("options", {})
            if source:
                given["source"] = given.pop(source)
            if listens:
                _run(kind, given)
                return function(*arguments, **keywords)
            with translate_errors():
                return _carry_out(kind, given, _emit_to(None), lambda: False)

        own = {name: each for name, each in signature.parameters.items() if name != "options"}
        shown = {item.name: item for item in fields_in_help_order(kind) if item.name not in {*hidden, "source"}}
        more = {name: item.default for name, item in shown.items() if name not in own}
        more |= dict.fromkeys(LISTENERS) if listens else {}
        empty, keyword = inspect.Parameter.empty, inspect.Parameter.KEYWORD_ONLY
        keywords = [inspect.Parameter(n, keyword, default=empty if v is MISSING else v) for n, v in more.items()]
        made: Any = call
        made.__signature__ = signature.replace(parameters=[*own.values(), *keywords])
        made.options = kind
        order = sorted(shown, key=lambda name: list(own).index(name) if name in own else len(own))
        lines = [f"    {name}: {shown[name].metadata['help']}." for name in order]
        made.__doc__ = "\n".join([inspect.cleandoc(function.__doc__ or ""), "", "Args:", *lines])
        return made

    return declared


@_command("poses")
def find_poses(photos: PathLike, out: PathLike, **options: Any) -> None:
    """Make a capture of photos without camera poses, or of a video; needs the extra `photos`.

    Example:
        find_poses("photos", "garden")
    """


@_command("import-splat")
def import_splat(splat: PathLike, out: PathLike, **options: Any) -> None:
    """Make a capture of Gaussian splats of another program; needs the extra `fast`, and `splats` for some files.

    The capture is learned, marked and recolored like any other, with its own splats.

    Example:
        import_splat("garden.ply", "garden")
    """


@_command("pinhole")
def convert_panoramas(capture: PathLike, out: PathLike, **options: Any) -> None:
    """Make a capture of ordinary photos of one with 360-degree photos.

    Example:
        convert_panoramas("garden_360", "garden")
    """


@_command("inspect", listens=False)
def inspect_capture(capture: Capture | PathLike, **options: Any) -> Advice:
    """Check photos, cameras and masks before learning, in seconds; needs no torch.

    Returns the expected quality (`psnr`, `is_poor`) in a `sentence`, and what to improve (`findings`); `inspection` has
    the figures.

    Example:
        print(inspect_capture("garden", out="inspected").sentence)
    """


@_command("mark", listens=False)
def mark(capture: Capture | PathLike, view: str, object_name: str, masks: PathLike, **options: Any) -> Path:
    """Write the mask of an object in one photo, from a box, clicks or a lasso. Returns the file.

    Example:
        mark("garden", "r_003", "pot", "masks", box=(120, 80, 310, 260))
    """


@_command("all")
def learn(capture: Capture | PathLike, masks: PathLike, *, project: PathLike, **options: Any) -> Model:
    """Learn everything: geometry, segmentation, palettes and their weights, and splats. Returns the learned model.

    Example:
        model = learn("garden", "masks", project="garden_karf", preset="fast", progress=print)
    """
    return load(project, device=options.get("device"))


@_command("geometry")
def learn_geometry(capture: Capture | PathLike, *, project: PathLike, **options: Any) -> None:
    """Learn the radiance field of a capture, from all marked photos among others.

    Example:
        learn_geometry("garden", project="garden_karf", preset="fine", holdout=8)
    """


@_command("segmentation")
def segment(project: PathLike, masks: PathLike | None = None, **options: Any) -> None:
    """Learn the segmentation field F_s, which part of the scene is which object, after the geometry.

    Example:
        segment("garden_karf", masks="masks")
    """


@_command("palette")
def extract_palettes(project: PathLike, **options: Any) -> None:
    """Extract a palette from the colors of every segmented object.

    Example:
        extract_palettes("garden_karf")
    """


@_command("recoloring")
def learn_recoloring(project: PathLike, **options: Any) -> None:
    """Finish the palettes; with `recoloring.iterations`, train F_w, the palette weights of every point, and adapt them.

    Example:
        learn_recoloring("garden_karf", overrides={"recoloring.iterations": 1000})
    """


@_command("splats")
def learn_splats(project: PathLike, **options: Any) -> None:
    """Learn the scene as Gaussians, which show it sharply from any camera, after the geometry.

    The qualities `good` and `best` learn the marked objects in detail, after the segmentation.

    Example:
        learn_splats("garden_karf", overrides={"splats.iterations": 2000}, quality="good")
    """


@_command("erase", listens=False)
def erase_splats(project: PathLike, boxes: Sequence[Sequence[float]] = (), **options: Any) -> int:
    """Leave out splats whose centers are in boxes, or bring them back. Returns how many are left out now.

    Every later rendering and export is without them. Learning splats anew forgets what was left out; details are learned
    from the draft without it.

    Example:
        erase_splats("garden_karf", boxes=[(0.2, 0, 0, 1.5, 0, 0.2, 0, 0, 0, 0, 0.2, 2.0, 0, 0, 0, 1)])
    """


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
    with translate_errors(), _preserved_torch_state():
        return Model.load(project, name)


@_command("render")
def render(project: PathLike, out: PathLike, **options: Any) -> None:
    """Write frames of many views as files: OUT/render, OUT/masks/<object>, and with an edit OUT/recolor.

    Example:
        render("garden_karf", "frames", views="test", edit="edit.json", depth=True)
    """


@_command("colorways")
def colorways(project: PathLike, sheet: PathLike, out: PathLike, **options: Any) -> None:
    """Write every colorway of a sheet in every view: OUT/<colorway>/<view>, OUT/colorways.csv, OUT/contact_sheet.png.

    For each color the table has the predicted and the measured color, their distance from the target, and the reason
    where the target is missed. Pictures of an earlier call that would be the same are kept.

    Example:
        colorways("garden_karf", "sheet.csv", "colorways", size=1024)
    """


@_command("points")
def write_points(project: PathLike, out: PathLike, **options: Any) -> None:
    """Write the scene as points on its surface, for viewers; a `.npz` can be recolored (`export.scene_points`).

    Example:
        write_points("garden_karf", "garden.ply", count=200_000)
    """


@_command("export-splat")
def export_splat(project: PathLike, out: PathLike, **options: Any) -> None:
    """Write the scene as Gaussian splats for other programs, with an edit baked in; some files need the extra `splats`.

    Example:
        export_splat("garden_karf", "garden_blue.ply", edit="edit.json")
    """


@_command("export-page")
def export_page(project: PathLike, out: PathLike, **options: Any) -> None:
    """Write a web page that shows the scene in its looks, and recolors it in the browser; needs the extra `splats`.

    Example:
        export_page("garden_karf", "page", looks=["mint.json", "rust.json"], title="Garden")
    """


@_command("farm", hidden=("masks", "preset", "holdout"), source="project", listens=False)
def render_bundle(project: PathLike, out: PathLike, **options: Any) -> Path:
    """Write a job bundle that renders frames of a learned project on a render farm. Returns its absolute folder.

    Example:
        render_bundle("garden_karf", "job", views="cameras.json", edit="edit.json", per_task=20)
    """


@_command("farm", source="capture", listens=False)
def learning_bundle(capture: Capture | PathLike, masks: PathLike, out: PathLike, **options: Any) -> Path:
    """Write a job bundle that learns a capture, a step for every stage, and renders frames. Returns its absolute folder.

    The capture's photos must be in its folder.

    Example:
        learning_bundle("garden", "masks", "job", preset="fine")
    """


@contextmanager
def _preserved_torch_state() -> Iterator[None]:
    """Restore torch's number of threads, random state and treatment of denormal numbers after the block."""
    try:
        import torch
    except ModuleNotFoundError:  # the block says what is missing
        yield
        return
    threads, random_state = torch.get_num_threads(), torch.get_rng_state()
    flushes_denormals = math.ulp(0.0) * 1.0 == 0.0
    try:
        yield
    finally:
        torch.set_num_threads(threads)
        torch.set_rng_state(random_state)
        torch.set_flush_denormal(flushes_denormals)


def _run(kind: type[Options], given: dict[str, Any]) -> None:
    """Run a command that learns or renders, with the keywords of its options and of `LISTENERS`."""
    listeners = {name: given.pop(name, None) for name in LISTENERS}
    for name, listener in listeners.items():
        check_type(kind.command, name, listener, Callable | None)
    emit = listeners["emit"] or _emit_to(listeners["progress"])
    with translate_errors(), _preserved_torch_state(), stop_on_interrupt(listeners["should_stop"]) as should_stop:
        _carry_out(kind, given, emit, should_stop)


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
    from .palettes.palette import Edit, write_edit  # needs numpy

    if isinstance(edit, list | tuple):
        return [_edit_files(each, folder / str(number)) for number, each in enumerate(edit)]
    if not isinstance(edit, Edit):
        return edit
    path = folder / "edit.json"
    write_edit(path, edit)
    return path


class _Lines(io.TextIOBase):
    """A text stream that passes its lines to a function."""

    def __init__(self, receive: Callable[[str], None]) -> None:
        self._receive = receive

    def write(self, text: str) -> int:
        if text.strip():
            self._receive(text.rstrip("\n"))
        return len(text)


def _emit_to(progress: Callable[[str], None] | None) -> Emit:
    """Return a receiver of events that passes lines to a function, or drops them where there is none."""
    return TerminalEmit(_Lines(progress)) if progress else lambda kind, /, **values: None
