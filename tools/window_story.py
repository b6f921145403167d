"""Open real Blender in a window and do an artist's afternoon in it by mouse and keys: `tools/dev.py window`.

The window opens on a virtual screen (Xvfb) where there is one, else on DISPLAY, then without screenshots. Blender is an
installed one, or one in a chroot (a debootstrap of another Debian, say), which needs root and leaves no mounts behind.
Written to OUT: transcript.md, transcript.json, shots/, blender.log, and the desk that was worked on. See
docs/window_story.md.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import imageio.v3 as imageio
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
INSIDE = ROOT / "tools" / "window"
sys.path.insert(0, str(INSIDE))
import record  # noqa: E402
import screen  # noqa: E402

DEMO = ROOT / "demo"
MARKED_VIEW = "r_041"
SIZE = 1300, 1600  # of the screen: every panel of the sidebar fits, nothing has to be scrolled
PATIENCE = 200.0  # seconds without a new line in the record after which Blender counts as hung
RESTARTS = 6
STROKE_ROWS = 18  # pixels of the photo between two strokes
TINY = (
    "geometry.long_side=96",
    'geometry.levels=[{"voxels": 32, "iterations": 80, "step": 1.0}, {"voxels": 56, "iterations": 120, "step": 0.75}]',
    "geometry.samples=16000",
    "geometry.max_rays=2048",
    "segmentation.iterations=120",
    "segmentation.width=16",
    "recoloring.iterations=40",
    "recoloring.width=16",
)
BRUSH = 6  # its radius, about, pixels of the photo
SOFTWARE = {"LIBGL_ALWAYS_SOFTWARE": "1", "GALLIUM_DRIVER": "llvmpipe"}


@dataclass(frozen=True)
class Place:
    """Where Blender runs: in this system, or in a chroot that sees the story's folders at the same paths."""

    blender: str
    chroot: Path | None

    def command(self, *command: str, shared: tuple[Path, ...]) -> list[str]:
        """The command as it is started from here. Mounts are the process's own and end with it."""
        if self.chroot is None:
            return list(command)
        mounts = [f"mount -t proc proc {self.chroot}/proc", f"mount --rbind /dev {self.chroot}/dev"]
        for folder in shared:
            inside = f"{self.chroot}{folder}"
            mounts += [f"mkdir -p {inside}", f"mount --bind {folder} {inside}"]
        script = " && ".join([*mounts, f'exec chroot {self.chroot} "$@"'])
        return ["unshare", "--mount", "--propagation", "private", "sh", "-c", script, "sh", *command]


def main() -> int:
    options = read_options()
    out = options.out.absolute()
    place = Place("blender" if options.chroot else options.blender, options.chroot)
    prepare(out, is_new=not options.only)
    begin = time.monotonic()
    engine = engine_python()
    folders = tuple(dict.fromkeys([out, INSIDE, *engine_folders()]))
    with virtual_screen(place, out, folders) as display:
        log, version = out / "blender.log", blender_version(place, folders)
        sessions = play(place, out, folders, display, engine, options)
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
    return parser.parse_args()


# --- what the story needs ------------------------------------------------------------------------------------------
def engine_python() -> Path:
    """This Python, which is the engine's."""
    return Path(sys.prefix) / "bin" / "python"


def engine_folders() -> list[Path]:
    """What the engine's Python consists of, wherever links lead."""
    return [Path(sys.prefix), Path(sys.prefix).resolve(), Path(sys.base_prefix).resolve()]


def prepare(out: Path, is_new: bool) -> None:
    """Lay out OUT: the capture, the extension's package, and a decoy project of the same objects with other colors."""
    (out / "record.jsonl").unlink(missing_ok=True)
    shutil.rmtree(out / "shots", ignore_errors=True)
    (out / "shots").mkdir(parents=True)
    if not is_new:
        return
    for name in ("desk", "user", "screen", "blender.log", "facts.json"):
        path = out / name
        shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(missing_ok=True)
    for folder in ("desk/here/sub", "user", "screen"):
        (out / folder).mkdir(parents=True)
    capture = out / "desk" / "pots"
    for name in ("train", "test"):
        shutil.copytree(DEMO / name, capture / name)
        shutil.copy(DEMO / f"transforms_{name}.json", capture)
    shutil.copy(max((ROOT / "dist").glob("karf-*.zip"), key=lambda file: file.stat().st_mtime), out / "karf.zip")
    masks = out / "decoy_masks"
    for name, other in (("pot", "mug"), ("mug", "pot")):
        shutil.copytree(DEMO / "coarse_masks" / "three" / other, masks / name, dirs_exist_ok=True)
    command = [sys.executable, "-m", "karf_engine", "all", str(capture), "--masks", str(masks), "--threads", "1"]
    command += ["--project", str(out / "decoy"), *(part for text in TINY for part in ("--set", text))]
    if not (out / "decoy" / "palette.json").exists():
        subprocess.run(command, cwd=ROOT, check=True, capture_output=True)


