"""Blender in a window on a virtual screen (Xvfb), in this system or in a chroot."""

from __future__ import annotations

import os
import signal
import struct
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

SIZE = 1600, 1400  # pixels: every panel fits, nothing has to be scrolled
SOFTWARE = {"LIBGL_ALWAYS_SOFTWARE": "1", "GALLIUM_DRIVER": "llvmpipe"}  # what draws the window
LONGEST = 3600  # seconds after which Blender counts as hung


@dataclass(frozen=True)
class System:
    """Where Blender runs: here, or in a chroot that sees some folders at the same paths; that needs root."""

    blender: str
    chroot: Path | None
    folders: tuple[Path, ...]

    def command(self, *command: str) -> list[str]:
        """Return the command to start it from here. Mounts belong to the process and end with it."""
        if self.chroot is None:
            return list(command)
        mounts = [f"mount -t proc proc {self.chroot}/proc", f"mount --rbind /dev {self.chroot}/dev"]
        for folder in self.folders:
            inside = f"{self.chroot}{folder}"
            mounts += [f"mkdir -p {inside}", f"mount --bind {folder} {inside}"]
        script = " && ".join([*mounts, f'exec chroot {self.chroot} "$@"'])
        return ["unshare", "--mount", "--propagation", "private", "sh", "-c", script, "sh", *command]


@contextmanager
def virtual_screen(system: System, folder: Path) -> Iterator[str]:
    """Open a virtual screen and yield its display. Xvfb keeps its pixels up to date in a file of the folder."""
    reading, writing = os.pipe()
    width, height = SIZE
    # Xvfb itself chooses a number that is free
    command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", f"{width}x{height}x24", "-fbdir", str(folder)]
    command, log = system.command(*command), folder / "xvfb.log"
    with log.open("wb") as output:
        server = subprocess.Popen(command, pass_fds=[writing], stdout=output, stderr=subprocess.STDOUT)
    os.close(writing)
    try:
        with os.fdopen(reading) as answer:
            number = answer.readline().strip()
        if not number:
            raise SystemExit(f"Xvfb did not start: see {log}")
        yield f":{number}"
    finally:
        server.terminate()
        server.wait(10)


def pixels_of(dump: bytes) -> np.ndarray:
    """Return the pixels, [H, W, 3], of a window dump by Xvfb with 24 bits."""
    header = struct.unpack(">25I", dump[:100])
    size, width, height, line, n_colors = (header[number] for number in (0, 4, 5, 12, 19))
    rows = np.frombuffer(dump, np.uint8, line * height, size + 12 * n_colors).reshape(height, line // 4, 4)
    return rows[:, :width, 2::-1]  # from blue, green, red, nothing


def run_blender(system: System, display: str, user: Path, arguments: list[str], log: Path) -> str:
    """Run Blender to its end; return what went wrong, or nothing."""
    window = ["--gpu-backend", "opengl", "--window-geometry", "0", "0", *map(str, SIZE)]
    variables = {"DISPLAY": display, "HOME": str(user), "BLENDER_USER_RESOURCES": str(user), "TMPDIR": str(user)}
    with log.open("ab") as output:
        process = subprocess.Popen(
            system.command(system.blender, *window, *arguments),
            stdout=output,
            stderr=subprocess.STDOUT,
            env=os.environ | variables | SOFTWARE,
            start_new_session=True,
        )
    try:
        code = process.wait(LONGEST)
    except subprocess.TimeoutExpired:
        return "Blender hung and was ended"
    finally:  # also where this program is interrupted
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    return f"Blender ended with exit code {code}" if code else ""
