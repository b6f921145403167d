"""Open real Blender in a window and do an artist's afternoon in it by mouse and keys: `tools/dev.py window`.

The window opens on a virtual screen (Xvfb) where there is one, else on DISPLAY, then without screenshots. Blender is an
installed one, or one in a chroot (a debootstrap of another Debian, say), which needs root and leaves no mounts behind.
Written to OUT: transcript.md, transcript.json, shots/, blender.log, and the desk that was worked on. See
docs/window_story.md.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path

from . import capture, record
from .blender import HUNG, INSIDE, Place, blender_version, ending, read_lines, run_blender, virtual_screen
from .preparation import DEMO, engine_folders, engine_python, prepare, truth_of, write_job

RESTARTS = 6
# of the screen: every panel fits, nothing has to be scrolled; an artist's own
SIZES = {"afternoon": (1300, 2100), "first-color": (1920, 1080)}


def main() -> int:
    options = read_options()
    out = options.out.absolute()
    place = Place("blender" if options.chroot else options.blender, options.chroot)
    prepare(out, options)
    begin = time.monotonic()
    engine = engine_python()
    folders = tuple(dict.fromkeys([out, INSIDE, *engine_folders()]))
    with virtual_screen(place, out, folders, SIZES[options.story]) as display:
        log, version = out / "blender.log", blender_version(place, folders)
        sessions = play(place, out, folders, display, engine, options)
    if options.story == "first-color":
        judge(out, options)
    findings = [*sessions, *found_in_logs(out, log), *left_processes(out)]
    steps = record.steps_of((out / "record.jsonl").read_text().splitlines())
    transcript = record.Transcript(version, round(time.monotonic() - begin, 1), tuple(steps), tuple(findings))
    record.write_transcript(out, transcript)
    print(record.markdown(transcript))
    return 0 if transcript.is_clean else 1


def read_options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--blender", default="blender", help="the program (default: the one on the PATH)")
    which.add_argument("--chroot", type=Path, help="folder of a system with blender in it")
    parser.add_argument("--out", type=Path, default=Path("window_out"), help="default: %(default)s")
    parser.add_argument("--only", default="", help="names of steps with commas, in the OUT of an earlier run")
    parser.add_argument("--threads", type=int, default=1, help="of the engine (default: %(default)s)")
    parser.add_argument("--story", choices=list(SIZES), default="afternoon", help="default: %(default)s")
    first = parser.add_argument_group("first-color")
    first.add_argument("--capture", type=Path, default=DEMO, help="its folder (default: the demo)")
    first.add_argument("--truth", type=Path, help="folder of VIEW.png, masks of the object (of the demo: its pot)")
    first.add_argument("--preset", default="demo", help="default: %(default)s")
    return parser.parse_args()


def play(place: Place, out: Path, folders, display: str, engine: Path, options) -> list[str]:
    """Run the story; where Blender goes down, start it anew and resume at the next step. Returns what went wrong."""
    findings, after = [], ""
    for _ in range(RESTARTS):
        job = write_job(out, engine, after, options)
        code = run_blender(place, out, folders, display, job, SIZES[options.story])
        steps = record.steps_of(read_lines(out / "record.jsonl"))
        last = steps[-1] if steps else None
        if code == 0:
            return findings
        what = "hung and was ended" if code == HUNG else f"ended with {ending(code)}"
        findings.append(f"Blender {what} in the step {last.name if last else 'before the first'!r}")
        if last is None or last.name == after:
            return findings
        after = last.name
    return findings


def judge(out: Path, options: argparse.Namespace) -> None:
    """Add to the record what the box and the segmentation are worth, beside the masks that are known."""
    file = out / "record.jsonl"
    begin = time.monotonic()
    record.note(
        file, kind="begin", name="judge", how="script: masks rendered by the engine beside those that are known"
    )
    try:
        facts, job = (json.loads((out / f"{name}.json").read_text()) for name in ("facts", "job"))
        desk = out / "desk" / options.capture.name
        for sentence in capture.judge(desk, truth_of(out, options), facts, job["view"], out / "judged"):
            record.note(file, kind="note", text=sentence)
        outcome = record.PASSED
    except (KeyError, OSError, subprocess.CalledProcessError) as error:
        record.note(file, kind="note", text=repr(error))
        outcome = record.FAILED
    record.note(file, kind="end", outcome=outcome, seconds=round(time.monotonic() - begin, 1))


# --- what is left --------------------------------------------------------------------------------------------------
def found_in_logs(out: Path, log: Path) -> list[str]:
    """Tracebacks in what Blender and the engine have written."""
    return [
        f"{file.relative_to(out)}: {line}"
        for file in [log, *sorted((out / "desk").rglob("engine.log"))]
        for line in record.tracebacks(file.read_text(errors="replace"))
    ]


def left_processes(out: Path) -> list[str]:
    """Engine processes of this story that outlive Blender."""
    found = []
    for file in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = file.read_bytes().decode(errors="replace").split("\0")
        except OSError:  # ended meanwhile
            continue
        if any(word.startswith(f"{out}/desk/") for word in words):
            found.append(f"process {file.parent.name} still runs: {' '.join(words)}")
    return found


if __name__ == "__main__":
    sys.exit(main())
