"""Run the tests on other versions: python3 tools/dev.py matrix [CELL ...] [--quick] [--out FILE]; --wheels; --list; --clean.

A cell is a Blender (as a Python module) with the extension's tests, or a Python with the engine's tests: on the lowest
versions that pyproject.toml allows, or the newest that the index has. Without names: all, one after the other.

Each gets an environment of its own under .venv/matrix/, made by uv, which --clean removes. A cell whose interpreter is
not installed, or whose packages cannot be downloaded, is skipped with the reason; the exit code is 1 where a test
failed or no versions of the packages go together. Results go to docs/versions.json and the table of docs/versions.md,
where the cells that ran replace their lines; with --out to another file alone. --wheels only asks the index for which
systems and Pythons it has all of the engine's packages.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict
from datetime import date
from pathlib import Path

from . import environments, page, running, wheels
from .cells import Cell, all_cells


def main() -> int:
    cells = {cell.name: cell for cell in all_cells()}
    options = parse_arguments(cells)
    if options.list:
        print("\n".join(map(describe, cells.values())))
        return 0
    if options.clean:
        environments.clean()
        return 0
    made, out = made_now(), Path(options.out).absolute()
    if options.wheels:
        page.write_wheels(wheels.ask(), made, out)
        return 0
    results, earlier = [], {}
    for name in options.cells or cells:
        print(f"--- {describe(cells[name])}", flush=True)
        results.append(running.run(cells[name], options.quick, earlier))
        running.show(results[-1])
        page.write_cells([asdict(results[-1])], made, out)
    print()
    for result in results:
        running.show(result)
    bad = ("failed", "skipped") if options.strict else ("failed",)
    return int(any(result.status in bad for result in results))


def made_now() -> str:
    """Today, and the command that is running."""
    return f"{date.today().isoformat()}, `{' '.join(['python3 tools/dev.py matrix', *sys.argv[1:]])}`"


def describe(cell: Cell) -> str:
    """One line on a cell."""
    versions = cell.requirements[0] if cell.has_blender else f"{cell.resolution} versions of its packages"
    return f"{cell.name}: {cell.tests} on Python {cell.python}, {versions}"


def parse_arguments(known: dict[str, Cell]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python3 tools/dev.py matrix", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("cells", nargs="*", metavar="CELL", help=f"which (default: all): {', '.join(known)}")
    parser.add_argument("--quick", action="store_true", help="leave slow tests of the engine out")
    parser.add_argument("--out", default=page.RESULTS, metavar="FILE", help="results as JSON")
    parser.add_argument("--strict", action="store_true", help="a skipped cell counts as a failed one")
    parser.add_argument("--wheels", action="store_true", help="only ask for which systems there are all packages")
    parser.add_argument("--list", action="store_true", help="only list the cells")
    parser.add_argument("--clean", action="store_true", help="only remove the environments")
    options = parser.parse_args()
    unknown = set(options.cells) - set(known)
    if unknown:
        parser.error(f"unknown cells: {', '.join(sorted(unknown))}; known: {', '.join(known)}")
    return options


if __name__ == "__main__":
    sys.exit(main())
