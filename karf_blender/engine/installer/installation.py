"""The installation at work, or the removal: child processes one after another, which the caller polls. No bpy, no threads.

Installing, resuming, repairing and updating are the same: damaged files are dropped from uv's cache, then uv fills a new
environment from it, and fetches missing files. Only when the result is tested does the environment count; one that
counted before does so until then, whatever ends the installation.
"""

import json
import re
import shutil
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...engine_api import REQUIRED, BadRequest, Cancelled, DataError, KarfError, MissingDependency, write_json
from .. import processes
from ..failures import disk_errors
from . import chores, home
from .plan import EXTRAS, UNPACKED, Plan, Step

FETCHED_AT_ONCE = "3"  # number of downloads: they are large, and cancelling loses those under way
REPORTED_AS = {"mps": "cpu"}  # builds of torch that torch itself calls otherwise
HASH = "hash mismatch|do not match the hashes"
FULL = "no space left on device|os error 28|os error 112|not enough space on the disk|disk quota exceeded"
CERTIFICATE = "invalid peer certificate|certificate verify failed|unknownissuer"
NETWORK = (  # the most specific first
    "temporary failure in name resolution",
    "failed to lookup address",
    "connection refused",
    "connection reset",
    "network is unreachable",
    "operation timed out",
    "read timed out",
    "error decoding response body",
    "failed to establish a new connection",
    "proxyerror",
    "dns error",
    "tcp connect error",
    "error sending request",
    "request failed after",
)
NO_FILE = "no solution found|no matching distribution"
GO_ON = "What was fetched is kept; Install goes on from there."


@dataclass(frozen=True)
class Progress:
    title: str
    done: int = 0  # bytes, estimated
    total: int = 0
    detail: str = ""  # the packages that are being fetched

    @property
    def sentence(self) -> str:
        figures = f", {self.done / 1e6:.0f} of {self.total / 1e6:.0f} MB" if self.done else ""
        return f"{self.title}{figures}{f': {self.detail}' if self.detail else ''}"

    @property
    def fraction(self) -> float:
        return min(self.done / self.total, 1.0) if self.total else 0.0


