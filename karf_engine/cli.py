"""The command line: one verb a function of the library, and `run` for a job folder (see wire)."""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import threading
import traceback
from collections.abc import Callable, Sequence
from importlib import metadata
from pathlib import Path

from . import library
from .errors import BadRequest, Cancelled, DataError, KarfError, MissingDependency
from .failures import known_failure
from .files import read_json
from .progress import Emit, TerminalEmit
from .project import STAGE_ORDER, Project
from .project.edit import edit_of
from .settings import PRESETS, describe
from .stages.dispatch import run_request
from .version import __version__
from .wire import PROTOCOL, EventWriter, Request


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the process exit code."""
    options = _parser().parse_args(arguments)
    try:
        return options.action(options)
    except KeyboardInterrupt:
        _say("\ncancelled; what was finished is kept.")
        return Cancelled.exit_code
    except Exception as raised:
        error = _as_karf_error(raised)
        _say_error(error)
        return error.exit_code


def _as_karf_error(error: Exception) -> KarfError:
    """The error as the user gets it; of an internal one the trace is printed too."""
    if (known := known_failure(error)) is not None:
        return known
    _say("".join(traceback.format_exception(error)).rstrip())
    return KarfError(f"Internal error: {error!r}.", "Report it with its trace (of a job: in engine.log).")


def _say_error(error: KarfError) -> None:
    _say(f"error: {error.sentence}\n       {error.hint}".rstrip())


def _say(text: str) -> None:
    """Print to standard error; where that is a log on a full disk, the exit code must do."""
    try:
        print(text, file=sys.stderr, flush=True)
    except OSError:
        # else the interpreter would try again at its end, and change the exit code
        sys.stderr = Path(os.devnull).open("w", encoding="utf-8")


# ---------------------------------------------------------------------------------------------------------------- verbs
def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="karf_engine",
        description="KaRF: segment objects in a captured scene from coarse masks and recolor them by palettes.",
        epilog="Exit codes: 0 done, 2 bad request, 3 missing dependency, 4 bad data, 5 out of memory, 6 cancelled, "
        "7 diverged, 70 internal error.",
    )
    parser.add_argument("--version", action="version", version=f"karf_engine {__version__}")
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB")

    verb = _verb(verbs, "poses", "make a capture of photos without camera poses, or of a video", _find_poses)
    verb.add_argument("photos", metavar="PHOTOS", help="folder of photos, or a video file")
    verb.add_argument("--out", required=True, metavar="DIR", help="the new capture's folder")
    verb.add_argument("--matching", default="auto", choices=("auto", "exhaustive", "sequential"), help="which pairs of "
                      "photos are compared: all, or neighbors by name (default: all of up to 250)")  # fmt: skip

    verb = _verb(verbs, "all", "learn everything: geometry, segmentation, palette, recoloring", _learn_all)
    _add_geometry_options(verb)
    verb.add_argument("--masks", required=True, metavar="DIR", help="coarse masks: DIR/<object>/<photo stem>.png")
    verb.add_argument("--project", required=True, metavar="DIR", help="project folder, made if needed")

    verb = _verb(verbs, "geometry", "learn the scene from photos with poses", _learn_geometry)
    _add_geometry_options(verb)
    verb.add_argument("--project", required=True, metavar="DIR", help="project folder, made if needed")

    verb = _verb(verbs, "segmentation", "turn coarse masks into objects in all views", _segment)
    verb.add_argument("project", metavar="DIR", help="project folder")
    verb.add_argument("--masks", required=True, metavar="DIR", help="coarse masks: DIR/<object>/<photo stem>.png")

    verb = _verb(
        verbs, "palette", "extract palettes; with --json or --out only show the learned ones", _extract_palettes
    )
    verb.add_argument("project", metavar="DIR", help="project folder")
    verb.add_argument("--json", action="store_true", help="print the palettes as JSON; nothing is computed")
    verb.add_argument(
        "--out", metavar="FILE", help="write their colors as .gpl, .ase or EDIT.json; nothing is computed"
    )
    verb.add_argument("--edit", metavar="FILE", help="of --out: the colors that an edit or a palette file gives them")

    verb = _verb(verbs, "recoloring", "learn palette weights", _learn_recoloring)
    verb.add_argument("project", metavar="DIR", help="project folder")

    verb = _verb(verbs, "match", "write the edit with which one color of an object becomes another", _match)
    verb.add_argument("project", metavar="DIR", help="project folder")
    verb.add_argument("--object", required=True, help="which object")
    verb.add_argument("--from", dest="source", required=True, metavar="COLOR", help="a color it shows, #rrggbb")
    verb.add_argument("--to", dest="target", required=True, metavar="COLOR", help="the color it shall become, #rrggbb")
    verb.add_argument("--rule", default="becomes", choices=("becomes", "fewest"), help="becomes: the whole material; "
                      "fewest: as few swatches as possible (default: %(default)s)")  # fmt: skip
    verb.add_argument("--edit", metavar="FILE", help="start from this edit (one call an object)")
    verb.add_argument("--out", required=True, metavar="FILE", help="EDIT.json to write")

    verb = _verb(verbs, "render", "render masks, pictures and recolored frames", _render)
    verb.add_argument("project", metavar="DIR", help="project folder")
    verb.add_argument(
        "--views", default="test", help="train, test, val, all, names with commas, or CAMERAS.json (transforms.json "
        "with sizes) (default: %(default)s)",
    )  # fmt: skip
    verb.add_argument("--edit", metavar="FILE", help="EDIT.json, or a palette file: write recolored frames too")
    verb.add_argument("--out", required=True, metavar="DIR", help="folder for render/, masks/, recolor/")
    verb.add_argument("--base", choices=("photo", "render"), help="what an edit of a captured view changes (default: "
                      "photo; with the preset paper: render)")  # fmt: skip
    verb.add_argument("--depth", action="store_true", help="write depth/ too")
    verb.add_argument("--planes", action="store_true", help="write planes/ too (what Blender recolors from)")
    verb.add_argument("--layers", action="store_true", help="write layers/ too (OpenEXR for compositors)")
    verb.add_argument("--skip-existing", action="store_true", help="keep frames that are there already, made from the "
                      "same: goes on where a job was stopped")  # fmt: skip

    verb = _verb(verbs, "colorways", "render every colorway of a sheet in every view", _render_colorways)
    verb.add_argument("project", metavar="DIR", help="project folder")
    verb.add_argument("--sheet", required=True, metavar="FILE", help="CSV or JSON: colorway, object, and a color as hex, "
                      "lab, srgb or srgb8")  # fmt: skip
    verb.add_argument("--views", default="all", help="as for render (default: %(default)s)")
    verb.add_argument("--out", required=True, metavar="DIR", help="folder for <colorway>/, colorways.csv and the contact "
                      "sheet; pictures that are there already are not made again")  # fmt: skip
    verb.add_argument("--predict-only", action="store_true", help="only write colorways.csv: what will be reached")

    verb = verbs.add_parser("settings", help="list all settings with defaults and ranges")
    verb.set_defaults(action=_list_settings)
    verb = verbs.add_parser("doctor", help="say whether this Python can run the engine")
    verb.set_defaults(action=_doctor)
    verb = verbs.add_parser("run", help="run a job folder (used by Blender)")
    verb.add_argument("job", metavar="JOB", help="folder with request.json")
    verb.set_defaults(action=lambda options: run_job(Path(options.job)))
    return parser


def _verb(verbs, name: str, text: str, action: Callable) -> argparse.ArgumentParser:
    verb = verbs.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
    verb.set_defaults(action=action)
    verb.add_argument("--threads", type=int, help="processor threads (default: all cores, at most 4)")
    verb.add_argument("--device", help="cpu, cuda or cuda:NUMBER (default: cuda where there is one)")
    return verb


def _add_geometry_options(verb: argparse.ArgumentParser) -> None:
    verb.add_argument("capture", metavar="CAPTURE", help="folder or transforms.json with photos and camera poses")
    verb.add_argument("--preset", default="demo", choices=tuple(PRESETS), help="quality against time (default: demo)")
    verb.add_argument(
        "--set", dest="overrides", action="append", default=[], metavar="STAGE.FIELD=VALUE",
        help="change one setting (see the settings verb); may be repeated",
    )  # fmt: skip
    verb.add_argument("--nerf", metavar="FILE", help="import a NeRF that another program has trained on this capture: "
                      "nerf-pytorch .tar, krrish94 .ckpt")  # fmt: skip


def _learn_all(options: argparse.Namespace) -> int:
    _learn_geometry(options)
    _segment(options)
    library.extract_palettes(options.project, **_run_of(options))
    library.learn_recoloring(options.project, **_run_of(options))
    return 0


def _learn_geometry(options: argparse.Namespace) -> int:
    library.learn_geometry(
        options.capture,
        project=options.project,
        preset=options.preset,
        overrides=options.overrides,
        nerf=options.nerf,
        **_run_of(options),
    )
    return 0


def _segment(options: argparse.Namespace) -> int:
    library.segment(options.project, options.masks, **_run_of(options))
    return 0


def _extract_palettes(options: argparse.Namespace) -> int:
    if options.json:
        project = Project(options.project)
        project.require("palette")
        print(json.dumps(read_json(project.palette_file, "palettes"), indent=1))
        return 0
    if options.out or options.edit:
        if not options.out:
            raise BadRequest("The palette verb was given an edit and no file to write.", "Add --out FILE.")
        edit_of(Project(options.project), options.edit).save(options.out)
        return 0
    library.extract_palettes(options.project, **_run_of(options))
    return 0


def _learn_recoloring(options: argparse.Namespace) -> int:
    library.learn_recoloring(options.project, **_run_of(options))
    return 0


def _find_poses(options: argparse.Namespace) -> int:
    library.find_poses(options.photos, options.out, matching=options.matching, **_run_of(options))
    return 0


def _match(options: argparse.Namespace) -> int:
    values = {name: getattr(options, name) for name in ("object", "source", "target", "rule", "edit", "out")}
    run_request(Request("match", Path(options.project), values), TerminalEmit(), lambda: False)
    return 0


def _render(options: argparse.Namespace) -> int:
    names = ("views", "edit", "base", "depth", "planes", "layers", "skip_existing")
    chosen = {name: getattr(options, name) for name in names}
    library.render(options.project, options.out, **chosen, **_run_of(options))
    return 0


def _render_colorways(options: argparse.Namespace) -> int:
    chosen = {"views": options.views, "predict_only": options.predict_only}
    library.colorways(options.project, options.sheet, options.out, **chosen, **_run_of(options))
    return 0


def _run_of(options: argparse.Namespace) -> library.Run:
    """How the command line runs a stage: events go to the terminal."""
    return {"threads": options.threads, "device": options.device, "emit": TerminalEmit()}


def _list_settings(_: argparse.Namespace) -> int:
    for name, default, text in describe():
        print(f"{name:34} {default!s:12.60}  {text}")
    return 0


def _doctor(_: argparse.Namespace) -> int:
    from .doctor import examine

    report = examine()
    print(json.dumps(report, indent=1))
    return 0 if report["ok"] else MissingDependency.exit_code


# ------------------------------------------------------------------------------------------------------------ child job
def run_job(job: Path) -> int:
    """Run a job folder as a child process: events to its file, cancel by standard input; returns the exit code.

    Raises DataError where there is no such folder.
    """
    if not job.is_dir():
        raise DataError(f"{job} is no job folder.", "Give the folder that holds request.json.")
    emit = EventWriter(job)
    cancelled = threading.Event()
    threading.Thread(target=_watch_input, args=(cancelled,), daemon=True).start()
    try:
        emit("hello", protocol=PROTOCOL, engine=__version__, python=platform.python_version(), torch=_version("torch"),
             pid=os.getpid())  # fmt: skip
        request = Request.read(job)
        run_request(request, emit, cancelled.is_set)
        emit("done", summary=_summary(request))
    except Exception as raised:
        error = _as_karf_error(raised)
        _tell_end(emit, error)
        return error.exit_code
    return 0


def _tell_end(emit: Emit, error: KarfError) -> None:
    """The job's last event; on standard error where the events cannot be written."""
    try:
        if error.code == "cancelled":
            emit("cancelled", sentence=error.sentence)
        else:
            emit("error", code=error.code, sentence=error.sentence, hint=error.hint)
    except OSError:
        _say_error(error)


def _version(package: str) -> str | None:
    """Version of an installed package without importing it, or None."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _summary(request: Request) -> dict:
    """What the project notes of the stages that the request ran."""
    project = Project(request.project)
    if not project.state_file.exists():  # poses need no project
        return {}
    return {stage: facts for stage in STAGE_ORDER if (facts := project.finished(stage))}


def _watch_input(cancelled: threading.Event) -> None:
    """The line `cancel`, or the end of input (the caller is gone), asks the job to stop."""
    for line in sys.stdin:
        if line.strip() == "cancel":
            break
    cancelled.set()
