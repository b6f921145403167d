"""What other installed packages bring: kinds of fields, heads, layers, capture formats and label solvers, by entry points.

A package names them in its pyproject.toml, in the groups of `GROUPS`; an entry's name is the kind's. Names are known
without importing anything; an object is loaded when its name is first asked for. The standard library alone is needed.
"""

from __future__ import annotations

from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from ..errors import MissingDependency, is_out_of_memory

GROUPS = ("karf.fields", "karf.heads", "karf.layers", "karf.formats", "karf.labels")


def plugin_names(group: str) -> list[str]:
    """Names of what installed packages bring, in order; without loading it.

    Args:
        group: One of `GROUPS`.
    """
    return sorted(_entries(group))


def load_plugin(group: str, name: str) -> Any:
    """What an installed package brings.

    Args:
        group: One of `GROUPS`.
        name: One of `plugin_names`.

    Raises:
        MissingDependency: It cannot be imported; names the package and why.
    """
    entry = _entries(group)[name]
    try:
        return entry.load()
    except Exception as error:  # whatever another's module raises
        if is_out_of_memory(error):
            raise
        raise MissingDependency(
            "{value!r}, which the package {package} brings as {group} {name!r}, cannot be loaded: {reason}",
            "Update or uninstall that package.",
            value=entry.value,
            package=entry.dist.name if entry.dist else "?",
            group=group,
            name=name,
            reason=repr(error),
        ) from error


@cache
def _entries(group: str) -> dict[str, EntryPoint]:
    return {entry.name: entry for entry in entry_points(group=group)}
