"""What one fault did, and how many of them become a row of the table."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Trial:
    """One fault thrown once. fault: its row in the table; case: which of its kind.

    lost: what a user has lost, or None; flaws: what else went wrong; seen: what the user was told.
    """

    fault: str
    case: str
    lost: str | None = None
    flaws: tuple[str, ...] = ()
    seen: str = ""


def trial(fault: str, case: str, lost: str | None, *flaws: str | None, seen: str = "") -> Trial:
    """A trial of which some flaws may be None."""
    return Trial(fault, case, lost, tuple(flaw for flaw in flaws if flaw), seen)


def rows(trials: Iterable[Trial], folder: Path) -> list[dict[str, Any]]:
    """One row a fault: tries, how many lost data, how many had another flaw, what was seen, and the failures."""
    faults: dict[str, list[Trial]] = {}
    for one in trials:
        faults.setdefault(one.fault, []).append(one)
    return [_row(fault, own, str(folder)) for fault, own in faults.items()]


def _row(fault: str, own: list[Trial], folder: str) -> dict[str, Any]:
    seen = Counter(_plain(one.seen, folder) for one in own if one.seen)
    failures = Counter()
    for one in own:
        for text in filter(None, (one.lost, *one.flaws)):
            failures[f"{one.case}: {_plain(text, folder)}"] += 1
    return {
        "fault": fault,
        "tries": len(own),
        "lost": sum(one.lost is not None for one in own),
        "flaws": sum(bool(one.flaws) for one in own),
        "seen": [text for text, _ in seen.most_common(3)],
        "failures": dict(failures.most_common()),
    }


def _plain(text: str, folder: str) -> str:
    """A sentence without what differs from run to run."""
    text = re.sub(rf"{re.escape(folder)}/(\w+)", r"\1", text)
    text = re.sub(r"\.[\w.]+-[a-z0-9_]{8}(?=[.\s'])", ".TEMPORARY", text)
    return re.sub(r"\s+", " ", re.sub(r"process \d+", "process N", text))[:240]
