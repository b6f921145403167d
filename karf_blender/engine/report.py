"""A failed job as a text that may be given to others: versions, how it ended, the end of its log. No bpy."""

import json
import platform
import re
from collections.abc import Mapping
from pathlib import Path

from ..engine_api import REQUEST_FILE, EventReader
from . import jobs


def compose(job: Path, sentence: str, versions: Mapping[str, str]) -> str:
    """The report of the job in this folder, which may be gone. versions: of the programs at work, by name."""
    entries = {
        **versions,
        "System": platform.platform(),
        "Engine": _engine(job),
        "Stage": _stage(job),
        "Ended": sentence,
        "Log": f"\n{jobs.log_tail(job) or 'none'}",
    }
    return without_home("".join(f"{name}: {value}\n" for name, value in entries.items()), str(Path.home()))


def without_home(text: str, home: str) -> str:
    """The text with `~` for the user's own folder, also where its backslashes are doubled."""
    home = home.rstrip("/\\")
    spellings = {home, home.replace("\\", "\\\\"), home.replace("\\", "/")} - {""}
    for spelling in spellings:
        text = re.sub(re.escape(spelling) + r"(?=$|[^\w.-])", "~", text, flags=re.MULTILINE)
    return text


def _engine(job: Path) -> str:
    try:
        hello = next((event.values for event in EventReader(job).poll() if event.kind == "hello"), None)
    except OSError:
        hello = None
    return ", ".join(f"{name} {value}" for name, value in hello.items()) if hello else "said nothing"


def _stage(job: Path) -> str:
    try:
        return str(json.loads((job / REQUEST_FILE).read_text(encoding="utf-8"))["stage"])
    except (OSError, ValueError, LookupError, TypeError):
        return "unknown"
