"""Sentences and reports about failures: refused files, a failed job's log, reports without the user's names. No bpy."""

import getpass
import platform
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from ..engine_api import LOG_FILE, REQUEST_FILE, DataError, EventReader, Finding, KarfError, read_json

LOG_LINES, LOG_BYTES = 30, 20_000  # of a log's end; lines may be long
SHORTEST_NAME = 3  # letters of a name: shorter ones are in every text
LETTER = r"[^\W\d_]"
LOGIN = re.compile(r"""(?<=://)[^\s/?#"'<>]+@""")


def log_tail(folder: Path) -> str:
    """Return the last lines of a job's log; empty where there is none. Never raises."""
    try:
        with (folder / LOG_FILE).open("rb") as stream:
            stream.seek(max(0, stream.seek(0, 2) - LOG_BYTES))
            lines = stream.read().decode("utf-8", "replace").splitlines()
    except OSError:
        return ""
    return "\n".join(lines[-LOG_LINES:])


def disk_error(error: OSError) -> DataError:
    return DataError(
        f"{error.filename or 'The disk'}: {error.strerror or error}.",
        "Check free space, the drive's connection and your write permission, or choose another folder.",
    )


@contextmanager
def disk_errors() -> Iterator[None]:
    """Turn what the operating system refuses inside this block into a DataError."""
    try:
        yield
    except OSError as error:
        raise disk_error(error) from error


# --- reports -----------------------------------------------------------------------------------------------------------
def compose(job: Path, sentence: str, versions: Mapping[str, str]) -> str:
    """Report the failed job in this folder, which may be gone."""
    ending = {"Engine": _engine(job), "Stage": _stage(job), "Ended": sentence}
    return _text({**versions, **ending, "Log": f"\n{log_tail(job) or 'none'}"})


def compose_findings(findings: Sequence[Finding], versions: Mapping[str, str]) -> str:
    """Report a test of the engine."""
    return _text({**versions, "Test": "".join(f"\n{finding.to_text()}" for finding in findings)})


def _text(entries: Mapping[str, str]) -> str:
    entries = {"System": platform.platform(), **entries}
    return anonymous("".join(f"{name}: {value}\n" for name, value in entries.items()))


def anonymous(text: str) -> str:
    """Replace the user's own folder, the user, the computer, and logins in URLs."""
    text = LOGIN.sub("<login>@", without_home(text, str(Path.home())))
    for name, placeholder in ((_user(), "<user>"), (platform.node(), "<computer>")):
        text = without_name(text, name, placeholder)
    return text


def without_home(text: str, home: str) -> str:
    """Write `~` for the user's own folder, also where its backslashes are doubled, or more follows its name."""
    home = home.rstrip("/\\")
    spellings = {home, home.replace("\\", "\\\\"), home.replace("\\", "/")} - {""}
    for spelling in spellings:
        text = re.sub(rf"{re.escape(spelling)}(?!{LETTER})", "~", text)
    return text


def without_name(text: str, name: str, placeholder: str) -> str:
    """Replace a name between whatever is not a letter, such as in `<name>_tmp`."""
    if len(name) < SHORTEST_NAME:
        return text
    return re.sub(rf"(?<!{LETTER}){re.escape(name)}(?!{LETTER})", placeholder, text, flags=re.IGNORECASE)


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
