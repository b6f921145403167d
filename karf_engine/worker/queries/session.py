"""What a worker keeps from one query to the next."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import Cancelled
from ...project import Project

if TYPE_CHECKING:
    from ...recolor.model import Model

MOST_HELD = 4


class Session:
    """What is loaded, and where answers are written.

    Attributes:
        folder: The job's; arrays and pictures of answers are written below it (`file`), and whoever reads them may
            delete them.
    """

    def __init__(self, folder: Path, threads: int | None = None, device: str | None = None) -> None:
        """threads, device: as of `runtime.start_runtime`."""
        self.folder = folder
        self.is_superseded: Callable[[], bool] = lambda: False
        self._threads, self._device = threads, device
        self._runtime = None
        self._held: dict[Any, tuple[Any, Any]] = {}
        self._n_files = 0

    def held(self, name: Any, mark: Any, make: Callable[[], Any]) -> Any:
        """What was made under this name while the mark was the same; else it is made now.

        The ones asked for last are kept, a few of them.

        Args:
            name: Hashable; of a model for example ("model", its folder).
            mark: Compared by ==; something that changes when the thing on disk does.
            make: Makes it.
        """
        known = self._held.pop(name, None)  # at the end again: the first is the one that was not asked for longest
        if known is None or known[0] != mark:
            known = mark, make()
        self._held[name] = known
        while len(self._held) > MOST_HELD:
            del self._held[next(iter(self._held))]
        return known[1]

    def forget(self) -> None:
        """Drop all that is held."""
        self._held.clear()

    def model(self, folder: str) -> Model:
        """All that is learned of a project, loaded again where a stage has finished since.

        Raises:
            KarfError: Nothing is learned there, or a file is damaged.
        """
        from ...compute.runtime import start_runtime
        from ...recolor.model import Model  # needs torch, without which some kinds can be answered

        if self._runtime is None:
            self._runtime = start_runtime(0, self._threads, self._device)
        device = str(self._runtime.device)
        return self.held(("model", folder), Project(folder).state(), lambda: Model.load(folder, device))

    def file(self, name: str) -> Path:
        """A new file's path for an answer, `answers/<number>-<name>`."""
        self._n_files += 1
        path = self.folder / "answers" / f"{self._n_files:06d}-{name}"
        path.parent.mkdir(exist_ok=True)
        return path

    def check(self) -> None:
        """Stop where the answer is no longer wanted; answers that take long call this now and then.

        Raises:
            Cancelled: A later query of this kind waits.
        """
        if self.is_superseded():
            raise Cancelled("A later query of the same kind came.")
