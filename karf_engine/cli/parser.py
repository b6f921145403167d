"""Build the command line's parser: a verb for each command, with its options' fields as arguments."""

from __future__ import annotations

import argparse
import dataclasses
import typing
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ..commands.options import COMMANDS
from ..io.arguments import annotations_of, union_members, unknown_name_error
from ..io.options import Options, fields_in_help_order, flag_of
from ..version import __version__
from . import verbs

Subparsers = argparse._SubParsersAction


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
    verb.set_defaults(action=verbs.ACTIONS.get(kind.command, verbs.run_command_line), kind=kind)
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
    """Return the arguments of `add_argument` for a tuple: comma-separated numbers, or a repeatable option."""
    if parts[-1] is not Ellipsis:
        return {"type": _numbers(len(parts))}
    pairs = len(typing.get_args(parts[0]))
    return {"action": "append"} | ({"nargs": pairs} if pairs else {})


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
    _add_verb(commands, "settings", "list all settings with defaults and ranges", verbs.list_settings)
    verb = _add_verb(
        commands, "doctor", "say whether this Python can run the engine, and what to do if not", verbs.doctor
    )
    _add_machine(verb)
    verb.add_argument("--json", action="store_true", help="print each finding as a line of JSON, as it is found")
    verb.add_argument("--quick", action="store_true", help="do not try the stages, which takes some seconds")
    verb.add_argument("--folder", metavar="DIR", default=".", type=Path, help="where projects shall lie: its disk and its "
                      "locks are tried (default: here)")  # fmt: skip
    _add_machine(_add_verb(commands, "speed", "measure how fast this computer learns, in some seconds", verbs.speed))
    verb = _add_verb(commands, "run", "run a job folder (used by Blender)", verbs.run)
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
