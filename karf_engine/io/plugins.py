"""Plugins of installed packages, found by entry points in the groups of `GROUPS` and loaded on first use."""

from __future__ import annotations

from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from ..errors import MissingDependency, is_out_of_memory

GROUPS = ("karf.fields", "karf.heads", "karf.layers", "karf.formats", "karf.labels")


def plugin_names(group: str) -> list[str]:
    """Return the sorted names of a group's plugins, without loading them."""
    return sorted(_entries(group))


def load_plugin(group: str, name: str) -> Any:
    """Load one of `plugin_names`. Raises MissingDependency if it cannot be imported."""
    entry = _entries(group)[name]
    try:
        return entry.load()
    except Exception as error:  # a plugin may raise anything
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
