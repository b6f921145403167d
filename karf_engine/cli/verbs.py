"""The verbs of the command line: their parser, and functions that take the parsed arguments and return the exit code.

Packages beyond the standard library are imported where they are needed: `doctor` must run without them.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import signal
import sys
import threading
import typing
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from ..commands.dispatch import run_command
from ..commands.options import COMMANDS
from ..compute.progress import TerminalEmit, stop_on_interrupt
from ..errors import BadRequest
from ..io.arguments import annotations_of, union_members, unknown_name_error
from ..io.failures import log
from ..io.files import read_json
from ..io.options import Options, fields_in_help_order, flag_of
from ..project import Project
from ..project.settings import describe
from ..version import __version__
from ..worker.loop import Worker
from ..worker.path_map import PathMap

Subparsers = argparse._SubParsersAction


def options_of(arguments: argparse.Namespace) -> Options:
    """Return a command's options from its parsed command line. Raises BadRequest where one is out of range."""
    given = {item.name: getattr(arguments, item.name, None) for item in dataclasses.fields(arguments.kind)}
    return arguments.kind.of(**{name: value for name, value in given.items() if value is not None})


def run_command_line(arguments: argparse.Namespace) -> int:
    """Run a command in this process, with its events on the terminal."""
    with stop_on_interrupt() as should_stop:
        run_command(options_of(arguments), TerminalEmit(), should_stop)
    return 0


def segment(arguments: argparse.Namespace) -> int:
    """Segment the objects, or with --suggest print the views to mark next."""
    if not arguments.suggest:
        return run_command_line(arguments)
    from ..segmentation.report import SegmentationReport

    project = Project(arguments.project)
    project.require("segmentation")
    report = SegmentationReport.read(project.segmentation_report)
    for name, score in report.suggestions.scores.items():
        print(f"{score:.4f}  {name}")
    if report.suggestions.any_view_helps:
        print("Any view helps about as much.")
    print("\n".join(each.sentence(name) for name, each in report.unsure.items()))
    return 0


def extract_palettes(arguments: argparse.Namespace) -> int:
    """Extract palettes, or print or export those of an earlier run."""
    project = Project(arguments.project)
    if arguments.json:
        project.require("palette")
        print(json.dumps(read_json(project.palette_file, "palettes"), indent=1))
        return 0
    if not arguments.out and not arguments.edit:
        return run_command_line(arguments)
    if not arguments.out:
        raise BadRequest("The palette verb was given an edit and no file to write.", "Add --out FILE.")
    from ..palettes.project_edit import edit_of

    edit_of(project, arguments.edit).save(project.check_inside(arguments.out))
    return 0


def mark(arguments: argparse.Namespace) -> int:
    print(_result_of(arguments))
    return 0


def inspect(arguments: argparse.Namespace) -> int:
    advice = _result_of(arguments)
    print("\n".join([advice.sentence, *advice.findings]))
    return 0


def write_bundle(arguments: argparse.Namespace) -> int:
    log(f"wrote {_result_of(arguments)}")
    return 0


def _result_of(arguments: argparse.Namespace) -> Any:
    """Run a command that takes seconds, print the texts of its stages and return its result."""

    def emit(kind: str, /, **values: Any) -> None:
        if kind == "stage":
            log(values["text"])

    return run_command(options_of(arguments), emit, lambda: False)


def list_settings(_: argparse.Namespace) -> int:
    for name, default, text in describe():
        print(f"{name:34} {default!s:12.60}  {text}")
    return 0


def doctor(options: argparse.Namespace) -> int:
    """Check whether this Python can run the engine; return the exit code of the verdict."""
    from .doctor import examine

    is_ended = threading.Event()

    def end(*_):
        is_ended.set()
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, end)  # so that temporary folders are removed
    code = 0
    with closing(examine(options.folder, options.quick, options.device, options.threads)) as findings:
        for finding in findings:
            if is_ended.is_set():  # Python drops exceptions that a weak reference's callback raises
                raise KeyboardInterrupt
            print(finding.to_line() if options.json else finding.to_text(), flush=True)
            code = finding.exit_code
    return code


def speed(options: argparse.Namespace) -> int:
    from .smoke import samples_per_second

    print(json.dumps({"samples_per_second": round(samples_per_second(options.device, options.threads))}))
    return 0


def run(options: argparse.Namespace) -> int:
    return Worker(PathMap.of(options.folders), options.wait).serve(Path(options.job), sys.stdin)


ACTIONS = {"inspect": inspect, "mark": mark, "segmentation": segment, "palette": extract_palettes, "farm": write_bundle}


def make_parser() -> argparse.ArgumentParser:
    """Return the parser; parsed arguments have the verb's function as `action`."""
    parser = argparse.ArgumentParser(
        prog="karf_engine",
        description="KaRF: segment objects in a captured scene from coarse masks and recolor them by palettes.",
        epilog="Exit codes: 0 done, 2 bad request, 3 missing dependency, 4 bad data, 5 out of memory, 6 cancelled, "
        "7 diverged, 70 internal error, 141 nobody reads the output any more.",
    )
    parser.add_argument("--version", action="version", version=f"karf_engine {__version__}")
    commands = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    added = {kind.command: _add_command(commands, kind) for kind in COMMANDS.values()}
    _add_clicks(added["mark"])
    _add_views_of_results(added)
    _add_others(commands)
    return parser


def check_known(arguments: argparse.Namespace, others: Sequence[str]) -> None:
    """Raise BadRequest for arguments that the verb does not know."""
    if others:
        known = [flag for item in fields_in_help_order(getattr(arguments, "kind", Options)) if (flag := flag_of(item))]
        raise unknown_name_error("option", others[0], known)


