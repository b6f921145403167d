"""Feed every reader nearly right files: python3 tools/dev.py fuzz [READER ...] [--seconds N | --mutants N] [--out DIR].

A reader is named by a part of its name. Each runs in child processes with limits of time and memory; what must never
happen (see tools/reliability/fuzz/watch.py) is a finding, and the file that caused it is kept in DIR. A run over all
readers that is given --seconds also writes docs/reliability/fuzz.json and the page docs/reliability.md. The exit code
is 1 where anything was found.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path
from typing import Any

from .. import page
from ..faults import engine
from .readers import Bed, Reader, readers
from .samples import learned_project
from .watch import SECONDS

PATIENCE = SECONDS + 10  # seconds without a new file after which a process hangs in what no signal reaches
SECONDS_BY_DEFAULT = 300.0


def main() -> int:
    options = parse_arguments()
    start = time.monotonic()
    engine.prepare()
    out = Path(options.out).absolute()
    with tempfile.TemporaryDirectory(prefix="karf-fuzz-") as folder:
        chosen = [r for r in readers(learned_project(Path(folder))) if _is_wanted(r.name, options.readers)]
        seconds, mutants = shares(chosen, options)
        rows = [fuzz(r, Path(folder), seconds.get(r.name), mutants.get(r.name), options.seed, out) for r in chosen]
    report = {"made": [page.made(start, sys.argv[1:], "fuzz")], "rows": rows}
    out.mkdir(parents=True, exist_ok=True)
    (out / "fuzz.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    if options.seconds and not options.readers:
        page.write("fuzz", report)
    print(
        f"{sum(row['executions'] for row in rows)} files, {sum(len(row['findings']) for row in rows)} different flaws"
    )
    return int(any(row["findings"] for row in rows))


def shares(chosen: list[Reader], options: argparse.Namespace) -> tuple[dict[str, float], dict[str, int]]:
    """Seconds or files of each reader: slow ones get more of the time, or fewer files."""
    if options.mutants:
        return {}, {r.name: max(1, options.mutants // (10 if r.is_slow else 1)) for r in chosen}
    weights = {r.name: 3 if r.is_slow else 1 for r in chosen}
    return {name: options.seconds * weight / sum(weights.values()) for name, weight in weights.items()}, {}


def _is_wanted(name: str, parts: list[str]) -> bool:
    return not parts or any(part in name for part in parts)


def fuzz(
    reader: Reader, folder: Path, seconds: float | None, mutants: int | None, seed: int, out: Path
) -> dict[str, Any]:
    """One reader's row: it resumes in a new process where a file has ended the old one."""
    end = time.monotonic() + seconds if seconds else None
    counts: Counter[str] = Counter()
    findings: Counter[str] = Counter()
    number = 0
    while (end is None or time.monotonic() < end) and (mutants is None or counts["executions"] < mutants):
        rest = None if mutants is None else mutants - counts["executions"]
        bed_folder = folder / f"bed_{number}"
        told, death = _in_child(reader, bed_folder, end, rest, seed + number, out)
        counts.update(told["counts"])
        findings.update(told["findings"])
        if death:
            counts["executions"] += 1
            findings[death] += 1
            _keep_current(bed_folder, reader, death, out)
        shutil.rmtree(bed_folder, ignore_errors=True)
        number += 1
    row = {"reader": reader.name, **{k: counts[k] for k in ("executions", "accepted", "refused")}}
    print(
        f"{reader.name}: {counts['executions']} files, {counts['accepted']} read, {counts['refused']} refused",
        flush=True,
    )
    for finding, count in findings.most_common():
        print(f"    {count} x {finding}", flush=True)
    return row | {"findings": dict(findings)}


