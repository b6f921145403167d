"""Write the reference of the library and the commands from the code: python -m tools.reference [--check].

This writes karf_engine/api.pyi, the signatures for type checkers and editors. The documentation site adds the rest to
its pages of the library and of the command line while it is built (docs/site/conf.py).
"""

from __future__ import annotations

import inspect
import io
import json
import sys
import typing
from contextlib import redirect_stdout, suppress
from pathlib import Path
from typing import Any

import karf_engine
from karf_engine import api, cli
from karf_engine.commands.options import COMMANDS
from karf_engine.io.arguments import annotations_of, union_members
from karf_engine.io.options import Options, fields_in_help_order

VERBS = (*COMMANDS, "settings", "doctor", "speed", "run")
STUB_FILE = Path(__file__).resolve().parents[1] / "karf_engine" / "api.pyi"
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


def library() -> str:
    """Every public name of the library by its signature and docstring, in the order of `karf_engine._DEFINES`."""
    names = [name for defined in karf_engine._DEFINES.values() for name in defined]
    return "\n".join(["\n## All names\n", *map(_described, names)])


def _described(name: str) -> str:
    thing = getattr(karf_engine, name)
    if not callable(thing):
        return f"### {name}\nBy name: {', '.join(thing)}. See [settings](command_line.md#all-settings).\n"
    kind = "class" if inspect.isclass(thing) else "function"
    members = "   :members:\n" if kind == "class" else ""
    directive = f".. auto{kind}:: karf_engine.{name}\n   :no-index:\n{members}"
    return f"### {name}\n```{{eval-rst}}\n{directive}```\n"


def command_line() -> str:
    """What `--help` prints of every verb, and all settings."""
    verbs = [f"## {verb}\n```text\n{_printed(verb, '--help')}```\n" for verb in VERBS]
    return "\n".join(["", *verbs, f"## All settings\n```text\n{_printed('settings')}```\n"])


def _printed(*arguments: str) -> str:
    """The text that a command prints."""
    with redirect_stdout(io.StringIO()) as printed, suppress(SystemExit):
        cli.main(arguments)
    return printed.getvalue()


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


def main() -> int:
    """Write the stub; with --check only say by the exit code whether it is up to date."""
    if "--check" in sys.argv[1:]:
        return int(STUB_FILE.read_text(encoding="utf-8") != stub())
    STUB_FILE.write_text(stub(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
