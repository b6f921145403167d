"""What failed, or what a test found, as a text that may be given to others: without the user's names. No bpy."""

import getpass
import platform
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from ..engine_api import REQUEST_FILE, EventReader, Finding, KarfError, read_json
from .failures import log_tail

SHORTEST_NAME = 3  # letters of a name: shorter ones are found in every text
LETTER = r"[^\W\d_]"
LOGIN = re.compile(r"""(?<=://)[^\s/?#"'<>]+@""")


def compose(job: Path, sentence: str, versions: Mapping[str, str]) -> str:
    """The report of the failed job in this folder, which may be gone. versions: of the programs at work, by name."""
    ending = {"Engine": _engine(job), "Stage": _stage(job), "Ended": sentence}
    return _text({**versions, **ending, "Log": f"\n{log_tail(job) or 'none'}"})


def compose_findings(findings: Sequence[Finding], versions: Mapping[str, str]) -> str:
    """The report of a test of the engine. versions: of the programs at work, by name."""
    return _text({**versions, "Test": "".join(f"\n{finding.to_text()}" for finding in findings)})


def _text(entries: Mapping[str, str]) -> str:
    entries = {"System": platform.platform(), **entries}
    return anonymous("".join(f"{name}: {value}\n" for name, value in entries.items()))


def anonymous(text: str) -> str:
    """The text without the names of the user's own folder, of the user and of the computer, and without logins in URLs."""
    text = LOGIN.sub("<login>@", without_home(text, str(Path.home())))
    for name, stand_in in ((_user(), "<user>"), (platform.node(), "<computer>")):
        text = without_name(text, name, stand_in)
    return text


def without_home(text: str, home: str) -> str:
    """The text with `~` for the user's own folder, also where its backslashes are doubled, or more follows its name."""
    home = home.rstrip("/\\")
    spellings = {home, home.replace("\\", "\\\\"), home.replace("\\", "/")} - {""}
    for spelling in spellings:
        text = re.sub(rf"{re.escape(spelling)}(?!{LETTER})", "~", text)
    return text


def without_name(text: str, name: str, stand_in: str) -> str:
    """The text with a stand-in for a name between whatever is no letter, such as in `<name>_tmp`."""
    if len(name) < SHORTEST_NAME:
        return text
    return re.sub(rf"(?<!{LETTER}){re.escape(name)}(?!{LETTER})", stand_in, text, flags=re.IGNORECASE)


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):  # no such user is known, as in containers
        return ""


def _engine(job: Path) -> str:
    try:
        hello = next((event.values for event in EventReader(job).poll() if event.kind == "hello"), None)
    except OSError:
        hello = None
    return ", ".join(f"{name} {value}" for name, value in hello.items()) if hello else "said nothing"


def _stage(job: Path) -> str:
    try:
        return str(read_json(job / REQUEST_FILE, "request")["stage"])
    except (OSError, KarfError, LookupError, TypeError):
        return "unknown"
