"""The state that a worker keeps between queries."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import Cancelled
from ...project import Project

if TYPE_CHECKING:
    from ...recolor.model import Model

MAX_CACHED = 4


class Session:
    """A cache of loaded things, and the folder of answers.

    Args:
        folder: The job's folder; files of answers are written below it, and their readers may delete them.
        threads: As of `runtime.start_runtime`.
        device: As of `runtime.start_runtime`.
    """

    def __init__(self, folder: Path, threads: int | None = None, device: str | None = None) -> None:
        self.folder = folder
        self.is_superseded: Callable[[], bool] = lambda: False
        self._threads, self._device = threads, device
        self._runtime = None
        self._cached: dict[Any, tuple[Any, Any]] = {}  # the least recently used first
        self._n_files = 0

    def cached(self, key: Any, version: Any, make: Callable[[], Any]) -> Any:
        """Return the value cached under this key and version, else make it; the last `MAX_CACHED` keys are kept.

        Args:
            key: Hashable, for example ("model", folder).
            version: Compared by ==; changes when the value's source on disk does.
            make: Returns the value.
        """
        known = self._cached.pop(key, None)
        if known is None or known[0] != version:
            known = version, make()
        self._cached[key] = known
        while len(self._cached) > MAX_CACHED:
            del self._cached[next(iter(self._cached))]
        return known[1]

    def forget(self) -> None:
        """Empty the cache."""
        self._cached.clear()

    def model(self, folder: str) -> Model:
        """Return the model of a project, loaded again when a stage has finished since.

        Raises:
            KarfError: Nothing is learned, or a file is damaged.
        """
        from ...compute.runtime import start_runtime
        from ...recolor.model import Model  # needs torch

        if self._runtime is None:
            self._runtime = start_runtime(0, self._threads, self._device)
        device = str(self._runtime.device)
        return self.cached(("model", folder), Project(folder).state(), lambda: Model.load(folder, device))

    def file(self, name: str) -> Path:
        """Return a new path for a file of an answer, `answers/<number>-<name>`."""
        self._n_files += 1
        path = self.folder / "answers" / f"{self._n_files:06d}-{name}"
        path.parent.mkdir(exist_ok=True)
        return path

    def check(self) -> None:
        """Raise Cancelled where a later query of this kind is waiting; long queries call this now and then."""
        if self.is_superseded():
            raise Cancelled("A later query of the same kind came.")
