"""Measure every published table and write the pages that show them: python3 tools/dev.py evaluate [PART ...].

Without names all parts are run that are not current: tables whose modules have changed since, and scenes that are not
drawn and learned yet. It first says how many hours that takes. A run that was stopped goes on where it ended. Each table
becomes docs/results/<part>.json; docs/benchmark.md and README.md show them.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path

from . import pages
from .jobs import JOBS, TABLES, to_run
from .sources import ROOT, changed
from .store import Store
from .table import read, write


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(name for name in JOBS if "_2" not in name))
    parser.add_argument("--out", type=Path, default=Path("evaluate_out"), help="what is learned (default: %(default)s)")
    parser.add_argument("--workers", type=int, default=1, help="parts that run at once (default: %(default)s)")
    parser.add_argument("--threads", type=int, default=1, help="processor threads of each (default: %(default)s)")
    parser.add_argument("--plan", action="store_true", help="only say what would be run, and how long it takes")
    parser.add_argument("--pages", action="store_true", help="only write the pages again")
    parser.add_argument("--run", choices=tuple(JOBS), help=argparse.SUPPRESS)  # one part, in this process
    options = parser.parse_args()
    unknown = [name for name in options.parts if name not in JOBS]
    if unknown:
        parser.error(f"unknown: {', '.join(unknown)}; choose from {', '.join(JOBS)}")
    if options.run:
        run_part(options.run, Store(options.out, options.threads))
        return 0
    if not options.pages:
        store = Store(options.out, options.threads)
        parts = to_run(options.parts or [*TABLES], lambda name: is_current(name, store))
        minutes = sum(JOBS[name].minutes for name in parts)
        print(f"{len(parts)} parts, about {minutes / 60:.1f} processor hours: {' '.join(parts)}", flush=True)
        failed = [] if options.plan else run_all(parts, options)
        if options.plan or failed:
            return len(failed)
    pages.write()
    return 0


def is_current(name: str, store: Store) -> bool:
    """Test whether a part's result is there, and made by the modules as they are now."""
    job = JOBS[name]
    if job.result:
        return store.is_current(job.result)
    table = read(name)
    return bool(table) and not changed(table["made"]["sources"])


def run_all(parts: list[str], options: argparse.Namespace) -> list[str]:
    """Run the parts, each in a process of its own, as many at once as there are workers; return those that failed."""
    logs = options.out / "logs"
    logs.mkdir(parents=True, exist_ok=True)
    waiting, running, failed = list(parts), {}, []
    while waiting or running:
        for name in [name for name in waiting if set(JOBS[name].needs) & set(failed)]:
            waiting.remove(name)
            failed.append(name)
            print(f"{name}: not run, for what it needs failed", flush=True)
        ready = [name for name in waiting if not set(JOBS[name].needs) & {*waiting, *running}]
        for name in ready[: options.workers - len(running)]:
            waiting.remove(name)
            running[name] = start_part(name, options, logs)
        time.sleep(1)
        for name in [name for name, process in running.items() if process.poll() is not None]:
            if running.pop(name).returncode:
                failed.append(name)
                print(f"{name}: failed, see {logs / name}.txt", flush=True)
            else:
                print(f"{name}: done, {len(waiting) + len(running)} parts left", flush=True)
    return failed


def start_part(name: str, options: argparse.Namespace, logs: Path) -> subprocess.Popen:
    """Start a part in a process of its own; what it prints goes to a file."""
    given = ("--run", name, "--out", str(options.out), "--threads", str(options.threads))
    with (logs / f"{name}.txt").open("w") as log:
        return subprocess.Popen([sys.executable, "-m", __package__, *given], cwd=ROOT, stdout=log, stderr=log)


def run_part(name: str, store: Store) -> None:
    """Run a part in this process; a table is stored with the modules that ran for it."""
    store.trace.start()
    start = time.process_time()
    table = JOBS[name].run(store)
    store.trace.stop()
    if table is not None:
        write(name, table, store.all_sources(), time.process_time() - start)


if __name__ == "__main__":
    sys.exit(main())
