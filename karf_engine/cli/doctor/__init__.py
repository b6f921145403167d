"""Check whether this Python and computer can run the engine, and say what to do if not.

Imports only the standard library; packages are loaded when they are checked.
"""

from __future__ import annotations

import platform
from collections.abc import Generator, Iterator
from pathlib import Path

from ...worker.findings import ERROR, OK, STATUSES, VERDICT, WARNING, Finding
from ...worker.requirements import REQUIRED
from . import machine, packages, smoke

TORCH = REQUIRED[0]


def examine(
    folder: Path, quick: bool = False, device: str | None = None, threads: int | None = None
) -> Generator[Finding, None, None]:
    """Yield the finding of each check; the last one is the verdict.

    Args:
        folder: The folder for projects; its disk and locks are checked. It is not made.
        quick: Skip the smoke run of the stages, which takes some seconds. An earlier error skips it too.
        device: Device of the smoke run, as of the stages' options.
        threads: Threads of the smoke run, as of the stages' options.
    """
    found = []
    for finding in _findings(folder, device):
        found.append(finding)
        yield finding
    if not quick and all(finding.status != ERROR for finding in found):
        for finding in smoke.stages(device, threads):
            found.append(finding)
            yield finding
    yield _verdict(found)


def _findings(folder: Path, device: str | None) -> Iterator[Finding]:
    yield machine.python()
    required = list(packages.required())
    yield from required
    yield from packages.optional()
    if all(finding.status != ERROR for finding in required):
        yield from packages.devices(device)
    yield from machine.findings(folder)


def _verdict(found: list[Finding]) -> Finding:
    worst = max(found, key=lambda finding: STATUSES.index(finding.status))
    concerned = [finding for finding in found if finding.status == worst.status]
    names = ", ".join(finding.name for finding in concerned)
    if worst.status == ERROR:
        sentence = f"The engine cannot work here: {names}."
        return Finding(VERDICT, ERROR, sentence, worst.remedy, _command(concerned), worst.code)
    what = f"Python {platform.python_version()}, torch {packages.installed_version(TORCH)}"
    if worst.status == WARNING:
        return Finding(
            VERDICT, WARNING, f"The engine works, with a limit ({names}): {what}.", worst.remedy, worst.command
        )
    return Finding(VERDICT, OK, f"The engine is ready: {what}.")


def _command(concerned: list[Finding]) -> str:
    """Return the first finding's command; for missing packages, one command for all of them."""
    names = [finding.name for finding in concerned]
    missing = [package for package in REQUIRED if package.name in names]
    return packages.install_command(*missing) if missing and names[0] == missing[0].name else concerned[0].command
