"""Judge masks from a box and from clicks on captures whose masks are known: a line a capture, and OUT as JSON.

    .venv/engine/bin/python -m tools.marking.judge CAPTURE [CAPTURE ..] [--truth MASKS] --out OUT.json

Without --truth captures are laid out like the demo, with labels; MASKS is <object>[/<split>]/<photo stem>.png. A few
training views are marked, evenly chosen from those that show the object.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import karf_engine as karf
from karf_engine.capture.capture import View
from karf_engine.capture.training_images import read_photo_of_view
from karf_engine.io.files import write_json
from karf_engine.io.images import read_mask

from ..judging.truth import Truth
from ..judging.views import mask_file
from .user import SHOWN, Marking, mark

LEAST_SHARE = 0.002  # of the photo: less of an object is not marked


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures", nargs="+", type=Path, metavar="CAPTURE")
    parser.add_argument("--truth", type=Path, metavar="MASKS", help="true masks of the one capture")
    parser.add_argument("--views", type=int, default=5, help="photos of each object (default: %(default)s)")
    parser.add_argument("--out", type=Path, required=True, help="JSON to write")
    options = parser.parse_args()
    table = {}
    for capture in options.captures:
        cases = list(_cases(capture, options.truth, options.views))
        table[capture.name] = {
            name: summary([mark(read_photo_of_view(view), truth, from_box) for view, truth in cases])
            for name, from_box in (("clicks", False), ("box", True))
        }
        print(capture.name, table[capture.name], flush=True)
    write_json(options.out, table)


def _cases(capture: Path, masks: Path | None, count: int) -> Iterator[tuple[View, np.ndarray]]:
    """Views and true masks to mark."""
    views = sorted(karf.open_capture(capture).split("train"), key=lambda view: view.stem)
    if masks is None:
        known = [list(zip(views, shown, strict=True)) for shown in Truth(capture).masks("train").values()]
    else:
        files = [[(view, mask_file(path, view)) for view in views] for path in sorted(masks.iterdir()) if path.is_dir()]
        known = [[(view, read_mask(file)) for view, file in shown if file.exists()] for shown in files]
    for shown in known:
        large = [(view, mask) for view, mask in shown if mask.mean() >= LEAST_SHARE]
        for number in np.linspace(0, len(large) - 1, min(count, len(large))).round().astype(int):
            yield large[number]


def summary(markings: list[Marking]) -> dict[str, float]:
    """Means over objects and photos."""
    values = {f"iou_{count}": [marking.after(count) for marking in markings] for count in (0, *SHOWN)}
    values |= {name: [getattr(marking, name) for marking in markings] for name in ("clicks", "seconds", "disobeyed")}
    return {"markings": len(markings)} | {name: round(float(np.mean(found)), 3) for name, found in values.items()}


if __name__ == "__main__":
    main()
