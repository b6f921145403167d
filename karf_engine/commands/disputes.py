"""Warn where photos and the learned scene disagree about an object."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from ..compute.progress import Emit

MAX_NAMED = 3  # views in one warning


def warn_of_disputes(disputed: Mapping[str, Iterable[str]], emit: Emit) -> None:
    """Emit one warning per object whose photos contradict its learned edges.

    Args:
        disputed: The disputed objects of each view, by the view's name.
        emit: Receives the warnings.
    """
    views_of: dict[str, list[str]] = {}
    for view, objects in disputed.items():
        for name in objects:
            views_of.setdefault(name, []).append(view)
    for name, views in views_of.items():
        more = f" and {len(views) - MAX_NAMED} more" if len(views) > MAX_NAMED else ""
        where = ", ".join(views[:MAX_NAMED]) + more
        sentence = f"Photo and learned scene disagree about {name} in {where}: its edges there are the scene's."
        emit("warning", code="edges", sentence=sentence)
