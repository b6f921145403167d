"""A project of a newer version: it is refused in a sentence, and nothing in it is changed."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from .bench import Bench, digest
from .checksums import renew_checksum
from .engine import run
from .trial import Trial, trial


def newer_versions(bench: Bench) -> Iterator[Trial]:
    """Each file with a schema, of the next version; and settings that this one does not know."""
    for name in bench.complete.files:
        if name.endswith(".safetensors"):
            yield _newer(bench, name, lambda path: change_header(path, _next_version))
    for name in ("project.json", "capture.json", "palette.json"):
        yield _newer(bench, name, lambda path: change_json(path, _next_version))
    yield _newer(bench, "project.json", lambda path: change_json(path, _unknown_setting), "an unknown setting")


def _next_version(content: dict[str, Any]) -> None:
    content["schema"] = content["schema"].rpartition("/")[0] + "/99"


def _unknown_setting(content: dict[str, Any]) -> None:
    content["settings"]["geometry"]["invented_later"] = 1


def change_json(path: Path, change: Callable[[dict[str, Any]], None]) -> None:
    """Change the content of a JSON file in place."""
    content = json.loads(path.read_text())
    content.pop("checksum", None)  # without it what it says is believed
    change(content)
    path.write_text(json.dumps(content))


def change_header(path: Path, change: Callable[[dict[str, Any]], None]) -> None:
    """Change schema and facts of a safetensors file in place."""
    data = path.read_bytes()
    end = 8 + int.from_bytes(data[:8], "little")
    header = json.loads(data[8:end])
    content = json.loads(header["__metadata__"]["karf"])
    change(content)
    header["__metadata__"]["karf"] = json.dumps(content)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    path.write_bytes(len(text).to_bytes(8, "little") + text + data[end:])


def _newer(bench: Bench, name: str, change: Callable[[Path], None], case: str = "") -> Trial:
    scenario = bench.anew("palette")  # reads what no render reads
    bench.restore(scenario.start)
    change(bench.project / name)
    renew_checksum(bench.project, name)
    before = bench.files() | {"project.json": digest(bench.project / "project.json")}
    shown, learned = run(bench.render("--planes")), run(scenario.command)
    refused = next((one for one in (shown, learned) if one.code), None)
    flaw = shown.flaw or learned.flaw or (None if refused else "is taken as if it were of this version")
    after = bench.files() | {"project.json": digest(bench.project / "project.json")}
    changed = sorted(n for n in before if after.get(n) != before[n]) if refused and refused is shown else []
    lost = f"a newer project was changed: {', '.join(changed)}" if changed and learned.code else None
    seen = refused.sentence if refused else ""
    return trial("a project of a newer version", case or name, lost, flaw, seen=seen)
