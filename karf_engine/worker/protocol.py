"""The protocol between a caller (Blender, a script) and a worker, a child process of the engine.

A job is a folder. The caller writes `request.json`; the worker appends one JSON object per line to `events.jsonl` and
leaves stray output in `engine.log`. A file cannot block, survives either side's crash and is readable by a person.

The caller writes lines to the worker's standard input, which also serves as its lifeline:

- `cancel`, or the end of input, asks it to stop.
- A job's folder (`folder_line`) is the next job, for a worker that waits after a finished one.
- A query (`Query.encode`) is answered by a job of the stage `warm` with one event: answer or refused, or dropped where a
  later query of the same kind arrived first. The job is done when no query arrives for a while.

Events: hello, stage, progress, preview, artifact, warning, error, done, cancelled, answer, refused, dropped. Exit codes
are those of `errors`, 0 for done and 70 for an internal error; anything else is a crash.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..commands.options import COMMANDS
from ..errors import BadRequest, DataError, Message
from ..io.files import MAX_JSON_BYTES, check_file, errors_naming_path

PROTOCOL = 1
REQUEST_FILE = "request.json"
EVENTS_FILE = "events.jsonl"
LOG_FILE = "engine.log"
WARM = "warm"  # the stage that answers queries; see `karf_engine.worker.queries`
STAGES = (*COMMANDS, WARM)
FINAL_EVENTS = ("done", "error", "cancelled")
CANCEL = "cancel"
EVENT_VALUES: dict[str, dict[str, Any]] = {  # the values that every event of a kind has; there may be more
    "hello": {"protocol": int},
    "stage": {"name": str},
    "progress": {"stage": str, "step": int, "total": int, "metrics": dict},
    "preview": {"path": str},
    "artifact": {"kind": str, "path": str},
    "warning": {"code": str, "sentence": str},
    "error": {"code": str, "sentence": str, "hint": str},
    "cancelled": {"sentence": str},
    "answer": {"id": int},
    "refused": {"id": int, "code": str, "sentence": str, "hint": str},
    "dropped": {"id": int},
}


@dataclass(frozen=True)
class Request:
    """A job's task; the options are those of `commands.options.COMMANDS`, or of `worker.loop.WarmOptions`."""

    stage: str  # one of `STAGES`
    project: Path
    options: dict[str, Any] = field(default_factory=dict)  # JSON values, paths absolute

    def write(self, job: Path) -> Path:
        """Write `request.json` into the folder `job`, making it if needed, and return the file's path."""
        job.mkdir(parents=True, exist_ok=True)
        path = job / REQUEST_FILE
        content = {"protocol": PROTOCOL, "stage": self.stage, "project": str(self.project), "options": self.options}
        with errors_naming_path(path):
            path.write_text(json.dumps(content, indent=1), encoding="utf-8")
        return path

    @classmethod
    def read(cls, job: Path) -> Request:
        """Read `job/request.json`. Raises DataError where it is unreadable, BadRequest for another protocol or stage."""
        path = job / REQUEST_FILE
        check_file(path, MAX_JSON_BYTES)
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            protocol, stage = content["protocol"], content["stage"]
            request = cls(stage, Path(content["project"]), dict(content.get("options", {})))
        except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
            raise DataError(f"{path} is not a readable request ({error!s:.200}).", "Start the job again.") from error
        if protocol != PROTOCOL:
            raise BadRequest(
                f"{path} speaks protocol {protocol}, this engine speaks {PROTOCOL}.", "Update the older side."
            )
        if stage not in STAGES:
            raise BadRequest(f"Unknown stage {stage!r:.200}.", f"Use one of: {', '.join(STAGES)}.")
        return request


@dataclass(frozen=True)
class Query:
    """A short question about a project."""

    number: int  # the caller's, which the answer repeats
    kind: str  # one of `worker.queries.QUERIES`
    options: dict[str, Any]  # JSON values, paths absolute

    def encode(self) -> str:
        """Return one line of JSON, without the line end."""
        return json.dumps({"id": self.number, "kind": self.kind, "options": self.options})


def folder_line(job: Path) -> str:
    """Return the line that gives a waiting worker its next job, without the line end."""
    return json.dumps(str(job))