class Installation:
    """An installation by a plan. `poll` it until it has `ended`, then `check` how it ended."""

    can_be_cancelled = True

    def __init__(self, planned: Plan) -> None:
        self.plan = planned
        self.ended = False
        self.progress = Progress("Starting", 0, planned.download_bytes)
        self._log = planned.folder / home.LOG
        self._error: KarfError | None = None
        self._process: subprocess.Popen | None = None
        self._fetching: _Fetching | None = None
        self._before = 0  # bytes of the steps that are done
        self._mark = {"build": planned.lock.build, "extras": list(planned.choices.extras)}
        self._mark |= {"platform": planned.machine.platform, "python": planned.starter.version}
        home.claim(planned.folder, self._mark)
        with disk_errors():
            self._log.write_text("", encoding="utf-8")
        self._steps = self._work()
        self._advance()

    def poll(self) -> Progress:
        """Return how far it is, and start the next command where one has ended. Never waits."""
        if self.ended:
            return self.progress
        has_exited = self._process.poll() is not None
        if self._fetching:
            self._fetching.read(self._new_lines())
            done = self._before + self._fetching.done
            self.progress = Progress(self._step.title, done, self.plan.download_bytes, self._fetching.detail)
        if has_exited:
            self._finish_step()
        return self.progress

    def end(self) -> None:
        """End the command at work; waits for it a few seconds at most. Finished files are kept."""
        if not self.ended:
            processes.end(self._process)
            self._conclude(Cancelled("The installation was cancelled.", GO_ON))

    def check(self) -> None:
        """Raise KarfError where the environment is not ready: why, and how to continue."""
        if self._error is not None:
            raise self._error

    # --- the work --------------------------------------------------------------------------------------------------
    def _work(self) -> Iterator[Step]:
        planned, folder, name = self.plan, str(self.plan.folder), self.plan.environment.name
        was = home.status(planned.folder)
        counting = was.environment if was.torch else ""
        yield Step("Checking what is there", chores.command("check", folder, counting), is_needed=False)
        yield from planned.steps()
        modules = [package.name for package in REQUIRED] + ["numba", *map(EXTRAS.get, planned.choices.extras)]
        yield Step("Testing", chores.command("test", *modules, python=str(home.python_of(planned.environment))))
        tested = self._tested()
        with disk_errors():
            named = {"environment": name, "chosen": self._mark, "digest": planned.lock.digest}
            write_json(planned.folder / home.INSTALLED, {"schema": home.SCHEMA, **tested, **named})
        yield Step("Cleaning up", chores.command("clear", folder, name), is_needed=False)

    def _tested(self) -> dict[str, Any]:
        """Return what the test has found, its last line; refuse another build of torch than was meant."""
        try:
            tested = json.loads(self._said[-1])
        except (ValueError, IndexError) as error:
            raise KarfError(
                "The environment's Python gave no answer.", "Repair, or remove and install anew."
            ) from error
        build = self.plan.lock.build
        if tested["build"] != REPORTED_AS.get(build, build):
            raise BadRequest(
                f"torch {tested['torch']} is a {tested['build']} build, not the {build} build that was chosen.",
                "Choose another build: uv found no driver on this computer for the chosen one.",
            )
        return tested

    # --- one command -----------------------------------------------------------------------------------------------
    def _advance(self) -> None:
        """Start the next command, or end."""
        try:
            self._start(next(self._steps))
        except StopIteration:
            self._conclude(None)
        except KarfError as error:
            self._conclude(error)

    def _start(self, step: Step) -> None:
        self._step, self._said = step, []
        self._fetching = _Fetching(step, self.plan) if step.wheels else None
        self.progress = Progress(step.title, self._before, self.plan.download_bytes)
        variables = {"UV_CONCURRENT_DOWNLOADS": FETCHED_AT_ONCE, **self.plan.source.variables}
        with disk_errors(), self._log.open("ab") as log:
            log.write(f"> {step.title}: {' '.join(step.command)}\n".encode())
            log.flush()
            self._offset = log.tell()
            options = {"stdin": subprocess.DEVNULL, "stdout": log, "stderr": subprocess.STDOUT}
            try:
                self._process = processes.start(step.command, variables=variables, cwd=self.plan.folder, **options)
            except OSError as error:
                raise MissingDependency(
                    f"{step.command[0]} does not start ({error.strerror or error}).",
                    "Choose another starter, then Repair.",
                ) from error

    def _new_lines(self) -> list[str]:
        """Read what the command has said since the last call, whole lines only."""
        try:
            with self._log.open("rb") as stream:
                stream.seek(self._offset)
                data = stream.read()
        except OSError:
            return []
        end = data.rfind(b"\n") + 1
        self._offset += end
        lines = data[:end].decode("utf-8", "replace").splitlines()
        self._said += lines
        return lines

    def _finish_step(self) -> None:
        code = self._process.returncode
        self._new_lines()
        # what it started may have outlived it
        processes.send(self._process, processes.KILL)
        if code and self._step.is_needed:
            self._conclude(explain(self.plan, self._step, self._said, processes.ending(self._process)))
        else:
            self._before += self._step.bytes
            self._advance()

    def _conclude(self, error: KarfError | None) -> None:
        self._error, self.ended = error, True
        self._steps.close()


class Removal:
    """The environment's end; poll it as an `Installation`."""

    can_be_cancelled = False

    def __init__(self, folder: Path) -> None:
        home.check_ours(folder)
        self.ended, self._folder = False, folder
        self.progress = Progress("Removing the engine ...")
        with disk_errors():
            (folder / home.INSTALLED).unlink(missing_ok=True)  # from here on nobody starts it
            self._process = processes.start(chores.command("remove", str(folder)), stdin=subprocess.DEVNULL)

    def poll(self) -> Progress:
        self.ended = self._process.poll() is not None
        return self.progress

    def end(self) -> None:
        """Leave the rest to the next removal."""
        processes.end(self._process)

    def check(self) -> None:
        """Remove what is left; raises KarfError where a file cannot be deleted."""
        home.remove(self._folder)


