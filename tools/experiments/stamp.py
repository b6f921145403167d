"""Where a measured table comes from: its command, version, commit and machine, and what its stages were.

The stages' digests tell when a table has grown old: a preset's settings or a stage's version have changed since. Tables that
are shown all the same are named in docs/results/outdated.json, {table: {"stages": as of now, "text": what is known of it}}.
"""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from dataclasses import asdict
from datetime import date
from typing import Any

from karf_engine.io.files import fingerprint
from karf_engine.project import STAGE_VERSIONS
from karf_engine.project.settings import PRESETS, with_overrides
from karf_engine.version import __version__

from ..speed.machine import machine
from .page import DOCS


def stages_of(preset: str, overrides: Sequence[str] = ()) -> dict[str, str]:
    """A digest of each stage's version and settings; preset: its name; overrides: `stage.field=value`."""
    settings = with_overrides(PRESETS[preset], list(overrides))
    return {name: fingerprint(version, asdict(getattr(settings, name))) for name, version in STAGE_VERSIONS.items()}


def stamp(command: str, preset: str, overrides: Sequence[str], threads: int, seconds: float) -> dict[str, Any]:
    """The `made` of a table (see `page`).

    Args:
        command: that makes the table again.
        preset: name of the preset that all was learned with, but for what the rows say.
        overrides: of the preset, `stage.field=value`.
        threads: of the processor.
        seconds: that it took.
    """
    measured_on = machine(threads)
    return {
        "date": date.today().isoformat(),
        "command": command,
        "preset": " ".join([preset, *overrides]),
        "version": __version__,
        "commit": _commit(),
        "stages": stages_of(preset, overrides),
        "machine": f"{measured_on['processor']}, {measured_on['threads']} of {measured_on['cores']} cores",
        "seconds": round(seconds),
    }


def _commit() -> str:
    """The checkout's commit, and whether its engine differs from it."""
    run = {"cwd": DOCS.parent, "capture_output": True, "text": True, "check": True}
    commit = subprocess.run(["git", "rev-parse", "--short=7", "HEAD"], **run).stdout.strip()
    changed = subprocess.run(["git", "status", "--porcelain", "karf_engine"], **run).stdout.strip()
    return f"{commit} with changes" if changed else commit