def decode_line(line: str) -> Query | str:
    """Parse a line of standard input: a query, or the folder of the next job. Raises BadRequest for other lines."""
    try:
        content = json.loads(line)
    except (ValueError, RecursionError):
        content = None
    if isinstance(content, str):
        return content
    number, kind, options = map(content.get, ("id", "kind", "options")) if isinstance(content, dict) else (None,) * 3
    if type(number) is not int or type(kind) is not str or type(options) is not dict:
        raise BadRequest(
            f"{line!r:.200} is neither a job's folder nor a query.",
            "Write a path as JSON text, or an object with a number, a kind and options.",
        )
    return Query(number, kind, options)


@dataclass(frozen=True)
class Event:
    """One line of `events.jsonl`: a kind, a running number, seconds since the epoch, and the kind's values.

    Values that are a `Message` are also written with key and values, under `messages`, for translation.
    """

    kind: str
    number: int
    time: float
    values: dict[str, Any]

    def __getitem__(self, key: str) -> Any:
        return self.values[key]

    def get(self, key: str, default: Any = None) -> Any:
        return self.values.get(key, default)

    @property
    def is_final(self) -> bool:
        return self.kind in FINAL_EVENTS

    def encode(self) -> str:
        """Return one line of JSON, without the line end."""
        content = {"t": self.kind, "n": self.number, "time": round(self.time, 3), **self.values}
        messages = {name: value.to_json() for name, value in self.values.items() if isinstance(value, Message)}
        return json.dumps(content | ({"messages": messages} if messages else {}))

    @classmethod
    def decode(cls, line: str) -> Event:
        """Parse one line. Raises ValueError for other lines."""
        try:
            content = json.loads(line)
            if not isinstance(content, dict) or not {"t", "n", "time"} <= content.keys():
                raise ValueError(f"no event: {line!r}")
            messages = content.pop("messages", {})
            if not isinstance(messages, dict):
                raise ValueError("messages were expected by their names")
            content |= {name: Message.from_json(message) for name, message in messages.items()}
        except RecursionError as error:
            raise ValueError("brackets without end") from error
        event = cls(content.pop("t"), content.pop("n"), content.pop("time"), content)
        if not event._is_valid():
            raise ValueError(f"an event of other values: {line!r}")
        return event

    def _is_valid(self) -> bool:
        """Return whether the values have the types that readers rely on; a line may be damaged."""
        if not isinstance(self.kind, str) or not isinstance(self.time, int | float):
            return False
        metrics = self.get("metrics") or {}
        numbers = [self.get("eta_s") or 0.0, *(metrics.values() if isinstance(metrics, dict) else [metrics])]
        known = EVENT_VALUES.get(self.kind, {})
        has_known = all(isinstance(self.get(name), kind) for name, kind in known.items())
        return has_known and all(isinstance(value, int | float) for value in numbers)


class EventWriter:
    """Appends events to a job's file and flushes each at once."""

    def __init__(self, job: Path) -> None:
        self._path = job / EVENTS_FILE
        self._stream = self._path.open("a", encoding="utf-8")
        self._number = 0

    def __call__(self, kind: str, /, **values: Any) -> None:
        try:
            with errors_naming_path(self._path):
                self._stream.write(Event(kind, self._number, time.time(), values).encode() + "\n")
                self._stream.flush()
        except OSError:
            # discard unwritten data, which the interpreter would try to write again at exit, and print a traceback
            with suppress(OSError):
                self._stream.close()
            self._stream = self._path.open("a", encoding="utf-8")
            raise
        self._number += 1


class EventReader:
    """Reads a job's events as they are appended, complete lines only."""

    def __init__(self, job: Path) -> None:
        self._path = job / EVENTS_FILE
        self._offset = 0

    def poll(self) -> Iterator[Event]:
        """Yield the events that arrived since the last call, skipping lines that are not events."""
        if not self._path.is_file():
            return
        with self._path.open("rb") as stream:
            stream.seek(self._offset)
            data = stream.read()
        end = data.rfind(b"\n") + 1
        self._offset += end
        for line in data[:end].decode("utf-8", "replace").splitlines():
            try:
                yield Event.decode(line)
            except ValueError:
                continue
