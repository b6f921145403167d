"""Write the reference of commands and of the library from the code itself: python -m tools.reference [--check].

docs/command_line.md comes from the options of the commands, docs/library.md from the docstrings of the public names, and
karf_engine/api.pyi, the signatures for type checkers and editors, from both.
"""

from __future__ import annotations

import inspect
import json
import sys
import typing
from collections.abc import Iterator
from dataclasses import MISSING, Field, is_dataclass
from pathlib import Path
from typing import Any

import karf_engine
from karf_engine import api
from karf_engine.commands.options import COMMANDS
from karf_engine.io.arguments import annotations_of, union_members
from karf_engine.io.options import Options, fields_in_help_order, flag_of
from karf_engine.project.settings import describe

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
HEAD = """# Commands and their options

<!-- written by `python -m tools.reference` from karf_engine/commands/options.py; change it there -->

Every command has one frozen dataclass of options, from which the command line (`karf VERB`, or `python karf_engine
VERB` in a checkout), a job's `request.json` and the library's functions take their names, types, ranges and defaults.
What is misspelled is refused, with the nearest name. The `run` verb takes job folders ([files](files.md)); `doctor`,
`speed` and `settings` say what this computer can do and what can be set.

Exit codes: 0 done, 2 bad request, 3 missing dependency, 4 bad data, 5 out of memory, 6 cancelled, 7 diverged,
70 internal error.
"""
LIBRARY = """# The library

<!-- written by `python -m tools.reference` from the docstrings of karf_engine's public names; change it there -->

`pip install .`, then `import karf_engine as karf`. These names are what the library promises; importing them needs no
torch until something is learned or rendered. Shapes, axes and units: [conventions](conventions.md). Fields, heads, layers
and formats of your own: [extending](extending.md). Every module is described [in the API pages](index.md).
"""
STUB = '''"""The signatures of the library's functions, with every keyword.

Written by `python -m tools.reference` from karf_engine/api.py and karf_engine/commands/options.py; change it there.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import torch

from .capture.advice import Advice
from .capture.capture import Capture
from .compute.progress import Emit
from .palettes.palette import Edit
from .recolor.model import Model

PathLike = Path | str

'''
TITLES = {
    "api": "Functions",
    "capture": "Captures",
    "errors": "Errors",
    "palettes.palette": "Edits and palettes",
    "palettes.color_books": "Color books",
    "project.settings": "Settings",
    "recolor.frames": "What is learned and rendered",
}
NAMES = {str: "text", int: "whole number", float: "number", bool: "yes or no", Path: "path"}


def library() -> str:
    """docs/library.md."""
    parts = [LIBRARY]
    for module, names in karf_engine._DEFINES.items():
        parts += [f"## {TITLES[module]}\n"] if module in TITLES else []
        parts += [f"{inspect.getdoc(api)}\n"] if module == "api" else []
        parts += [_name(name) for name in names]
    return "\n".join(parts)


def _name(name: str) -> str:
    thing = getattr(karf_engine, name)
    if name == "PRESETS":
        return f"### PRESETS\nThe presets' settings by name: {', '.join(thing)}. See [settings](command_line.md#settings).\n"
    methods = [each for each in vars(thing) if not each.startswith("_")] if inspect.isclass(thing) else []
    found = [(f"{name}.{each}", getattr(thing, each)) for each in methods]
    parts = [_entry(f"### {name}", name, thing)]
    parts += [_entry(f"#### {full}", full, each) for full, each in found if callable(each) and each.__doc__]
    return "\n".join(parts)


def _entry(heading: str, name: str, thing: Any) -> str:
    return f"{heading}\n```python\n{name}{_signature(thing)}\n```\n```text\n{inspect.getdoc(thing)}\n```\n"


def _signature(thing: Any) -> str:
    """A call's parameters with their defaults, without types, a line for each where there are many."""
    parameters = inspect.signature(thing).parameters.values()
    parts = [_parameter(each) for each in parameters]
    keywords = [n for n, each in enumerate(parameters) if each.kind is each.KEYWORD_ONLY]
    if keywords:
        parts.insert(keywords[0], "*")
    joined = ", ".join(parts)
    return f"({joined})" if len(joined) < 90 else "(\n    " + ",\n    ".join(parts) + ",\n)"


def _parameter(parameter: inspect.Parameter) -> str:
    """One of them, as `ruff format` writes it; of settings that are the default only the class."""
    default = parameter.default
    if default is parameter.empty:
        return str(parameter.replace(annotation=parameter.empty))
    text = (
        f"{type(default).__name__}()"
        if is_dataclass(default)
        else json.dumps(default)
        if isinstance(default, str)
        else default
    )
    return f"{parameter.name}={text}"


