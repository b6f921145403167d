"""The record of a run: its steps, while Blender does them, and the transcript. No bpy."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Generator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

Wait = Generator[float, None, None]
NOT_DONE, UNFINISHED, FAILED, PASSED = "not done", "unfinished", "failed", "passed"


@dataclass
class Step:
    """One step of the story: what it promises, by mouse, keys or script, and what was found."""

    name: str
    by: str
    promise: str
    outcome: str = NOT_DONE
    seconds: float = 0.0
    found: list[str] = field(default_factory=list)
    shots: list[str] = field(default_factory=list)


@dataclass
class Story:
    """Given to each step: the job from outside, and the step's own record."""

    job: dict
    step: Step

    @property
    def desk(self) -> Path:
        """The artist's folder."""
        return Path(self.job["out"]) / "desk"

    def note(self, text: str) -> None:
        """Note what was found."""
        self.step.found.append(text)

    def shoot(self, what: str = "") -> Wait:
        """Copy the screen; the program outside converts it to a picture."""
        name, out = f"{self.step.name}_{what}" if what else self.step.name, Path(self.job["out"])
        yield 0.3
        shutil.copy(next((out / "screen").glob("Xvfb_screen*")), out / "shots" / f"{name}.xwd")
        self.step.shots.append(name)


class Chapter:
    """Steps of the story in their order, with the generator functions that do them."""

    def __init__(self) -> None:
        self.steps: list[tuple[Step, Callable[[Story], Wait]]] = []

    def step(self, by: str):
        """Add a generator function; its docstring is what it promises."""

        def add(run: Callable[[Story], Wait]) -> None:
            self.steps.append((Step(run.__name__, by, run.__doc__ or ""), run))

        return add


def write(file: Path, steps: Sequence[Step]) -> None:
    """Write all steps; a crash leaves the former file."""
    new = file.with_suffix(".new")
    new.write_text(json.dumps([asdict(step) for step in steps], indent=1), encoding="utf-8")
    new.replace(file)


def read(file: Path) -> list[Step]:
    """Return the steps of a record; none if Blender has not begun."""
    return [Step(**values) for values in json.loads(file.read_text(encoding="utf-8"))] if file.exists() else []


def is_clean(steps: Sequence[Step], findings: Sequence[str]) -> bool:
    """Return whether every step passed and nothing was found afterwards."""
    return bool(steps) and not findings and all(step.outcome == PASSED for step in steps)


def transcript(title: str, steps: Sequence[Step], findings: Sequence[str]) -> str:
    """Return the run as a page: a table of the steps, findings afterwards, and findings of each step."""
    verdict = "every step holds" if is_clean(steps, findings) else "**not clean**"
    lines = [f"# {title}: {verdict}", "", "| step | promise | by | outcome | s |", "|---|---|---|---|---|"]
    for step in steps:
        outcome = step.outcome if step.outcome == PASSED else f"**{step.outcome}**"
        lines.append(f"| {step.name} | {step.promise} | {step.by} | {outcome} | {step.seconds:.1f} |")
    lines += _section("Found afterwards", findings)
    for step in steps:
        lines += _section(step.name, [*step.found, *(f"![{shot}](shots/{shot}.png)" for shot in step.shots)])
    return "\n".join(lines) + "\n"


def _section(title: str, items: Sequence[str]) -> list[str]:
    # an item may be a message of several lines
    return ["", f"## {title}", *(f"- {' '.join(item.split())}" for item in items)] if items else []


# --- what a run must not leave ---------------------------------------------------------------------------------------
def tracebacks(text: str) -> list[str]:
    """Return the last line of every Python traceback in a log, the error itself."""
    found, is_inside = [], False
    for line in text.splitlines():
        if line.startswith("Traceback (most recent call last)"):
            is_inside = True
        elif is_inside and line and not line[0].isspace():
            found.append(line)
            is_inside = False
    return found + (["a traceback without an end"] if is_inside else [])


def engine_processes(desk: Path) -> list[str]:
    """Return the running processes with a file of the artist's folder in their command."""
    found = []
    for file in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = file.read_bytes().decode(errors="replace").split("\0")
        except OSError:  # it has ended meanwhile
            continue
        if any(word.startswith(f"{desk}/") for word in words):
            found.append(f"process {file.parent.name}: {' '.join(words).strip()}")
    return found
