"""Use the extension by mouse and keys in a real Blender window, as an artist does: `tools/dev.py window`.

The window opens on a virtual screen (Xvfb). Blender is an installed one, or one in a chroot (a debootstrap of another
Debian, say), which needs root and leaves no mounts behind. Written to OUT: transcript.md, record.json, shots/,
blender.log, and the desk with the files. The exit code is 0 only if every step holds.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import time
from pathlib import Path

import imageio.v3 as imageio

from . import record
from .browser import open_browser
from .screen import System, pixels_of, run_blender, virtual_screen

ROOT = Path(__file__).resolve().parents[2]
INSIDE = Path(__file__).with_name("inside.py")
NOT_PHOTOS = shutil.ignore_patterns("*masks*", "labels", "depth", "recolor", "edits.json")


def main() -> int:
    options = read_options()
    out, begin = options.out.absolute(), time.monotonic()
    lay_out(out, is_new=not options.only)
    python = Path(sys.prefix)
    folders = tuple(dict.fromkeys([out, INSIDE.parent, python, python.resolve(), Path(sys.base_prefix).resolve()]))
    system = System("blender" if options.chroot else options.blender, options.chroot, folders)
    job = {"out": str(out), "engine_python": str(python / "bin" / "python"), "threads": options.threads}
    job["only"] = [name for name in options.only.split(",") if name]
    blends = [out / "desk" / name for name in ("sub/story.blend", "story.blend")]
    arguments = [str(blend) for blend in blends if blend.exists()][:1]
    arguments += ["--enable-event-simulate", "--python", str(INSIDE), "--", json.dumps(job)]
    log = out / "blender.log"
    with virtual_screen(system, out / "screen") as display:
        ending = run_blender(system, display, out / "user", arguments, log)
    for dump in (out / "shots").glob("*.xwd"):
        imageio.imwrite(dump.with_suffix(".png"), pixels_of(dump.read_bytes()))
        dump.unlink()
    steps = record.read(out / "record.json")
    findings = [*([ending] if ending else []), *found_in_logs(out, log)]
    findings += [f"still running: {each}" for each in record.engine_processes(out / "desk")]
    page = out / "desk" / "page" / "index.html"
    findings += open_page(page, out / "shots") if page.is_file() else []
    page = record.transcript(f"The window story, {time.monotonic() - begin:.0f} s", steps, findings)
    (out / "transcript.md").write_text(page, encoding="utf-8")
    print(page)
    return 0 if record.is_clean(steps, findings) else 1


def read_options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--blender", default="blender", help="the program (default: the one on the PATH)")
    which.add_argument("--chroot", type=Path, help="folder of a system with blender and Xvfb in it")
    parser.add_argument("--out", type=Path, default=Path("window_out"), help="default: %(default)s")
    parser.add_argument("--only", default="", help="names of steps with commas, in the OUT of an earlier run")
    parser.add_argument("--threads", type=int, default=1, help="of the engine (default: %(default)s)")
    return parser.parse_args()


def lay_out(out: Path, is_new: bool) -> None:
    """Make OUT ready; new: with the extension's package, and a desk with nothing but the demo's photos."""
    (out / "record.json").unlink(missing_ok=True)
    if is_new:
        for name in ("desk", "user", "shots", "screen"):
            shutil.rmtree(out / name, ignore_errors=True)
        for name in ("desk/sub", "desk/first", "user", "shots", "screen"):
            (out / name).mkdir(parents=True)
        (out / "blender.log").unlink(missing_ok=True)
        package = max((ROOT / "dist").glob("karf-*.zip"), key=lambda file: file.stat().st_mtime)
        shutil.copy(package, out / "karf.zip")
        shutil.copytree(ROOT / "demo", out / "desk" / "pots", ignore=NOT_PHOTOS)


def open_page(page: Path, shots: Path) -> list[str]:
    """Open the exported page in Chromium, choose its last look, and return what went wrong."""
    with open_browser("chromium", shots) as browser:
        browser.open(page.as_uri(), 1280, 800)
        browser.run("document.querySelector('#looks label:last-child input').click()")
        browser.run("karf.viewer.settled()")
        browser.shoot(shots / "page.png")
        return browser.tell("remarks")


def found_in_logs(out: Path, log: Path) -> list[str]:
    """Return the tracebacks in the logs of Blender and the engine."""
    return [
        f"{file.relative_to(out)}: {line}"
        for file in [log, *sorted((out / "desk").rglob("engine.log"))]
        for line in record.tracebacks(file.read_text(errors="replace"))
    ]


if __name__ == "__main__":
    sys.exit(main())