def _in_child(
    reader: Reader, folder: Path, end: float | None, mutants: int | None, seed: int, out: Path
) -> tuple[dict[str, Any], str | None]:
    """What a child told before it ended, and how it died where it did."""
    folder.mkdir()
    told = folder / "told.json"
    told.write_text(json.dumps({"counts": {}, "findings": {}}))
    process = os.fork()
    if not process:
        _read_many(reader, folder, end, mutants, seed, out)
    last = time.monotonic()
    while True:
        ended, status = os.waitpid(process, os.WNOHANG)
        if ended:
            code = os.waitstatus_to_exitcode(status)
            if (folder / "fault_of_the_tool.txt").exists():
                raise RuntimeError((folder / "fault_of_the_tool.txt").read_text())
            return json.loads(told.read_text()), f"the process dies ({_cause(code)})" if code else None
        last = max(last, time.monotonic() - (time.time() - told.stat().st_mtime))
        if time.monotonic() - last > PATIENCE:
            os.kill(process, signal.SIGKILL)
            os.waitpid(process, 0)
            return json.loads(told.read_text()), f"hangs for more than {PATIENCE} s"
        time.sleep(0.01)


def _cause(code: int) -> str:
    return signal.Signals(-code).name if code < 0 else f"exit code {code}"


def _read_many(reader: Reader, folder: Path, end: float | None, mutants: int | None, seed: int, out: Path) -> None:
    """In a child: change and read until the time or the number is reached, and tell every time."""
    code = 1
    try:
        _silence()
        chance = random.Random(f"{reader.name} {seed}")
        bed = Bed(reader, folder)
        counts: Counter[str] = Counter()
        findings: Counter[str] = Counter()
        temporary, told = folder / "telling.json", folder / "told.json"
        while (end is None or time.monotonic() < end) and (mutants is None or counts["executions"] < mutants):
            before = chance.getstate()
            outcome = bed.try_one(chance)
            counts.update(["executions", "refused" if outcome.refused else "accepted"])
            if outcome.finding:
                counts.subtract(["refused" if outcome.refused else "accepted"])
                if outcome.finding not in findings:
                    _keep(bed, before, outcome.finding, out)
                findings[outcome.finding] += 1
            temporary.write_text(json.dumps({"counts": counts, "findings": findings}))
            temporary.replace(told)
        code = 0
    except BaseException:  # of this tool: the readers' are outcomes
        (folder / "fault_of_the_tool.txt").write_text(traceback.format_exc())
    finally:
        os._exit(code)


def _silence() -> None:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for number in (1, 2):
        os.dup2(nowhere, number)


def _keep(bed: Bed, before: tuple, finding: str, out: Path) -> None:
    """Make the file that was found once more, and keep it."""
    chance = random.Random()
    chance.setstate(before)
    name = chance.choice(bed.reader.files)
    data = bed.reader.mutator((bed.folder / name).read_bytes(), chance)
    _write_found(bed.reader, name, data, finding, out)


def _keep_current(folder: Path, reader: Reader, finding: str, out: Path) -> None:
    """Keep the file on which a process died: the one that differs from its valid twin."""
    for name in reader.files:
        changed, valid = folder / "files" / name, folder / "valid" / name
        if changed.exists() and valid.exists() and changed.read_bytes() != valid.read_bytes():
            _write_found(reader, name, changed.read_bytes(), finding, out)


def _write_found(reader: Reader, name: str, data: bytes, finding: str, out: Path) -> None:
    folder = out / re.sub(r"\W+", "_", reader.name)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{re.sub(r'[^a-zA-Z]+', '_', finding)[:80]}{Path(name).suffix}"
    path.write_bytes(data)


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("readers", nargs="*", metavar="READER", help="parts of readers' names (default: all)")
    parser.add_argument("--seconds", type=float, help=f"for all readers together (default: {SECONDS_BY_DEFAULT:.0f})")
    parser.add_argument("--mutants", type=int, help="changed files for each reader, in place of a time")
    parser.add_argument("--seed", type=int, default=0, help="seed of all chance (default: %(default)s)")
    parser.add_argument("--out", default="fuzz_out", metavar="DIR", help="findings (default: %(default)s)")
    options = parser.parse_args()
    if options.seconds is None and options.mutants is None:
        options.seconds = SECONDS_BY_DEFAULT
    return options


if __name__ == "__main__":
    sys.exit(main())
