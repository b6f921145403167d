"""Throw faults at the engine and see what is lost: python3 tools/dev.py faults [NAME ...] [--kills N] [--seed N] [--out DIR].

    kills      killed (SIGKILL) and cancelled at random moments, in all stages, first learned and learned anew
    events     killed before each single change of a file
    disk       no room: simulated at each change of a file, by a limit of file sizes, and truly where we may mount
    folders    the project moved, deleted, not writable; photos gone; impossible folders
    memory     little memory, in every stage
    damage     each file with flipped bits, cut off, empty, gone, with NaN
    locks      two engines at once, a render meanwhile, locks left behind
    versions   projects of a newer version

Without names: all, which takes about a quarter of an hour on one core. After each fault: the project opens, what is
noted as finished holds exactly its own files and shows exactly its own pictures, and the same command completes it.
All findings are written to DIR/faults.json. Without --quick they also go to docs/reliability/faults.json and the page
docs/reliability.md, where a run of some families replaces their rows. The exit code is 1 where anything was lost or went wrong.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path

from .. import page
from . import damage, disk, engine, folders, kills, locks, memory, schemas
from .bench import Bench
from .trial import Trial, rows


def families(options: argparse.Namespace) -> dict[str, list[Callable[[Bench], Iterable[Trial]]]]:
    """The faults by name. With --quick a few of each kind."""
    few, seed = options.quick, options.seed
    return {
        "kills": [
            lambda bench: kills.random_kills(bench, options.kills, seed),
            lambda bench: kills.cancels(bench, max(1, options.kills // 5), seed),
        ],
        "events": [lambda bench: kills.kills_at_events(bench, few)],
        "disk": [
            lambda bench: disk.full_at_events(bench, few),
            lambda bench: disk.small_files(bench, few),
            lambda bench: disk.full_disk(bench, few),
        ],
        "folders": [lambda bench: folders.folders(bench, few)],
        "memory": [lambda bench: memory.memory_limits(bench, few)],
        "damage": [lambda bench: damage.damaged_files(bench, 1 if few else 6, few, seed)],
        "locks": [lambda bench: locks.locks(bench, few, seed)],
        "versions": [lambda bench: schemas.newer_versions(bench)],
    }


def main() -> int:
    options = parse_arguments()
    engine.prepare()
    start = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="karf-faults-") as folder:
        bench = Bench(Path(folder))
        print(f"learned {len(bench.states)} right states in {time.monotonic() - start:.0f} s", flush=True)
        found = []
        chosen = families(options)
        for name in options.names or chosen:
            for throw in chosen[name]:
                found += [show({"family": name, **row}) for row in rows(throw(bench), bench.folder)]
    report = {"made": [page.made(start, sys.argv[1:], "faults")], "rows": found}
    out = Path(options.out)
    out.mkdir(parents=True, exist_ok=True)
    (out / "faults.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    if not options.quick:
        page.write("faults", with_earlier(report, list(chosen)) if options.names else report)
    return int(any(row["lost"] or row["flaws"] for row in found))


def with_earlier(report: dict, order: list[str]) -> dict:
    """The stored report, with the rows of these families in the place of theirs."""
    earlier, families = page.read("faults"), {row["family"] for row in report["rows"]}
    kept = [row for row in earlier["rows"] if row["family"] not in families]
    rows = sorted(kept + report["rows"], key=lambda row: order.index(row["family"]))
    return {"made": earlier["made"] + report["made"], "rows": rows}


def show(row: dict) -> dict:
    """Print one fault's result, and what failed."""
    print(f"{row['fault']}: {row['tries']} tries, lost data {row['lost']}, other flaws {row['flaws']}", flush=True)
    for failure, count in row["failures"].items():
        print(f"    {count} x {failure}", flush=True)
    return row


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="which faults (default: all)")
    parser.add_argument("--kills", type=int, default=200, help="random kills (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="seed of all chance (default: %(default)s)")
    parser.add_argument("--out", default="faults_out", metavar="DIR", help="findings (default: %(default)s)")
    parser.add_argument("--quick", action="store_true", help="a few of each: what the tests run")
    options = parser.parse_args()
    unknown = set(options.names) - set(families(options))
    if unknown:
        parser.error(f"unknown faults: {', '.join(sorted(unknown))}; known: {', '.join(families(options))}")
    return options


if __name__ == "__main__":
    sys.exit(main())