def command_line() -> str:
    """docs/command_line.md."""
    parts = [HEAD, *(_section(kind) for kind in COMMANDS.values()), _common(), _settings()]
    return "\n".join(parts)


def _section(kind: type[Options]) -> str:
    own = [item for item in fields_in_help_order(kind) if item.name not in Options.__dataclass_fields__]
    head = f"## {kind.command}\n{kind.__doc__}\n"
    return "\n".join([head, "| command line | job, library | type | default | what |", "| --- | --- | --- | --- | --- |",
                      *(_row(kind, item) for item in own), ""])  # fmt: skip


def _common() -> str:
    rows = [_row(Options, item) for item in fields_in_help_order(Options)]
    head = "## Options of every command\n\n| command line | job, library | type | default | what |"
    return "\n".join([head, "| --- | --- | --- | --- | --- |", *rows, ""])


def _settings() -> str:
    rows = [f"| `{name}` | {_cell(str(default))} | {_cell(text)} |" for name, default, text in describe()]
    head = "## Settings\n`--set STAGE.FIELD=VALUE`, or `overrides` in jobs and the library; the defaults are those of `demo`.\n"
    return "\n".join([head, "| setting | default | what |", "| --- | --- | --- |", *rows, ""])


def _row(kind: type[Options], item: Field) -> str:
    flag = f"`{item.metadata['metavar']}`" if item.metadata["positional"] else _flag(item)
    default = "required" if item.default is MISSING else _default(item.default)
    kinds = _type(annotations_of(kind)[item.name], item)
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
    for part in union_members(kind):
        if typing.get_origin(part) is not tuple:
            yield NAMES[part]
            continue
        inner = [next(_names(each)) for each in typing.get_args(part) if each is not Ellipsis]
        yield f"list of {inner[0]}" if Ellipsis in typing.get_args(part) else f"({', '.join(inner)})"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;")


def stub() -> str:
    """karf_engine/api.pyi."""
    return STUB + "".join(_typed(name, getattr(api, name)) for name in karf_engine._DEFINES["api"])


def _typed(name: str, function: Any) -> str:
    """A function's signature, a parameter a line."""
    signature = inspect.signature(function)
    types = api.LISTENERS | _keyword_types(function.options) if hasattr(function, "options") else {}
    lines = []
    for each in signature.parameters.values():
        if each.kind is each.KEYWORD_ONLY and "*" not in lines:
            lines.append("*")
        kind = types[each.name] if each.annotation is each.empty else each.annotation
        lines.append(f"{each.name}: {kind}" + ("" if each.default is each.empty else f" = {_literal(each.default)}"))
    return f"def {name}(\n    " + ",\n    ".join(lines) + f",\n) -> {signature.return_annotation}: ...\n"


def _keyword_types(kind: type[Options]) -> dict[str, str]:
    """The types of a command's options as the library takes them, by name."""
    found = {}
    for item in fields_in_help_order(kind):
        own = union_members(annotations_of(kind)[item.name])
        extra = f" | {api.OBJECTS[item.name]}" if item.name in api.OBJECTS else ""
        if item.metadata["choices"]:
            text = f"Literal[{', '.join(map(_literal, item.metadata['choices']))}]"
        elif Path in own:
            text = " | ".join(_stub_type(part, f"PathLike{extra}") for part in own)
        else:
            text = " | ".join(map(_stub_type, own)) + extra
        found[item.name] = text + (" | None" if item.default is None else "")
    return found


def _stub_type(kind: Any, path: str = "PathLike") -> str:
    if typing.get_origin(kind) is not tuple:
        return path if kind is Path else kind.__name__
    parts = [_stub_type(part, path) for part in typing.get_args(kind) if part is not Ellipsis]
    if parts == ["str"]:  # a text is a Sequence[str] too
        return "list[str] | tuple[str, ...]"
    return f"Sequence[{parts[0]}]" if len(set(parts)) == 1 else f"tuple[{', '.join(parts)}]"


def _literal(value: Any) -> str:
    return json.dumps(value) if isinstance(value, str) else repr(value)


PAGES = {DOCS / "command_line.md": command_line, DOCS / "library.md": library, ROOT / "karf_engine" / "api.pyi": stub}


def main() -> int:
    """Write the pages and the stub; with --check only say by the exit code whether they are up to date."""
    pages = {path: page() for path, page in PAGES.items()}
    if "--check" in sys.argv[1:]:
        return int(any(path.read_text(encoding="utf-8") != text for path, text in pages.items()))
    for path, text in pages.items():
        path.write_text(text, encoding="utf-8")
        print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
