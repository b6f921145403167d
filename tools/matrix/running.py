"""One cell: its environment made, its tests run, and what came of it. Standard library only."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree

from .. import dev
from . import environments
from .cells import ROOT, SLOW, Cell

LIMIT = 3600.0  # seconds after which a cell's tests count as hung


@dataclass(frozen=True)
class Result:
    """What came of a cell.

    status: `passed`; `failed`: a test did, or no versions of its packages go together; `skipped`: it could not be run.
    reason: Why it was skipped, or what failed beside tests.
    packages: Package -> version, of those that its ranges name.
    tests: Which tests ran: `all` or `quick`.
    failures: The names of the tests that failed.
    seconds: Of the tests alone.
    """

    cell: str
    status: str
    reason: str = ""
    python: str = ""
    system: str = ""
    packages: dict[str, str] | None = None
    tests: str = ""
    n_passed: int = 0
    n_failed: int = 0
    n_skipped: int = 0
    failures: tuple[str, ...] = ()
    seconds: int = 0


def run(cell: Cell, is_quick: bool, earlier: dict[tuple[str, str], str]) -> Result:
    """Run a cell's tests, which write to the terminal as they go.

    Args:
        cell: Which.
        is_quick: Leave slow tests of the engine out.
        earlier: Python and lock -> cell, of what this run has tested; a cell with the very same is not tested again.
    """
    try:
        environment = environments.make(cell)
    except environments.Unavailable as reason:
        return Result(cell.name, "skipped", str(reason))
    except environments.Unresolvable as reason:
        return Result(cell.name, "failed", str(reason))
    same = earlier.setdefault((cell.python, environment.lock), cell.name)
    if same != cell.name:
        return Result(cell.name, "skipped", f"the same packages as {same}")
    if cell.has_blender:  # with which a test writes the layers that Blender reads
        dev.setup("engine")
    python, system = _about(environment.python)
    packages = {name: environment.versions[name] for name in cell.packages}
    slow = SLOW if is_quick and not cell.has_blender else ()
    tests = "quick" if slow else "all"
    result = Result(cell.name, "failed", python=python, system=system, packages=packages, tests=tests)
    return _tested(result, environment.python, [cell.tests, *[f"--ignore={name}" for name in slow]])


def _about(python: Path) -> tuple[str, str]:
    """The version of an interpreter, and its system."""
    code = "import platform; print(platform.python_version(), platform.system(), platform.machine())"
    said = subprocess.run([python, "-c", code], capture_output=True, text=True, check=True).stdout.strip()
    version, _, system = said.partition(" ")
    return version, system


def _tested(result: Result, python: Path, arguments: list[str]) -> Result:
    """The result with what pytest reports."""
    variables = os.environ | {"KARF_ENGINE_PYTHON": str(dev.python_of("engine")), "OMP_NUM_THREADS": "1"}
    start = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        command = [str(python), "-m", "pytest", *arguments, f"--junitxml={report}", "-p", "no:cacheprovider"]
        try:
            code = subprocess.run(command, cwd=ROOT, env=variables, timeout=LIMIT).returncode
        except subprocess.TimeoutExpired:
            return replace(result, reason=f"the tests did not end in {LIMIT:.0f} seconds", seconds=int(LIMIT))
        seconds = round(time.monotonic() - start)
        if not report.exists():
            return replace(result, reason=f"the tests crashed (exit code {code})", seconds=seconds)
        result = _counted(replace(result, seconds=seconds), ElementTree.parse(report).getroot())
    return replace(result, status="passed" if code == 0 else "failed")


def _counted(result: Result, report: ElementTree.Element) -> Result:
    """The result with the counts and failures of a report in JUnit's XML."""
    cases = list(report.iter("testcase"))
    bad = [case for case in cases if case.find("failure") is not None or case.find("error") is not None]
    skipped = sum(case.find("skipped") is not None for case in cases)
    names = tuple(f"{case.get('classname')}::{case.get('name')}" for case in bad)
    counts = {"n_failed": len(bad), "n_skipped": skipped, "n_passed": len(cases) - len(bad) - skipped}
    return replace(result, failures=names, **counts)


def show(result: Result) -> None:
    """Print one line, and a line for each test that failed."""
    counts = f"{result.n_passed} passed, {result.n_failed} failed, {result.n_skipped} skipped, {result.seconds} s"
    print(f"{result.cell}: {result.status}, {result.reason or counts}", flush=True)
    for name in result.failures:
        print(f"    {name}", file=sys.stderr, flush=True)
