"""What happened in the window: the steps that Blender notes line by line, and the transcript made of them.

Blender writes a line when a step begins and one when it ends, so that a step in which it crashes is known. No bpy.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

PASSED, FAILED, CRASHED = "passed", "failed", "crashed"


@dataclass(frozen=True)
class Step:
    """One step of the story. how: by mouse, key or script. notes: what was seen, and why it failed."""

    name: str
    how: str
    outcome: str
    seconds: float
    notes: tuple[str, ...] = ()
    shots: tuple[str, ...] = ()


@dataclass(frozen=True)
class Transcript:
    """A run: which Blender, its steps, and what was found wrong afterwards (tracebacks, processes left)."""

    blender: str
    seconds: float
    steps: tuple[Step, ...]
    findings: tuple[str, ...]

    @property
    def is_clean(self) -> bool:
        """Whether every step passed and nothing was found."""
        return bool(self.steps) and not self.findings and all(step.outcome == PASSED for step in self.steps)


def note(file: Path, **values) -> None:
    """Add a line to the record; it is on its way to the disk when this returns."""
    with file.open("a", encoding="utf-8") as lines:
        lines.write(json.dumps(values) + "\n")


def steps_of(lines: Iterable[str]) -> list[Step]:
    """The steps of a record. One that has begun and not ended is the one in which Blender went down."""
    steps: list[Step] = []
    open_step: dict | None = None
    for line in lines:
        values = json.loads(line)
        if values["kind"] == "begin":
            if open_step:
                steps.append(_step(open_step, CRASHED, 0.0))
            open_step = values | {"notes": [], "shots": []}
        elif values["kind"] == "end":
            steps.append(_step(open_step, values["outcome"], values["seconds"]))
            open_step = None
        elif open_step:  # notes and shots
            open_step[values["kind"] + "s"].append(values["text"])
    return steps + ([_step(open_step, CRASHED, 0.0)] if open_step else [])


def _step(begun: dict, outcome: str, seconds: float) -> Step:
    return Step(begun["name"], begun["how"], outcome, seconds, tuple(begun["notes"]), tuple(begun["shots"]))


def tracebacks(text: str) -> list[str]:
    """The last line of every Python traceback in a log, which says what it was."""
    found, is_inside = [], False
    for line in text.splitlines():
        if line.startswith("Traceback (most recent call last)"):
            is_inside = True
        elif is_inside and line and not line[0].isspace():
            found.append(line)
            is_inside = False
    return found + (["a traceback without an end"] if is_inside else [])


def write_transcript(folder: Path, transcript: Transcript) -> None:
    """Write `transcript.json` and `transcript.md` into a folder."""
    (folder / "transcript.json").write_text(json.dumps(asdict(transcript), indent=1), encoding="utf-8")
    (folder / "transcript.md").write_text(markdown(transcript), encoding="utf-8")


def markdown(transcript: Transcript) -> str:
    """The transcript as a page: a table of the steps, then what was seen in each."""
    verdict = "nothing found" if transcript.is_clean else "**not clean**"
    lines = [f"# {transcript.blender}: {verdict}, {transcript.seconds:.0f} s", "", "| step | by | outcome | s |"]
    lines += ["|---|---|---|---|"]
    lines += [f"| {step.name} | {step.how} | {_mark(step)} | {step.seconds:.1f} |" for step in transcript.steps]
    lines += _list("Found", transcript.findings)
    for step in transcript.steps:
        lines += _list(step.name, [*step.notes, *(f"![{shot}](shots/{shot}.png)" for shot in step.shots)])
    return "\n".join(lines) + "\n"


def _mark(step: Step) -> str:
    return step.outcome if step.outcome == PASSED else f"**{step.outcome}**"


def _list(title: str, items: Sequence[str]) -> list[str]:
    # a note may hold a message of several lines
    return ["", f"## {title}", *(f"- {' '.join(item.split())}" for item in items)] if items else []