class _Fetching:
    """The bytes that a step has fetched: those in uv's cache before, and by how much the disk has filled since."""

    def __init__(self, step: Step, planned: Plan) -> None:
        self._total, self._folder = step.bytes, planned.folder
        self._unpacked = UNPACKED[planned.lock.build]
        cached = {path.stem.lower() for path in planned.cache.glob("archive-v*/*/*.dist-info")}
        packages = ((wheel.size, "-".join(wheel.file.split("-")[:2]).lower()) for wheel in step.wheels)
        self._before = sum(size for size, package in packages if package in cached)
        self._free = shutil.disk_usage(self._folder).free
        self._active: dict[str, None] = {}  # packages that uv is fetching
        self._is_prepared = False

    def read(self, lines: Iterable[str]) -> None:
        """Take in what uv has said."""
        for line in lines:
            word, _, name = line.strip().partition(" ")
            self._is_prepared |= word == "Prepared"
            if word == "Downloading":
                self._active[name.partition(" ")[0]] = None
            elif word == "Downloaded":
                self._active.pop(name, None)

    @property
    def detail(self) -> str:
        return "putting them in place" if self._is_prepared else ", ".join([*self._active][:3])

    @property
    def done(self) -> int:
        if self._is_prepared:
            return self._total
        grown = max(self._free - shutil.disk_usage(self._folder).free, 0) / self._unpacked
        return min(self._before + round(grown), self._total)


# --- errors ----------------------------------------------------------------------------------------------------------
def explain(planned: Plan, step: Step, said: Sequence[str], how: str) -> KarfError:
    """Return the error for a command that failed, by what it has said and its exit code or signal."""
    text = "\n".join(said)
    lower, last, source, log = text.lower(), _last(said), step.source, planned.folder / home.LOG
    if re.search(HASH, lower):
        sentence = f"{_named(text)} is not the file that KaRF was tested with: its hash is another."
        remedy = f"It was not installed. Is {source} to be trusted?"
    elif re.search(FULL, lower):
        sentence = f"The disk of {planned.folder} is full."
        remedy = "Free some space, or choose another folder."
    elif re.search(CERTIFICATE, lower):
        sentence = f"The certificate of {source} is not accepted."
        remedy = (
            "In a network with certificates of its own set UV_SYSTEM_CERTS=1, or SSL_CERT_FILE to their file, and start "
            "Blender anew."
        )
    elif reason := next((phrase for phrase in NETWORK if phrase in lower), ""):
        sentence = f"No connection to {source} ({reason})."
        remedy = "Check network and proxy, or choose a folder of wheels."
        if planned.backend == "cpu" and "cuda" in planned.machine.builds:
            remedy += " Or choose the build cuda: the usual index has it, and it computes on processors too."
    elif re.search(NO_FILE, lower):
        sentence = f"A file that the engine needs is not to be had from {source}: {last}"
        remedy = f"{log} tells which. Choose another index, or a folder of wheels."
    else:
        return MissingDependency(f"{step.title} failed ({how}): {last}", f"{log} tells more. {GO_ON}")
    return DataError(sentence, f"{remedy} {GO_ON}")


def _named(text: str) -> str:
    """Return the package that a complaint about hashes names."""
    found = re.search(r"[Hh]ash mismatch for [`']?([\w.-]+==[\w.+]+)|^\s+([\w.-]+==\S+) from", text, re.M)
    return found[1] or found[2] if found else "A file"


def _last(said: Sequence[str]) -> str:
    """Return the last words that say something, without the marks that uv and pip put before them."""
    words = [re.sub(r"^([^\w`(/]+|cause: |error: |ERROR: )+", "", line) for line in said]
    return next((line for line in reversed(words) if line), "it said nothing")
