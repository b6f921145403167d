"""Messages about the running task and the end of the last one, in the panel and on the console."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bpy

from .engine_api import Event, KarfError, Message
from .host.words import kept, translate

FOR_THE_RECORD = ("convergence",)  # codes of warnings for the job's record alone: an artist could do nothing


def state() -> bpy.types.PropertyGroup:
    """Return the session's `WindowManager.karf_progress`, which the panel shows."""
    return bpy.data.window_managers[0].karf_progress


def begin(label: str) -> None:
    """Show that a task starts, and clear the messages of the last one."""
    progress = state()
    progress.running, progress.stage, progress.fraction = True, label, 0.0
    dismiss()
    progress.text = "Starting"


def warn(sentence: str, /, **values: Any) -> None:
    """Show the user a message, in the panel and on the console; `values` fill in its placeholders."""
    if values:
        sentence = Message(sentence, **values)
    print(f"KaRF: {sentence}", flush=True)
    _add_warning(sentence)


@contextmanager
def printing_errors() -> Iterator[None]:
    """Print errors of the engine and of files, where the user has not asked for what fails."""
    try:
        yield
    except (KarfError, OSError) as error:
        print(f"KaRF: {error}", flush=True)


def _add_warning(sentence: str) -> None:
    progress = state()
    if sentence not in progress.warnings.splitlines():
        progress.warnings = f"{progress.warnings}\n{kept(sentence)}".strip()


def wrote(folder: Path) -> None:
    """Remember a folder with new files: the panel has a button that opens it."""
    state().folder = str(folder)


def fail(error: KarfError) -> None:
    """Show why something failed, and how to solve it."""
    progress = state()
    progress.text, progress.error, progress.hint = "", kept(error.sentence), kept(error.hint)


def dismiss() -> None:
    """Clear the messages of the last task."""
    progress = state()
    for name in ("text", "figures", "warnings", "error", "hint", "job", "folder"):
        setattr(progress, name, "")


def show_event(label: str, event: Event, whole: tuple[float, float] | None = None) -> None:
    """Show an engine's event; `whole`: the share done of several jobs, 0 to 1, and the seconds left."""
    progress = state()
    progress.running, progress.stage = True, label
    if event.kind == "progress":
        progress.fraction, left = whole or (event["step"] / max(event["total"], 1), event.get("eta_s"))
        progress.text = _share_and_time(progress.fraction, left)
        progress.figures = f"{event['stage']} {event['step']}/{event['total']}{_metrics(event)}"
    elif event.kind == "stage":
        progress.figures = _line(event)
    elif event.kind == "warning" and event.get("code") not in FOR_THE_RECORD:
        _add_warning(event["sentence"])


def print_event(stage: str, event: Event) -> None:
    """Print an engine's event, if it is meant for people."""
    line = _line(event)
    if line:
        print(f"KaRF {stage}: {line}", flush=True)


def _line(event: Event) -> str:
    """Describe an event; empty if it is not meant for people."""
    if event.kind == "progress":
        text, left = f"{event['step']}/{event['total']}", event.get("eta_s")
        if left:
            text += f", {left / 60:.0f} min left" if left > 90 else f", {left:.0f} s left"
        return text + _metrics(event)
    if event.kind == "stage":
        return f"{event['name']} {event.get('text', '')}".strip()
    return {"warning": event.get("sentence"), "done": "done"}.get(event.kind) or ""


def _share_and_time(share: float, left: float | None) -> str:
    """Describe the share done and the time left, in the user's language."""
    percent = f"{share:.0%}"
    if not left:
        return percent
    if left > 90:
        return translate("{percent}, {count} min left", percent=percent, count=f"{left / 60:.0f}")
    return translate("{percent}, {count} s left", percent=percent, count=f"{left:.0f}")


def _metrics(event: Event) -> str:
    return "".join(f", {name} {value:.4g}" for name, value in (event.get("metrics") or {}).items())
