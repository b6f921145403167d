"""Workers: started for jobs, or on demand for queries and then kept for the next query."""

import shutil

import bpy

from .. import preferences
from ..engine.failures import disk_errors
from ..engine.worker import Worker
from ..engine_api import WARM, KarfError, Project, Request, new_job
from ..project import folders


def begin_job(worker: Worker, request: Request) -> None:
    """Begin a job in a new folder, with the Python and the threads of the preferences.

    Raises:
        KarfError: It cannot start.
    """
    python, threads = preferences.engine_python(), preferences.current().threads
    with disk_errors():
        folder = new_job(Project(request.project), request.stage)
    worker.begin(python, request, folder, threads)


class WarmWorker:
    """Keeps a worker for queries; the session has one for the interface and one for the render thread."""

    idle_minutes: int | None = None  # after which it ends; None: as the engine chooses

    def __init__(self) -> None:
        self.worker: Worker | None = None

    def start(self, scene: bpy.types.Scene) -> Worker:
        """Return a worker that suits the preferences; start one if needed.

        Raises:
            KarfError: It cannot be started.
        """
        python, threads = preferences.engine_python(), preferences.current().threads
        if self.worker is not None and not self.worker.suits(python, threads):
            self.close()
        if self.worker is None:
            options = {"threads": threads, "idle_minutes": self.idle_minutes}
            options = {name: value for name, value in options.items() if value}
            worker = Worker()
            begin_job(worker, Request(WARM, folders.project_of(scene).folder, options))
            self.worker = worker
        return self.worker

    def leave(self) -> None:
        """Drop a worker that has ended. If it failed, its folder is kept for the log.

        Raises:
            KarfError: It failed.
        """
        try:
            self.worker.check()
        except KarfError:
            self.worker = None
            raise
        self.close()

    def close(self) -> None:
        """End the worker and delete its folder."""
        if self.worker is not None:
            self.worker.end()
            shutil.rmtree(self.worker.folder, ignore_errors=True)
            self.worker = None
