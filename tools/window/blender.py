"""Blender in a window on a screen of our own: started, photographed, ended where it hangs."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import imageio.v3 as imageio

from . import screen

INSIDE = Path(__file__).resolve().parent
PATIENCE = 350.0  # seconds without a new line in the record after which Blender counts as hung
SOFTWARE = {"LIBGL_ALWAYS_SOFTWARE": "1", "GALLIUM_DRIVER": "llvmpipe"}
HUNG = 9999  # in the place of an exit code


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


@contextmanager
def virtual_screen(place: Place, out: Path, folders: tuple[Path, ...], size: tuple[int, int]):
    """A screen of our own, of a size in pixels; yields its display, or the one there is where Xvfb is not installed."""
    root = place.chroot or Path("/")
    if not any((root / folder / "Xvfb").exists() for folder in ("usr/bin", "usr/local/bin")):
        yield os.environ["DISPLAY"]
        return
    reading, writing = os.pipe()
    # Xvfb itself chooses a number that is free
    command = [
        "Xvfb",
        "-displayfd",
        str(writing),
        "-screen",
        "0",
        "x".join(map(str, (*size, 24))),
        "-fbdir",
        str(out / "screen"),
    ]
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


def ending(code: int) -> str:
    """An exit code in words."""
    number = -code if code < 0 else code - 128
    return signal.Signals(number).name if 0 < number < 65 else f"exit code {code}"


def run_blender(place: Place, out: Path, folders, display: str, job: Path, size: tuple[int, int]) -> int:
    """One session: start, photograph what is asked for, wait. Returns the exit code, or HUNG."""
    facts = out / "facts.json"
    blend = json.loads(facts.read_text()).get("blend", "") if facts.exists() else ""
    window = ["--window-geometry", "0", "0", *map(str, size)]
    command = [place.blender, *([blend] if blend else []), "--gpu-backend", "opengl", *window]
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