def strokes(name: str) -> list[list[tuple[float, float]]]:
    """Brush strokes over an object: back and forth through its rough mask, in shares of the picture from the lower left."""
    mask = imageio.imread(DEMO / "coarse_masks" / "one" / name / f"{MARKED_VIEW}.png")
    mask = mask.reshape(*mask.shape[:2], -1)[..., 0] > 127
    height, width = mask.shape
    rows = np.flatnonzero(mask.any(1))
    lines = []
    for row in rows[STROKE_ROWS // 2 : -STROKE_ROWS // 2 : STROKE_ROWS]:
        columns = np.flatnonzero(mask[row])
        first, last = columns[0] + BRUSH, columns[-1] - BRUSH
        lines.append([(float(x) / width, 1 - float(row) / height) for x in np.linspace(first, last, 5)])
    return lines


# --- Blender -------------------------------------------------------------------------------------------------------
@contextmanager
def virtual_screen(place: Place, out: Path, folders: tuple[Path, ...]):
    """A screen of our own; yields its display, or the one there is where Xvfb is not installed."""
    root = place.chroot or Path("/")
    if not any((root / folder / "Xvfb").exists() for folder in ("usr/bin", "usr/local/bin")):
        yield os.environ["DISPLAY"]
        return
    reading, writing = os.pipe()
    size = "x".join(map(str, SIZE))
    # Xvfb itself chooses a number that is free
    command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", f"{size}x24", "-fbdir", str(out / "screen")]
    with (out / "xvfb.log").open("wb") as log:
        server = subprocess.Popen(
            place.command(*command, shared=folders), pass_fds=[writing], stdout=log, stderr=subprocess.STDOUT
        )
    os.close(writing)
    try:
        with os.fdopen(reading) as answer:
            yield f":{int(answer.readline())}"
    finally:
        server.terminate()
        server.wait(10)


def blender_version(place: Place, folders: tuple[Path, ...]) -> str:
    """The version as Blender says it."""
    command = place.command(place.blender, "--version", shared=folders)
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[0]


def play(place: Place, out: Path, folders, display: str, engine: Path, options) -> list[str]:
    """Run the story; where Blender goes down, start it anew and go on with the next step. Returns what went wrong."""
    findings, after = [], ""
    for _ in range(RESTARTS):
        job = write_job(out, engine, after, options)
        code = run_blender(place, out, folders, display, job)
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


HUNG = 9999


def ending(code: int) -> str:
    """An exit code in words."""
    number = -code if code < 0 else code - 128
    return signal.Signals(number).name if 0 < number < 65 else f"exit code {code}"


def write_job(out: Path, engine: Path, after: str, options) -> Path:
    """What the script inside Blender is to know."""
    file, files = out / "job.json", {name: str(out / name) for name in ("desk", "decoy", "shots")}
    files |= {"package": str(out / "karf.zip"), "record": str(out / "record.jsonl"), "facts": str(out / "facts.json")}
    capture = json.loads((DEMO / "transforms_train.json").read_text())["frames"]
    test = json.loads((DEMO / "transforms_test.json").read_text())["frames"]
    job = files | {
        "engine_python": str(engine),
        "threads": options.threads,
        "tiny": TINY,
        "views": len(capture) + len(test),
        "marked_view": MARKED_VIEW,
        "strokes": {name: strokes(name) for name in ("apple", "mug", "pot")},
        "has_screen": dump(out) is not None,
        "only": [name.strip() for name in options.only.split(",") if name.strip()],
        "after": after,
    }
    file.write_text(json.dumps(job))
    return file


def run_blender(place: Place, out: Path, folders, display: str, job: Path) -> int:
    """One session: start, photograph what is asked for, wait. Returns the exit code, or HUNG."""
    facts = out / "facts.json"
    blend = json.loads(facts.read_text()).get("blend", "") if facts.exists() else ""
    size = ["--window-geometry", "0", "0", *map(str, SIZE)]
    command = [place.blender, *([blend] if blend else []), "--gpu-backend", "opengl", *size]
    command += ["--enable-event-simulate", "--python", str(INSIDE / "inside.py"), "--", str(job)]
    user = {
        "DISPLAY": display,
        "HOME": str(out / "user"),
        "BLENDER_USER_RESOURCES": str(out / "user"),
        "TMPDIR": str(out / "user"),
    }
    software = SOFTWARE if dump(out) is not None else {}
    with (out / "blender.log").open("ab") as log:
        process = subprocess.Popen(
            place.command(*command, shared=folders),
            stdout=log,
            stderr=subprocess.STDOUT,
            env=os.environ | user | software,
            start_new_session=True,
        )
    try:
        return watch(process, out)
    finally:  # also where the driver is interrupted
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)


def watch(process: subprocess.Popen, out: Path) -> int:
    """Wait for Blender and take the screenshots it asks for."""
    count, patient_until = -1, 0.0
    while process.poll() is None:
        lines = read_lines(out / "record.jsonl")
        if len(lines) != count:
            count, patient_until = len(lines), time.monotonic() + PATIENCE
        for line in lines:
            values = json.loads(line)
            if values["kind"] == "shot":
                photograph(out, values["text"])
        if time.monotonic() > patient_until:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            return HUNG
        time.sleep(0.1)
    return process.returncode


def read_lines(file: Path) -> list[str]:
    """The whole lines of a file that is being written."""
    if not file.exists():
        return []
    return [line for line in file.read_text().splitlines(keepends=True) if line.endswith("\n")]


def dump(out: Path) -> Path | None:
    """The screen's file, where there is a virtual one."""
    return next((out / "screen").glob("Xvfb_screen*"), None)


def photograph(out: Path, name: str) -> None:
    """Write the screen as it is to shots/NAME.png, once."""
    file = out / "shots" / f"{name}.png"
    if not file.exists():
        imageio.imwrite(file.with_suffix(".part.png"), screen.read_dump(dump(out).read_bytes()))
        file.with_suffix(".part.png").rename(file)


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