def _add_command(commands: Subparsers, kind: type[Options]) -> argparse.ArgumentParser:
    text = (kind.__doc__ or "").partition(".")[0]
    verb = commands.add_parser(kind.command, help=text[0].lower() + text[1:], description=kind.__doc__)
    verb.set_defaults(action=ACTIONS.get(kind.command, run_command_line), kind=kind)
    for item in fields_in_help_order(kind):
        if item.metadata["flag"] is not None:
            _add_argument(verb, item, annotations_of(kind)[item.name])
    return verb


def _add_argument(verb: argparse.ArgumentParser, item: dataclasses.Field, kind: Any) -> None:
    facts: dict[str, Any] = {"help": _help(item)}
    if item.metadata["metavar"]:
        facts["metavar"] = item.metadata["metavar"]
    if item.metadata["choices"]:
        facts["choices"] = item.metadata["choices"]
    if item.metadata["positional"]:
        verb.add_argument(item.name, **facts)
        return
    facts |= {"dest": item.name, "default": None, "required": item.default is dataclasses.MISSING}
    part = union_members(kind)[0]
    if part is bool:
        facts["action"] = "store_true"
    elif part is int:
        facts["type"] = int
    elif typing.get_origin(part) is tuple:
        facts |= _tuple_facts(typing.get_args(part))
    flag = flag_of(item)
    assert flag is not None
    verb.add_argument(flag, **facts)


def _tuple_facts(parts: tuple[Any, ...]) -> dict[str, Any]:
    """Return the arguments of `add_argument` for a tuple: comma-separated numbers, a repeatable option, or both."""
    if parts[-1] is not Ellipsis:
        return {"type": _numbers(len(parts))}
    items = typing.get_args(parts[0])
    if float in items:
        return {"action": "append", "type": _numbers(len(items))}
    return {"action": "append"} | ({"nargs": len(items)} if items else {})


def _help(item: dataclasses.Field) -> str:
    text, default = item.metadata["help"].replace("%", "%%"), item.default
    has_none = "default" in text or default in (dataclasses.MISSING, None, False, ())
    return text if has_none else f"{text} (default: {default})"


def _add_clicks(verb: argparse.ArgumentParser) -> None:
    """Add --click and --not, which share a list that keeps their order."""
    for flag, is_object, text in (("--click", True, "that shows it"), ("--not", False, "that does not")):
        verb.add_argument(flag, dest="points", action="append", metavar="X,Y", type=_click(is_object),
                          help=f"a pixel {text}; may be repeated")  # fmt: skip


def _click(is_object: bool) -> Callable[[str], tuple[float, float, bool]]:
    def read(text: str) -> tuple[float, float, bool]:
        x, y = _numbers(2)(text)
        return x, y, is_object

    read.__name__ = "list of 2 numbers"
    return read


def _add_views_of_results(added: dict[str, argparse.ArgumentParser]) -> None:
    """Add flags that only show results of an earlier run."""
    added["segmentation"].add_argument(
        "--suggest",
        action="store_true",
        help="print the views to mark next, with their scores, the best first, whether any view helps about as much, "
        "and how unsure each object is; nothing is computed",
    )
    verb = added["palette"]
    verb.add_argument("--json", action="store_true", help="print the palettes as JSON; nothing is computed")
    verb.add_argument(
        "--out", metavar="FILE", help="write their colors as .gpl, .ase or EDIT.json; nothing is computed"
    )
    verb.add_argument("--edit", metavar="FILE", help="of --out: the colors that an edit or a palette file gives them")


def _add_others(commands: Subparsers) -> None:
    _add_verb(commands, "settings", "list all settings with defaults and ranges", list_settings)
    verb = _add_verb(commands, "doctor", "say whether this Python can run the engine, and what to do if not", doctor)
    _add_machine(verb)
    verb.add_argument("--json", action="store_true", help="print each finding as a line of JSON, as it is found")
    verb.add_argument("--quick", action="store_true", help="do not try the stages, which takes some seconds")
    verb.add_argument("--folder", metavar="DIR", default=".", type=Path, help="where projects shall lie: its disk and its "
                      "locks are tried (default: here)")  # fmt: skip
    _add_machine(_add_verb(commands, "speed", "measure how fast this computer learns, in some seconds", speed))
    verb = _add_verb(commands, "run", "run a job folder (used by Blender)", run)
    verb.add_argument("job", metavar="JOB", help="folder with request.json", type=Path)
    verb.add_argument("--map", dest="folders", action="append", default=[], metavar="CALLERS=OURS", help="a folder that "
                      "the caller knows by another path; may be repeated")  # fmt: skip
    verb.add_argument("--wait", type=float, default=0, metavar="SECONDS", help="after a job that is done, wait this long "
                      "for the folder of a next one, as a line of JSON on standard input")  # fmt: skip


def _add_verb(commands: Subparsers, name: str, text: str, action: Callable) -> argparse.ArgumentParser:
    verb = commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
    verb.set_defaults(action=action)
    return verb


def _add_machine(verb: argparse.ArgumentParser) -> None:
    for item in dataclasses.fields(Options):
        _add_argument(verb, item, annotations_of(Options)[item.name])


def _numbers(count: int) -> Callable[[str], tuple[float, ...]]:
    """Return a parser of this many comma-separated numbers."""

    def read(text: str) -> tuple[float, ...]:
        numbers = tuple(map(float, text.split(",")))
        if len(numbers) != count:
            raise ValueError(text)
        return numbers

    read.__name__ = f"list of {count} numbers"  # for argparse's error message
    return read
