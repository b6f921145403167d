"""The warm engine as a child process: asks by its standard input, answers as events. No bpy and no threads; the caller
polls.

It is a job that stays (see the engine's `wire`): it keeps what it has loaded, only reads projects, and ends by itself
when nobody has asked for a while.
"""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .. import engine_api
from ..engine_api import WARM, Ask, Event, KarfError, Project, Request, error_from_code
from . import jobs

ANSWERED = ("answer", "refused", "dropped")


class WarmEngine:
    """A warm engine at work, and what it was asked and has not answered.

    Attributes:
        waiting: Whatever the caller noted of each ask, by its number.
    """

    def __init__(self, python: Path, project: Path, threads: int = 0) -> None:
        """Start it.

        Args:
            python: The Python that has the engine's packages.
            project: A project folder, in whose `jobs` the engine has its own; it may answer for other projects too.
            threads: Processor threads; 0: the engine chooses.

        Raises:
            KarfError: The Python cannot be started, or the folder cannot be written.
        """
        with jobs.disk_errors():
            folder = Project(project).new_job(WARM)
        options = {"threads": threads} if threads else {}
        request = Request(WARM, project, options)
        self.made_for = python, threads
        self.waiting: dict[int, Any] = {}
        self._job = jobs.start(python, engine_api.ENGINE_FOLDER, request, folder, threads)
        self._unsent: dict[str, Ask] | None = {}  # until it listens; None since
        self._n_asked = 0

    @property
    def ended(self) -> bool:
        """Whether the process is gone."""
        return self._job.ended

    @property
    def folder(self) -> Path:
        """The job's folder."""
        return self._job.folder

    def ask(self, kind: str, options: dict, note: Any) -> int:
        """Ask; an ask of the same kind that was not begun is dropped. Returns the ask's number; note: see `waiting`."""
        self._n_asked += 1
        ask = Ask(self._n_asked, kind, options)
        self.waiting[ask.number] = note
        if self._unsent is None:
            self._job.tell(ask.encode())
        else:  # nobody reads the pipe yet, and it takes only so much
            replaced = self._unsent.pop(kind, None)
            self._unsent[kind] = ask
            if replaced is not None:
                del self.waiting[replaced.number]
        return ask.number

    def poll(self) -> Iterator[tuple[Any, Event]]:
        """The asks that were answered, refused or dropped since the last call: the caller's note, and the event."""
        for event in self._job.poll():
            if event.kind == "hello":
                self._send_all()
            if event.kind in ANSWERED and event["id"] in self.waiting:
                yield self.waiting.pop(event["id"]), event

    def error(self) -> KarfError | None:
        """Why it has ended; None where it was idle."""
        try:
            self._job.check()
        except KarfError as error:
            return error
        return None

    def end(self) -> None:
        """End it where it still lives, and remove its folder; what failed is kept for its log."""
        is_kept = self._job.ended and self.error() is not None
        if not self._job.ended:
            self._job.terminate()
        if not is_kept:
            shutil.rmtree(self._job.folder, ignore_errors=True)

    def _send_all(self) -> None:
        for ask in self._unsent or {}:
            self._job.tell(self._unsent[ask].encode())
        self._unsent = None


def refusal(event: Event) -> KarfError:
    """The error of a `refused` event."""
    return error_from_code(event["code"], event["sentence"], event["hint"])
