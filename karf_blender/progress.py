"""What the panel and the console say of the running task and of how the last one ended."""

from pathlib import Path

import bpy

from .engine_api import Event, KarfError
from .host.words import kept, translate

# codes of warnings that stay in the job's record: what was found is used, and there is nothing that an artist could do
FOR_THE_RECORD = ("convergence",)


def state() -> bpy.types.PropertyGroup:
    """The session's `WindowManager.karf_progress`, which the panel shows."""
    return bpy.data.window_managers[0].karf_progress


def begin(label: str) -> None:
    """A task starts: nothing is said of the last one any more."""
    progress = state()
    progress.running = True
    progress.stage = label
    progress.fraction = 0.0
    dismiss()
    progress.text = "Starting"


def warn(sentence: str) -> None:
    """Show the user a message, in the panel and on the console."""
    print(f"KaRF: {sentence}", flush=True)
    _add_warning(sentence)


def _add_warning(sentence: str) -> None:
    progress = state()
    if sentence not in progress.warnings.splitlines():
        progress.warnings = f"{progress.warnings}\n{kept(sentence)}".strip()


def wrote(folder: Path) -> None:
    """Files were written there: the panel has a button that opens it."""
    state().folder = str(folder)


def fail(error: KarfError) -> None:
    """Say why something failed, and what can be done."""
    progress = state()
    progress.text, progress.error, progress.hint = "", kept(error.sentence), kept(error.hint)


def dismiss() -> None:
    """Clear what the panel says of the last task."""
    progress = state()
    for name in ("text", "figures", "warnings", "error", "hint", "job", "folder"):
        setattr(progress, name, "")


def show_event(label: str, event: Event, whole: tuple[float, float] | None = None) -> None:
    """Show an engine's event in the panel, under the running task's label.

    whole: Of a task of several jobs how much of all is done, 0 to 1, and the seconds that are left.
    """
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
    """Print an engine's event, where it says something to a person."""
    line = _line(event)
    if line:
        print(f"KaRF {stage}: {line}", flush=True)


def _line(event: Event) -> str:
    """An event as a person reads it; empty for events that are not for people."""
    if event.kind == "progress":
        return f"{event['step']}/{event['total']}{_time_left(event)}{_metrics(event)}"
    if event.kind == "stage":
        return f"{event['name']} {event.get('text', '')}".strip()
    return {"warning": event.get("sentence"), "done": "done"}.get(event.kind) or ""


def _share_and_time(share: float, left: float | None) -> str:
    """How much is done and how long the rest takes, in the user's language."""
    percent = f"{share:.0%}"
    if not left:
        return percent
    if left > 90:
        return translate("{percent}, {count} min left", percent=percent, count=f"{left / 60:.0f}")
    return translate("{percent}, {count} s left", percent=percent, count=f"{left:.0f}")


def _time_left(event: Event) -> str:
    left = event.get("eta_s")
    if not left:
        return ""
    return f", {left / 60:.0f} min left" if left > 90 else f", {left:.0f} s left"


def _metrics(event: Event) -> str:
    return "".join(f", {name} {value:.4g}" for name, value in (event.get("metrics") or {}).items())
