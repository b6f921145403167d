"""The verbs of the command line: each takes the parsed arguments and returns the exit code.

Packages beyond the standard library are imported where they are needed: `doctor` must run without them.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import threading
from contextlib import closing
from dataclasses import fields
from pathlib import Path
from typing import Any

from ..commands.dispatch import run_command
from ..compute.interrupts import stop_on_interrupt
from ..compute.progress import TerminalEmit
from ..errors import BadRequest
from ..io.failures import log
from ..io.files import read_json
from ..io.options import Options
from ..project import Project
from ..project.settings import describe
from ..worker.loop import Worker
from ..worker.path_map import PathMap


def options_of(arguments: argparse.Namespace) -> Options:
    """Return a command's options from its parsed command line. Raises BadRequest where one is out of range."""
    given = {item.name: getattr(arguments, item.name, None) for item in fields(arguments.kind)}
    return arguments.kind.of(**{name: value for name, value in given.items() if value is not None})


def run_command_line(arguments: argparse.Namespace) -> int:
    """Run a command in this process, with its events on the terminal."""
    with stop_on_interrupt() as should_stop:
        run_command(options_of(arguments), TerminalEmit(), should_stop)
    return 0


def segment(arguments: argparse.Namespace) -> int:
    """Segment the objects, or with --suggest print the views to mark next."""
    if not arguments.suggest:
        return run_command_line(arguments)
    from ..segmentation.report import SegmentationReport

    project = Project(arguments.project)
    project.require("segmentation")
    report = SegmentationReport.read(project.segmentation_report)
    for name, score in report.suggestions.scores.items():
        print(f"{score:.4f}  {name}")
    if report.suggestions.any_view_helps:
        print("Any view helps about as much.")
    print("\n".join(each.sentence(name) for name, each in report.unsure.items()))
    return 0


def extract_palettes(arguments: argparse.Namespace) -> int:
    """Extract palettes, or print or export those of an earlier run."""
    project = Project(arguments.project)
    if arguments.json:
        project.require("palette")
        print(json.dumps(read_json(project.palette_file, "palettes"), indent=1))
        return 0
    if not arguments.out and not arguments.edit:
        return run_command_line(arguments)
    if not arguments.out:
        raise BadRequest("The palette verb was given an edit and no file to write.", "Add --out FILE.")
    from ..palettes.project_edit import edit_of

    edit_of(project, arguments.edit).save(project.check_inside(arguments.out))
    return 0


def mark(arguments: argparse.Namespace) -> int:
    """Write one mask and print its path."""
    print(_result_of(arguments))
    return 0


def inspect(arguments: argparse.Namespace) -> int:
    """Print the quality of a capture in sentences."""
    advice = _result_of(arguments)
    print("\n".join([advice.sentence, *advice.findings]))
    return 0


def write_bundle(arguments: argparse.Namespace) -> int:
    """Write a job bundle for a render farm."""
    log(f"wrote {_result_of(arguments)}")
    return 0


ACTIONS = {"inspect": inspect, "mark": mark, "segmentation": segment, "palette": extract_palettes, "farm": write_bundle}


def _result_of(arguments: argparse.Namespace) -> Any:
    """Run a command that takes seconds, print the texts of its stages and return its result."""

    def emit(kind: str, /, **values: Any) -> None:
        if kind == "stage":
            log(values["text"])

    return run_command(options_of(arguments), emit, lambda: False)


def list_settings(_: argparse.Namespace) -> int:
    """Print all settings."""
    for name, default, text in describe():
        print(f"{name:34} {default!s:12.60}  {text}")
    return 0


def doctor(options: argparse.Namespace) -> int:
    """Check whether this Python can run the engine; return the exit code of the verdict."""
    from .doctor import examine

    is_ended = threading.Event()

    def end(*_):
        is_ended.set()
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, end)  # so that temporary folders are removed
    code = 0
    with closing(examine(options.folder, options.quick, options.device, options.threads)) as findings:
        for finding in findings:
            if is_ended.is_set():  # Python drops exceptions that a weak reference's callback raises
                raise KeyboardInterrupt
            print(finding.to_line() if options.json else finding.to_text(), flush=True)
            code = finding.exit_code
    return code


def speed(options: argparse.Namespace) -> int:
    """Print how fast this computer learns, as JSON."""
    from .smoke import samples_per_second

    print(json.dumps({"samples_per_second": round(samples_per_second(options.device, options.threads))}))
    return 0


def run(options: argparse.Namespace) -> int:
    """Serve a job folder, and those that follow it."""
    return Worker(PathMap.of(options.folders), options.wait).serve(Path(options.job), sys.stdin)
