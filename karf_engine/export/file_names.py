"""Names of recolored pictures: patterns with tokens, such as `{look}/{view}`, without suffix."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from ..errors import BadRequest
from ..io.names import case_folded, is_file_name

KINDS = ("render", "masks", "depth", "unsure", "layers", "planes")  # folders of other files of the views


def tokens_of(view: str) -> dict[str, str]:
    """Return the tokens that stand for a view: its name, and the number at the name's end, or else the name."""
    number = re.search(r"\d+$", view)
    return {"view": view, "frame": number[0] if number else view}


def named(pattern: str, tokens: Mapping[str, str]) -> str:
    """Return a pattern with tokens replaced by their values; others stay."""
    return re.sub(r"{(\w+)}", lambda match: tokens.get(match[1], match[0]), pattern)


def file_paths(pattern: str, files: Sequence[Mapping[str, str]]) -> list[str]:
    """Return the path of each file by its tokens, relative to the output folder, with `/` and without suffix.

    Raises BadRequest if a token is unknown, a name is invalid or belongs to other files, or two files have one path.
    """
    paths = [named(pattern, tokens) for tokens in files]
    for path, tokens in zip(paths, files, strict=True):
        first, *_ = parts = path.split("/")
        unknown = next((name for name in re.findall(r"{(\w+)}", pattern) if name not in tokens), None)
        if unknown is not None or not all(is_file_name(part) for part in parts) or first.lower() in KINDS:
            raise BadRequest(
                "File names cannot be {pattern!r}.",
                "Write a relative path of {known}, which does not begin with {kinds}.",
                pattern=pattern,
                known=", ".join(f"{{{name}}}" for name in tokens),
                kinds=", ".join(KINDS),
            )
    taken: set[str] = set()
    for path in paths:
        if case_folded(path) in taken:
            raise BadRequest(
                "The file names {pattern!r} give two pictures the path {path!r}.",
                "Add a token that differs: {known}.",
                pattern=pattern,
                path=path,
                known=", ".join(f"{{{name}}}" for name in files[0]),
            )
        taken.add(case_folded(path))
    return paths
