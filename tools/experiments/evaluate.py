"""The paper's tables on the demo capture: python3 tools/dev.py evaluate [TABLE ...] [--threads N] [--out DIR].

    segmentation   Table 1: IoU and accuracy, beside plain cross-entropy, other heads and the ceiling
    outside        Table 2: what an edit changes outside its objects
    consistency    Table 3: how alike two views show an edited surface
    ablations      Table 4 and Fig. 7, 8: layers, parts of Eq. 6, supervision, palettes
    sampling       the surface cache beside nearly dense samples
    decomposition  the 2-D weights that F_w is taught, beside LoCoPalettes'
    edits          recolors against the true ones, beside other ways to recolor
    marked_photo   the same in the one photo that is marked: rough 2-D masks against ours
    matched        swatches matched to one painted test photo, in the other ones
    whole_paper    the preset `paper` from photos to recolors, narrower, beside ours; an hour

Without names: all. The demo is learned once into DIR/project (kept between runs); every other way shares its geometry
and whatever stage it does not change. Writes docs/results/<table>.json and some pictures, and from these
docs/results.md and *.csv.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from karf_engine.project.settings import PRESETS

from . import page
from .ablations import ablations_table, decomposition_table
from .bench import Bench
from .consistency import consistency_table
from .edits import edits_table, marked_photo_table, matched_table, outside_table
from .pictures import STRIPS
from .segmentation import sampling_table, segmentation_table
from .stamp import stamp
from .table import Table, show
from .whole_paper import whole_paper_table

TABLES: dict[str, Callable[[Bench], Table]] = {
    "segmentation": segmentation_table,
    "outside": outside_table,
    "consistency": consistency_table,
    "ablations": ablations_table,
    "sampling": sampling_table,
    "decomposition": decomposition_table,
    "edits": edits_table,
    "marked_photo": marked_photo_table,
    "matched": matched_table,
    "whole_paper": whole_paper_table,
}


def main() -> None:
    options = parse_arguments()
    bench = Bench(options)
    for name in options.tables or TABLES:
        if not options.pictures:
            start = time.monotonic()
            table = TABLES[name](bench)
            show(name, table)
            if not options.dry:
                page.write_table(name, as_json(name, table, options, round(time.monotonic() - start)))
        if name in STRIPS and not options.dry:
            strip = STRIPS[name](bench)
            strip.write(page.FOLDER / f"{name}.jpg")
            page.write_caption(name, strip.caption)


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="*", metavar="TABLE", help=", ".join(TABLES))
    parser.add_argument("--out", type=Path, default=Path("evaluate_out"), help="what is learned (default: %(default)s)")
    parser.add_argument("--preset", default="demo", choices=tuple(PRESETS))
    parser.add_argument("--set", dest="overrides", action="append", default=[], metavar="STAGE.FIELD=VALUE")
    parser.add_argument("--seeds", type=int, default=2, help="seeds of every ablation (default: %(default)s)")
    parser.add_argument("--threads", type=int, default=1, help="processor threads (default: %(default)s)")
    parser.add_argument("--pictures", action="store_true", help="only the pictures of these tables")
    parser.add_argument("--dry", action="store_true", help="print the tables, and write nothing below docs/")
    options = parser.parse_args()
    unknown = [name for name in options.tables if name not in TABLES]
    if unknown:
        parser.error(f"unknown: {', '.join(unknown)}; choose from {', '.join(TABLES)}")
    return options


def as_json(name: str, table: Table, options: argparse.Namespace, seconds: int) -> dict[str, Any]:
    """The table as `page` stores it."""
    arguments = [f"--preset {options.preset}"] * (options.preset != "demo")
    arguments += [f"--seeds {options.seeds}"] * (name == "ablations")
    command = " ".join(["python3 tools/dev.py evaluate", name, *arguments])
    return table.as_json(stamp(command, options.preset, options.overrides, options.threads, seconds))


if __name__ == "__main__":
    main()
