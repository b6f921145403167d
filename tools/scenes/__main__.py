"""Draw the scene of a seed as a capture: .venv/blender/bin/python -m tools.scenes --seed N --out DIR."""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path

from ..evaluate.sources import Trace

SIZE, SAMPLES = 160, 24


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--out", type=Path, required=True, help="the capture's folder")
    parser.add_argument("--size", type=int, default=SIZE, help="of a square photo, pixels (default: %(default)s)")
    parser.add_argument("--samples", type=int, default=SAMPLES, help="a pixel, at most (default: %(default)s)")
    parser.add_argument("--threads", type=int, default=1, help="processor threads (default: %(default)s)")
    parser.add_argument("--sources", type=Path, metavar="FILE", help="list the modules that ran there")
    options = parser.parse_args()
    trace = Trace()
    trace.start()
    from .seeded.recipe import make_drawn_capture

    command = (
        f"python -m tools.scenes --seed {options.seed} --size {options.size} --samples {options.samples} --out DIR"
    )
    make_drawn_capture(
        options.seed, options.size, options.samples, options.out, command=command, threads=options.threads
    )
    trace.stop()
    if options.sources:
        options.sources.write_text(json.dumps(sorted(trace.modules())), encoding="utf-8")


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)  # bpy may hang or crash while the interpreter shuts down
