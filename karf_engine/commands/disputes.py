"""Objects about which photos and the learned scene disagree: said once for all views of a job."""

from __future__ import annotations

from collections.abc import Iterable

from ..compute.progress import Emit

MOST_NAMED = 3  # views of one warning


class Disputes:
    """In which views an object's edges are the scene's, since the photo contradicts them."""

    def __init__(self) -> None:
        self._views: dict[str, list[str]] = {}

    def add(self, view: str, objects: Iterable[str]) -> None:
        """Note the objects of a view whose mattes are disputed."""
        for name in objects:
            self._views.setdefault(name, []).append(view)

    def tell(self, emit: Emit) -> None:
        """Warn of each object, with some of its views."""
        for name, views in self._views.items():
            more = f" and {len(views) - MOST_NAMED} more" if len(views) > MOST_NAMED else ""
            where = ", ".join(views[:MOST_NAMED]) + more
            sentence = f"Photo and learned scene disagree about {name} in {where}: its edges there are the scene's."
            emit("warning", code="edges", sentence=sentence)
