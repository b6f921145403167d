"""Write docs/command_line.md, the reference of all commands, from their options: python -m tools.reference [--check]."""

from __future__ import annotations

import sys
import typing
from collections.abc import Iterator
from dataclasses import MISSING, Field
from pathlib import Path
from typing import Any

from karf_engine.commands.options import COMMANDS
from karf_engine.io.options import Options, alternatives, flag_of, listed, types_of
from karf_engine.project.settings import describe

PAGE = Path(__file__).resolve().parents[1] / "docs" / "command_line.md"
HEAD = """# Commands and their options

<!-- written by `python -m tools.reference` from karf_engine/commands/options/; change it there -->

Every command has one frozen dataclass of options, from which the command line (`karf VERB`, or `python karf_engine
VERB` in a checkout), a job's `request.json` and the library's functions take their names, types, ranges and defaults.
What is misspelled is refused, with the nearest name. The `run` verb takes job folders ([files](files.md)); `doctor`,
`speed` and `settings` say what this computer can do and what can be set.

Exit codes: 0 done, 2 bad request, 3 missing dependency, 4 bad data, 5 out of memory, 6 cancelled, 7 diverged,
70 internal error.
"""
NAMES = {str: "text", int: "whole number", float: "number", bool: "yes or no", Path: "path"}


def page() -> str:
    """The whole page."""
    parts = [HEAD, *(_section(kind) for kind in COMMANDS.values()), _common(), _settings()]
    return "\n".join(parts)


def _section(kind: type[Options]) -> str:
    own = [item for item in listed(kind) if item.name not in Options.__dataclass_fields__]
    head = f"## {kind.command}\n{kind.__doc__}\n"
    return "\n".join([head, "| command line | job, library | type | default | what |", "| --- | --- | --- | --- | --- |",
                      *(_row(kind, item) for item in own), ""])  # fmt: skip


def _common() -> str:
    rows = [_row(Options, item) for item in listed(Options)]
    head = "## Options of every command\n\n| command line | job, library | type | default | what |"
    return "\n".join([head, "| --- | --- | --- | --- | --- |", *rows, ""])


def _settings() -> str:
    rows = [f"| `{name}` | {_cell(str(default))} | {_cell(text)} |" for name, default, text in describe()]
    head = "## Settings\n`--set STAGE.FIELD=VALUE`, or `overrides` in jobs and the library; the defaults are those of `demo`.\n"
    return "\n".join([head, "| setting | default | what |", "| --- | --- | --- |", *rows, ""])


def _row(kind: type[Options], item: Field) -> str:
    flag = f"`{item.metadata['metavar']}`" if item.metadata["positional"] else _flag(item)
    default = "required" if item.default is MISSING else _default(item.default)
    kinds = _type(types_of(kind)[item.name], item)
    return f"| {flag} | `{item.name}` | {_cell(kinds)} | {default} | {_cell(item.metadata['help'])} |"


def _flag(item: Field) -> str:
    flag = flag_of(item)
    return "`--click`, `--not`" if item.name == "points" else "" if flag is None else f"`{flag}`"


def _default(value: Any) -> str:
    return "" if value in (None, (), False) else f"`{value}`"


def _type(kind: Any, item: Field) -> str:
    if item.metadata["choices"]:
        return ", ".join(item.metadata["choices"])
    low, high = item.metadata["minimum"], item.metadata["maximum"]
    span = "" if low is None else f", {low} to {high}" if high is not None else f", from {low}"
    return " or ".join(_names(kind)) + span


def _names(kind: Any) -> Iterator[str]:
    for part in alternatives(kind):
        if typing.get_origin(part) is not tuple:
            yield NAMES[part]
            continue
        inner = [next(_names(each)) for each in typing.get_args(part) if each is not Ellipsis]
        yield f"list of {inner[0]}" if Ellipsis in typing.get_args(part) else f"({', '.join(inner)})"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;")


def main() -> int:
    """Write the page, or with --check say whether it is up to date."""
    if "--check" in sys.argv:
        return int(PAGE.read_text(encoding="utf-8") != page())
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE)
    return 0


if __name__ == "__main__":
    sys.exit(main())
