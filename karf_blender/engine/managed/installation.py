"""The installation at work: one child process after another, which the caller polls. No bpy and no threads.

Installing, resuming, repairing and updating are the same: what is there is surveyed, what is missing, changed or of
another version is put in place, and the result is tested. Only then does the environment count. One that counted before
is left alone and does so until then, whatever ends the installation. It is removed then, or where a job still runs in
it, by the next one.
"""

import json
import shutil
import signal
import subprocess
import time
from collections.abc import Generator
from pathlib import Path
from typing import Any

from ...engine_api import REQUIRED, Cancelled, KarfError, write_json
from .. import processes
from ..failures import disk_errors
from . import failures, home, lists, plan, recipes
from .plan import Plan, Step
from .progress import Fetching, Progress

HERE = Path(__file__).parent
KILL_SECONDS = 5.0
LOOK_SECONDS = 2.0  # interval between two looks into the cache
FETCHED_AT_ONCE = "3"  # number of downloads: they are large, and cancelling loses those under way
KEPT = {"pip", "setuptools", "uv", "wheel"}  # an environment's own tools
EXTRA_IMPORTS = {"photos": ("pycolmap",), "fast": ("numba",)}


class Installation:
    """An installation by a plan. `poll` it until it has `ended`, then `check` how it ended."""

    def __init__(self, planned: Plan) -> None:
        self.plan = planned
        self.ended = False
        self.progress = Progress("Starting", "", 0, planned.download_bytes)
        self._error: KarfError | None = None
        self._is_cancelled = False
        self._kill_at = float("inf")
        self._look_at = 0.0
        self._process: subprocess.Popen | None = None
        self._fetching: Fetching | None = None
        self._before = 0  # bytes of the steps that are done
        self._said: list[str] = []
        self._offset = 0
        self._steps = self._work()
        self._prepare()
        self._advance(None)

    def poll(self) -> Progress:
        """How far it is. Starts the next command where one has ended. Never waits."""
        if self.ended:
            return self.progress
        has_exited = self._process.poll() is not None
        lines = self._new_lines()
        self._said += lines
        self._show(lines)
        if has_exited:
            self._finish_step()
        elif time.monotonic() > self._kill_at:
            self._kill_at = float("inf")
            processes.send(self._process, processes.KILL)
        return self.progress

    def cancel(self) -> None:
        """End the command at work; finished files are kept."""
        if not self.ended:
            self._is_cancelled = True
            self._kill_at = time.monotonic() + KILL_SECONDS
            processes.send(self._process, signal.SIGTERM)

    def terminate(self) -> None:
        """End it now; waits for it a few seconds at most."""
        if not self.ended:
            self._is_cancelled = True
            processes.end(self._process)
            self._end(Cancelled("The installation was ended."))

    def check(self) -> None:
        """Return where the environment is ready.

        Raises:
            KarfError: It is not: why, and how to continue.
        """
        if self._error is not None:
            raise self._error

    # ------------------------------------------------------------------------------------------------------ the work
    def _prepare(self) -> None:
        """Claim the folder and write the lists of files."""
        planned, place = self.plan, self.plan.home
        self._was = home.status(place.folder)
        self._mark = {"build": planned.build, "backend": planned.backend, "extras": list(planned.choices.extras)}
        self._mark |= {"platform": planned.recipe.platform, "python": planned.recipe.python}
        home.claim(place, self._mark)
        with disk_errors():
            lists.write(place.folder, planned.recipe.platform, planned.recipe.python, planned.lists, recipes.FILE)
            place.log.write_text("", encoding="utf-8")

    def _work(self) -> Generator[Step, list[str], None]:
        """The commands, each after what the one before has said."""
        planned, place = self.plan, self.plan.home
        if planned.counting:
            yield planned.copy_environment()
        if self._needs_new_environment():
            if not (place.environment / "pyvenv.cfg").is_file():  # uv replaces only environments
                shutil.rmtree(place.environment, ignore_errors=True)
            yield planned.make_environment()
        said = yield self._python("Looking at what is there", HERE / "survey.py")
        found = _answer(said)
        wanted = {wheel.name: wheel.version for wheel in planned.wheels}
        superfluous = sorted(
            found["installed"].keys() - wanted.keys() - KEPT - ({"torch"} if planned.unchecked else set())
        )
        if planned.tools and (found["installed"].get("uv") != planned.tools[0].version or "uv" in found["damaged"]):
            yield planned.fetch_uv()
        if superfluous and not planned.unchecked:
            yield Step("Removing what is not needed", self._uninstall(superfluous))
        yield planned.put_packages(tuple(sorted(set(found["damaged"]) & wanted.keys())))
        if planned.unchecked:
            yield planned.put_torch(("torch",) if "torch" in found["damaged"] else ())
        extras = [name for extra in planned.choices.extras for name in EXTRA_IMPORTS[extra]]
        said = yield self._python("Testing", HERE / "selftest.py", *(package.name for package in REQUIRED), *extras)
        tested = _answer(said)
        failures.check_build(planned, tested)
        digest = planned.recipe.digest(planned.build, planned.backend, planned.choices.extras)
        with disk_errors():
            named = {"environment": place.name, "chosen": self._mark}
            write_json(place.installed, {"schema": home.SCHEMA, "digest": digest, **tested, **named})
        yield planned.remove_former()
        clean = (planned.uv, "cache", "clean", "--force", "--cache-dir", str(place.cache))
        yield Step("Cleaning up", clean, is_needed=False)

    def _needs_new_environment(self) -> bool:
        """Whether there is none, one of another build or Python, or one that was not finished before it had a package."""
        planned, was = self.plan, self._was
        is_other = not planned.is_copied and (was.build, was.python) != (planned.build, planned.recipe.python)
        return (
            is_other
            or not planned.home.python.is_file()
            or not planned.home.has_package("uv" if planned.tools else "*")
        )

    def _python(self, title: str, script: Path, *arguments: str) -> Step:
        return Step(title, (str(self.plan.home.python), "-I", "-B", "-X", "utf8", str(script), *arguments))

    def _uninstall(self, names: list[str]) -> tuple[str, ...]:
        return (self.plan.uv, "pip", "uninstall", "--python", str(self.plan.home.python), *names)

    # --------------------------------------------------------------------------------------------------- one command
    def _advance(self, said: list[str] | None) -> None:
        """Start the next command, or end."""
        try:
            self._start(self._steps.send(said))
        except StopIteration:
            self._end(None)
        except KarfError as error:
            self._end(error)

    def _start(self, step: Step) -> None:
        self._step, self._said = step, []
        sizes = {wheel.name: wheel.size for wheel in step.wheels}
        self._fetching = (
            Fetching(sizes, step.bytes, self.plan.home.cache, plan.UNPACKED[self.plan.build]) if step.bytes else None
        )
        self.progress = Progress(step.title, "", self._before, self.plan.download_bytes)
        variables = {"UV_CONCURRENT_DOWNLOADS": FETCHED_AT_ONCE, **self.plan.source.variables}
        with disk_errors(), self.plan.home.log.open("ab") as log:
            log.write(f"> {step.title}: {' '.join(step.command)}\n".encode())
            log.flush()
            self._offset = log.tell()
            try:
                self._process = processes.start(
                    step.command,
                    variables=variables,
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    cwd=self.plan.choices.folder,
                )
            except OSError as error:
                raise failures.does_not_start(step, error) from error

    def _new_lines(self) -> list[str]:
        """What the command has said since the last call, whole lines only."""
        try:
            with self.plan.home.log.open("rb") as stream:
                stream.seek(self._offset)
                data = stream.read()
        except OSError:
            return []
        end = data.rfind(b"\n") + 1
        self._offset += end
        return data[:end].decode("utf-8", "replace").splitlines()

    def _show(self, lines: list[str]) -> None:
        if self._fetching is None:
            return
        self._fetching.read(lines)
        if lines or time.monotonic() > self._look_at:
            self._look_at = time.monotonic() + LOOK_SECONDS
            done = self._before + self._fetching.done()
            self.progress = Progress(self._step.title, self._fetching.detail, done, self.plan.download_bytes)

    def _finish_step(self) -> None:
        code = self._process.returncode
        # what it started may have outlived it
        processes.send(self._process, processes.KILL)
        if self._is_cancelled:
            kept = "What was fetched is kept; Install goes on from there."
            self._end(Cancelled("The installation was cancelled.", kept))
        elif code and self._step.is_needed:
            self._end(failures.explained(self.plan, self._step, self._said, processes.ending(self._process)))
        else:
            self._before += self._step.bytes
            self._advance(self._said)

    def _end(self, error: KarfError | None) -> None:
        self._error, self.ended = error, True
        self._steps.close()


def _answer(said: list[str]) -> dict[str, Any]:
    """The line of JSON with which a script of ours ends."""
    try:
        return json.loads(said[-1])
    except (ValueError, IndexError) as error:
        raise KarfError("The environment's Python gave no answer.", "Repair, or remove and install anew.") from error
