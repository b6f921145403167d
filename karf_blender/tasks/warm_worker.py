"""A worker that answers queries: started on demand, and kept for the next one."""

import shutil
from typing import ClassVar

import bpy

from .. import preferences
from ..engine.failures import disk_errors
from ..engine.worker import Worker
from ..engine_api import WARM, KarfError, Request, new_job
from ..project import folders


class WarmWorker:
    """Holds the worker; the session keeps one for the interface, and one for the render thread."""

    options: ClassVar[dict[str, int]] = {}  # of the engine's command `warm`

    def __init__(self) -> None:
        self.worker: Worker | None = None

    def start(self, scene: bpy.types.Scene) -> Worker:
        """Return the worker that suits the preferences; a fresh one where there is none.

        Raises:
            KarfError: It cannot be started.
        """
        python, threads = preferences.engine_python(), preferences.current().threads
        if self.worker is not None and not self.worker.suits(python, threads):
            self.close()
        if self.worker is None:
            project = folders.project_of(scene)
            with disk_errors():
                folder = new_job(project, WARM)
            options = self.options | ({"threads": threads} if threads else {})
            worker = Worker()
            worker.begin(python, Request(WARM, project.folder, options), folder, threads)
            self.worker = worker
        return self.worker

    def leave(self) -> None:
        """Drop a worker that has ended. The folder of one that failed is kept for its log, which the error names.

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
        """End the worker, whose folder goes with it."""
        if self.worker is not None:
            self.worker.end()
            shutil.rmtree(self.worker.folder, ignore_errors=True)
            self.worker = None
