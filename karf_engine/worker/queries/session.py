"""The cache of a worker between queries, and the parsing of the options of queries."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import MISSING
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import BadRequest, Cancelled
from ...io.arguments import annotations_of, coerce, union_members
from ...io.files import errors_naming_path
from ...project import Project

if TYPE_CHECKING:
    from ...recolor.model import Model

MAX_CACHED = 4
Query = Callable[["Session", dict[str, Any]], dict[str, Any]]  # session and JSON options to JSON values


class Session:
    """A cache of loaded things, and the job's folder, below which files of answers are written for readers to delete."""

    def __init__(self, folder: Path, threads: int | None = None, device: str | None = None) -> None:
        self.folder = folder
        self.is_superseded: Callable[[], bool] = lambda: False
        self._threads, self._device = threads, device
        self._runtime = None
        self._cached: dict[Any, tuple[Any, Any]] = {}  # the least recently used first
        self._n_files = 0

    def cached(self, key: Any, version: Any, make: Callable[[], Any]) -> Any:
        """Return the value cached under this key and version, else make it; the last `MAX_CACHED` keys are kept.

        The version is compared by ==; it changes when the value's source on disk does.
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
        """Return the model of a project, loaded again when a stage has finished since."""
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

    def write_arrays(self, name: str, arrays: Mapping[str, np.ndarray]) -> dict[str, Any]:
        """Write arrays to a file, as raw float32 in native byte order, one after the other.

        Returns `pixels`, the file, and `arrays`: the `shape`, `dtype` and `offset` in bytes of each.
        """
        path, placed, offset = self.file(name), {}, 0
        with errors_naming_path(path), path.open("wb") as stream:
            for key, array in arrays.items():
                pixels = np.ascontiguousarray(array, np.float32)
                stream.write(pixels.data)
                placed[key] = {"shape": list(pixels.shape), "dtype": "float32", "offset": offset}
                offset += pixels.nbytes
        return {"pixels": str(path), "arrays": placed}

    def check(self) -> None:
        """Raise Cancelled where a later query of this kind is waiting; long queries call this now and then."""
        if self.is_superseded():
            raise Cancelled("A later query of the same kind came.")


def query(function: Callable[..., dict[str, Any]]) -> Query:
    """Decorate a function of a session and options as parameters: it then takes a dictionary of JSON options.

    Values must have the annotated types; null means the default, and options of other names are ignored. Raises BadRequest.
    """
    parameters = list(inspect.signature(function).parameters.values())[1:]

    @wraps(function)
    def answer(session: Session, options: dict[str, Any]) -> dict[str, Any]:
        kinds = annotations_of(function)
        given = {item.name: options.get(item.name) for item in parameters}
        for item in parameters:
            if given[item.name] is None and item.default is not item.empty:
                given[item.name] = item.default
            else:
                check_option(item.name, given[item.name], kinds[item.name])
        return function(session, **given)

    return answer


def check_option(name: str, value: Any, kind: Any) -> None:
    """Raise BadRequest if an option has another type than annotated."""
    if coerce(value, kind) is MISSING:
        wanted = union_members(kind)[0].__name__
        raise BadRequest(f"The option {name} = {value!r:.200} is not of type {wanted}.", "Correct the query.")
