"""The engine's own environment: what an installation would do, doing it, its state, its end; and its Python, tested."""

from collections.abc import Sequence
from pathlib import Path

import bpy

from .. import preferences
from ..engine import installing, probing
from ..engine.installer import computer, home, locks, plan
from ..engine.installer.home import Status
from ..engine.installer.plan import Choices, Plan
from ..engine_api import ERROR, BadRequest, Finding, error_from_code
from ..project import folders
from ..tasks import queries, runner


def plan_engine(
    build: str = "auto",
    extras: Sequence[str] = (),
    folder: str | Path | None = None,
    wheels: str | Path | None = None,
    starter: str | Path = "",
) -> Plan:
    """Return what `install_engine` would do, as `sentences` and as `commands(shell)` to do it by hand; changes nothing.

    The `build` of torch is `auto` (by the drivers that are there), `cpu`, `cuda`, `rocm` or `mps`; `extras` are
    `photos` (pycolmap), or nothing. A folder of `wheels` takes the place of the network. The `starter` is a Python, or
    uv, that makes the environment; default: Blender's own Python, uv, any Python found.
    """
    offline = Path(wheels).absolute() if wheels else None
    return installing.plan(Choices(_place(folder), build, _extras(extras), offline, str(starter)))


def install_engine(
    build: str = "auto",
    extras: Sequence[str] = (),
    folder: str | Path | None = None,
    wheels: str | Path | None = None,
    starter: str | Path = "",
) -> Status:
    """Install the engine as `plan_engine` says, resume or update it; uses the network only where Blender may."""
    planned = plan_engine(build, extras, folder, wheels, starter)
    for sentence in planned.sentences:
        print(f"KaRF engine: {sentence}", flush=True)
    leave_python()
    installing.wait(planned)
    return home.status(planned.folder)


def engine_status(folder: str | Path | None = None) -> Status:
    """Return what is installed in a folder; default: that of the preferences."""
    return home.status(_place(folder))


def repair_engine(folder: str | Path | None = None, wheels: str | Path | None = None) -> Status:
    """Check every file of the environment, and put back what is missing or changed; also finish or update it."""
    was = engine_status(folder)
    if was.state == home.NONE:
        raise BadRequest(was.sentence, "Use install_engine().")
    return install_engine(was.build, was.extras, folder, wheels)


def remove_engine(folder: str | Path | None = None) -> None:
    """Delete the environment; refuses a folder that KaRF has not made."""
    leave_python()
    home.remove(_place(folder))


def engine_files(
    platform: str = "", python: str = "3.11", build: str = "cpu", extras: Sequence[str] = (), shell: str = "posix"
) -> tuple[str, str]:
    """Return the text of `karf-wheels.txt`, and the command that fetches its files into the folder `wheels`.

    The `platform` is `linux-x86_64`, `linux-aarch64`, `windows-x86_64` or `macos-arm64` (default: this one), `python`
    the version of Blender's own or of the starter, and `shell` the other computer's: `posix`, `powershell` or `cmd`.
    """
    here = computer.Machine(platform) if platform else computer.detect_machine()
    lock = locks.read(here.platform, computer.build_for(build, here), python, _extras(extras))
    return plan.fetching(lock, python, here.platform, shell)


def examine_engine(scene: bpy.types.Scene | None = None) -> tuple[Finding, ...]:
    """Test packages, device, disk, and each stage on a tiny scene; raise the last finding, the verdict, if an error."""
    folder = folders.likely_project(scene or bpy.context.scene)
    found = probing.wait(preferences.engine_python(), folder, preferences.current().threads)
    for finding in found:
        print(f"KaRF engine: {finding.to_text()}", flush=True)
    verdict = found[-1]
    if verdict.status == ERROR:
        raise error_from_code(verdict.code, verdict.sentence, " ".join(verdict.lines[1:]))
    return found


def leave_python() -> None:
    """End what runs or waits in the engine's Python, which may be replaced."""
    probing.cancel()
    queries.stop()
    runner.release()


def _place(folder: str | Path | None) -> Path:
    return Path(folder).absolute() if folder else preferences.engine_folder()


def _extras(names: Sequence[str]) -> tuple[str, ...]:
    return tuple(name for name in names if name != "fast")  # numba, to older scripts: it is always there
