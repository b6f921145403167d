"""The verb `farm`: jobs for a render farm."""

from __future__ import annotations

import argparse

from ..commands.farm.options import PICTURES
from ..errors import BadRequest
from ..worker.failing import say


def write_bundle(options: argparse.Namespace) -> int:
    """A bundle that renders a learned project, or with masks one that learns a capture first."""
    from ..commands.farm.bundle import (  # need numpy, without which `doctor` has something to say
        learning_bundle,
        render_bundle,
    )

    pictures = {name: getattr(options, name) for name in PICTURES if name != "overrides"}
    chosen = {name: getattr(options, name) for name in ("views", "edit", "per_task", "python")}
    if options.masks:
        learning = {"preset": options.preset or "demo", "overrides": options.overrides, "holdout": options.holdout}
        out = learning_bundle(options.source, options.masks, options.out, **learning, **chosen, **pictures)
    elif options.preset:
        raise BadRequest("A learned project has its preset.", "Leave --preset out, or give --masks to learn a capture.")
    else:
        out = render_bundle(options.source, options.out, overrides=options.overrides, **chosen, **pictures)
    say(f"wrote {out}")
    return 0
