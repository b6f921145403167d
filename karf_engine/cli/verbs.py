"""The verbs: each does what its arguments say and returns the exit code."""

from __future__ import annotations

import argparse
import json
import signal
from pathlib import Path

from .. import api
from ..commands.dispatch import run_request
from ..compute.progress import TerminalEmit
from ..errors import BadRequest
from ..io.files import read_json
from ..path_map import PathMap
from ..project import Project
from ..project.settings import describe
from ..wire import Request
from .job import run_jobs


def learn_all(options: argparse.Namespace) -> int:
    """All stages of learning."""
    learn_geometry(options)
    segment(options)
    api.extract_palettes(options.project, **_run_of(options))
    api.learn_recoloring(options.project, **_run_of(options))
    return 0


def learn_geometry(options: argparse.Namespace) -> int:
    """The scene."""
    api.learn_geometry(
        options.capture,
        project=options.project,
        preset=options.preset,
        overrides=options.overrides,
        nerf=options.nerf,
        holdout=options.holdout,
        masks=options.masks,
        **_run_of(options),
    )
    return 0


def segment(options: argparse.Namespace) -> int:
    """Objects, or only which views to mark next."""
    if getattr(options, "suggest", False):
        from ..segmentation.report import SegmentationReport  # needs torch

        project = Project(options.project)
        project.require("segmentation")
        report = SegmentationReport.read(project.segmentation_report)
        for name, score in report.suggestions.items():
            print(f"{score:.4f}  {name}")
        print("\n".join(each.sentence(name) for name, each in report.unsure.items()))
        return 0
    more = {name: getattr(options, name, None) for name in ("corrections", "volumes")}
    api.segment(options.project, options.masks, **more, **_run_of(options))
    return 0


def extract_palettes(options: argparse.Namespace) -> int:
    """Palettes, or only a look at them."""
    if options.json:
        project = Project(options.project)
        project.require("palette")
        print(json.dumps(read_json(project.palette_file, "palettes"), indent=1))
        return 0
    if options.out or options.edit:
        if not options.out:
            raise BadRequest("The palette verb was given an edit and no file to write.", "Add --out FILE.")
        from ..palettes.project_edit import edit_of  # needs numpy, without which `doctor` still has something to say

        edit_of(Project(options.project), options.edit).save(options.out)
        return 0
    api.extract_palettes(options.project, **_run_of(options))
    return 0


def learn_recoloring(options: argparse.Namespace) -> int:
    """Palette weights."""
    api.learn_recoloring(options.project, **_run_of(options))
    return 0


def mark(options: argparse.Namespace) -> int:
    """One mask."""
    points = [(*place, True) for place in options.clicks] + [(*place, False) for place in options.nots]
    asked = {"box": options.box, "points": points, "weights": options.weights}
    print(api.mark(options.capture, options.view, options.object, options.out, **asked))
    return 0


def find_poses(options: argparse.Namespace) -> int:
    """A capture of photos without poses."""
    api.find_poses(options.photos, options.out, matching=options.matching, **_run_of(options))
    return 0


def match(options: argparse.Namespace) -> int:
    """An edit."""
    names = ("object", "source", "target", "also", "rule", "view", "picture", "edit", "out", "device", "threads")
    values = {name: getattr(options, name) for name in names}
    run_request(Request("match", Path(options.project), values), TerminalEmit(), lambda: False)
    return 0


def render(options: argparse.Namespace) -> int:
    """Pictures of views."""
    names = (
        "views", "edit", "base", "size", "depth", "unsure", "planes", "layers", "alpha", "jpeg", "overrides", "skip_existing",
        "format", "first", "last", "count",
    )  # fmt: skip
    chosen = {name: getattr(options, name) for name in names}
    api.render(options.project, options.out, **chosen, **_run_of(options))
    return 0


def render_colorways(options: argparse.Namespace) -> int:
    """Pictures of views in all colorways."""
    chosen = {"views": options.views, "size": options.size, "predict_only": options.predict_only}
    api.colorways(options.project, options.sheet, options.out, **chosen, **_run_of(options))
    return 0


def write_points(options: argparse.Namespace) -> int:
    """The scene as points."""
    api.write_points(options.project, options.out, count=options.count, edit=options.edit, **_run_of(options))
    return 0


def _run_of(options: argparse.Namespace) -> api.Run:
    """How the command line runs a stage: events go to the terminal."""
    return {"threads": options.threads, "device": options.device, "emit": TerminalEmit()}


def list_settings(_: argparse.Namespace) -> int:
    """All settings."""
    for name, default, text in describe():
        print(f"{name:34} {default!s:12.60}  {text}")
    return 0


def doctor(options: argparse.Namespace) -> int:
    """Whether this Python can run the engine."""
    from .doctor import examine

    signal.signal(signal.SIGTERM, signal.default_int_handler)  # so that what was tried is removed when it is ended
    finding = None
    for finding in examine(Path(options.folder), options.quick, options.device, options.threads):
        print(finding.to_line() if options.json else finding.to_text(), flush=True)
    return finding.exit_code


def speed(options: argparse.Namespace) -> int:
    """How fast this computer learns, as JSON."""
    from .doctor.speed import samples_per_second

    print(json.dumps({"samples_per_second": round(samples_per_second(options.device, options.threads))}))
    return 0


def run(options: argparse.Namespace) -> int:
    """A job folder, and those that follow it."""
    return run_jobs(Path(options.job), PathMap.of(options.folders), options.wait)
