"""Check whether this Python and computer can run the engine, and say what to do if not.

Imports only the standard library; packages are loaded when they are checked. The smoke run is in `smoke`.
"""

from __future__ import annotations

import ctypes
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Generator, Iterator
from dataclasses import replace
from importlib import import_module, metadata
from pathlib import Path

from ..errors import DataError, KarfError, MissingDependency
from ..io.failures import FREE_SPACE, OTHER_FOLDER, first_line, translate_error
from ..worker.findings import (
    ERROR,
    FAST,
    GSPLAT,
    OK,
    POSES,
    PYTHON,
    REQUIRED,
    STATUSES,
    VERDICT,
    WARNING,
    Finding,
    Package,
    error_finding,
)

TORCH = REQUIRED[0]
GB = 1e9
LITTLE_MEMORY = 4 * GB  # the preset demo learns in 1 GB; Blender and the system need as much again
LITTLE_DISK = 2 * GB  # a project and its pictures take tens of megabytes to some gigabytes
NO_DISK = 0.1 * GB  # too little for any project
ONE_AT_A_TIME = "Let one program at a time work on a project there, or choose a folder on another disk."
PROCESSOR = "the processor"
INSTALL = "Install it, in a terminal:"
FAST_BRINGS = "With it the processor learns a scene 1.7 times as fast."


def examine(
    folder: Path, quick: bool = False, device: str | None = None, threads: int | None = None
) -> Generator[Finding, None, None]:
    """Yield the finding of each check; the last one is the verdict.

    Checks disk and locks of `folder`, where projects will be. `quick`, or an earlier error, skips the smoke run.
    """
    found = []
    for finding in _findings(folder, device):
        found.append(finding)
        yield finding
    if not quick and all(finding.status != ERROR for finding in found):
        from . import smoke  # needs numpy

        for finding in smoke.stages(device, threads):
            found.append(finding)
            yield finding
    yield _verdict(found)


def _findings(folder: Path, device: str | None) -> Iterator[Finding]:
    yield python()
    required = [check_package(package) for package in REQUIRED]
    yield from required
    yield poses()
    yield fast()
    if all(finding.status != ERROR for finding in required):
        yield from devices(device)
    folder = folder.absolute()
    folder = next((each for each in (folder, *folder.parents) if each.is_dir()), folder)
    yield processors()
    yield memory()
    yield disk(folder)
    yield locks(folder)
    yield temporary()


def _verdict(found: list[Finding]) -> Finding:
    worst = max(found, key=lambda finding: STATUSES.index(finding.status))
    concerned = [finding for finding in found if finding.status == worst.status]
    names = ", ".join(finding.name for finding in concerned)
    if worst.status == ERROR:
        missing = [package for package in REQUIRED if any(package.name == finding.name for finding in concerned)]
        is_first = missing and missing[0].name == concerned[0].name  # one command for all of them
        command = install_command(*missing) if is_first else concerned[0].command
        return Finding(VERDICT, ERROR, f"The engine cannot work here: {names}.", worst.remedy, command, worst.code)
    what = f"Python {platform.python_version()}, torch {installed_version(TORCH)}"
    if worst.status == WARNING:
        sentence = f"The engine works, with a limit ({names}): {what}."
        return Finding(VERDICT, WARNING, sentence, worst.remedy, worst.command)
    return Finding(VERDICT, OK, f"The engine is ready: {what}.")


def python() -> Finding:
    version = platform.python_version()
    if PYTHON.contains(version):
        return Finding("python", OK, f"Python {version} is among the tested versions ({PYTHON}): {sys.executable}.")
    sentence = f"Python {version} is not among the tested versions ({PYTHON}): {sys.executable}."
    return Finding("python", WARNING, sentence, "Use one of the tested versions where something fails.")


def poses() -> Finding:
    """Judge the package that finds camera poses, without loading it: stages load it in a child process."""
    version = installed_version(POSES)
    if version is None:
        sentence = "pycolmap is not installed: only photos without camera poses need it."
        return Finding(POSES.name, OK, sentence, INSTALL, install_command(POSES))
    return _judged(POSES, version)


def fast() -> Finding:
    """Judge the package that compiles kernels for the processor; torch computes the same without it."""
    if installed_version(FAST) is None:
        found = Finding(FAST.name, OK, f"{FAST.pip} is not installed.", INSTALL, install_command(FAST))
    else:
        found = check_package(FAST)
    status = WARNING if found.status == ERROR else found.status
    return replace(found, status=status, sentence=f"{found.sentence} {FAST_BRINGS}", code="")


def check_package(package: Package) -> Finding:
    """Load a package and judge its version."""
    code = MissingDependency.code
    try:
        module = import_module(package.name)
    except ModuleNotFoundError as error:
        what = package.pip if error.name == package.name else f"{package.pip} needs {error.name}, which"
        return Finding(package.name, ERROR, f"{what} is not installed.", INSTALL, install_command(package), code)
    except Exception as error:  # a broken shared library may raise anything
        sentence = f"{package.pip} is installed, and cannot be loaded: {first_line(error)}."
        command = install_command(package, options="--force-reinstall ")
        return Finding(package.name, ERROR, sentence, "Install it anew:", command, code)
    return _judged(package, installed_version(package) or getattr(module, "__version__", "?"))


def _judged(package: Package, version: str) -> Finding:
    if package.range.contains(version):
        return Finding(package.name, OK, f"{package.pip} {version} is among the tested versions ({package.range}).")
    sentence = f"{package.pip} {version} is not among the tested versions ({package.range})."
    return Finding(package.name, WARNING, sentence, "Install a tested version:", install_command(package))


def install_command(*packages: Package, options: str = "") -> str:
    wanted = " ".join(f'"{package.requirement}"' for package in packages)
    return f'"{sys.executable}" -m pip install {options}{wanted}'


def installed_version(package: Package) -> str | None:
    """Return a package's version by its metadata, also where another distribution provides it, or None."""
    for distribution in (package.pip, *metadata.packages_distributions().get(package.name, ())):
        try:
            return metadata.version(distribution)
        except metadata.PackageNotFoundError:
            continue
    return None


def devices(chosen: str | None) -> Iterator[Finding]:
    """Yield what torch was built for, its cards, and the device of stages; `chosen` is their option."""
    import torch

    from ..compute.runtime import find_device
    from ..splats.rasterizer import backend

    build = f"NVIDIA cards (CUDA {torch.version.cuda})" if torch.version.cuda else PROCESSOR
    if getattr(torch.version, "hip", None):
        build = f"AMD cards (ROCm {torch.version.hip})"
    if build != PROCESSOR and not torch.cuda.is_available():
        sentence = f"This torch was built for {build}, and finds no such card: it computes on the processor."
        yield Finding("build", WARNING, sentence, "Update the card's driver, or install a torch for the processor.")
    elif build == PROCESSOR and shutil.which("nvidia-smi"):
        sentence = "This torch was built for the processor, and this computer has an NVIDIA card."
        yield Finding("build", WARNING, sentence, "Install a torch built for CUDA to learn on the card.")
    else:
        yield Finding("build", OK, f"This torch was built for {build}.")
    try:
        device = find_device(chosen)
    except KarfError as error:
        yield error_finding("device", error)
        return
    for number in range(torch.cuda.device_count()) if torch.cuda.is_available() else ():
        facts = torch.cuda.get_device_properties(number)
        sentence = f"cuda:{number} is {facts.name} with {facts.total_memory / GB:.1f} GB of memory."
        yield Finding(f"cuda:{number}", OK, sentence)
    if torch.backends.mps.is_available():
        yield Finding("mps", OK, "mps is Apple's GPU, untested: stages use it only with --device mps.")
    yield Finding("device", OK, f"Stages compute on {PROCESSOR if device.type == 'cpu' else device}.")
    yield rasterizer(device.type, backend(device))


def rasterizer(kind: str, backend: str | None) -> Finding:
    """Judge what rasterizes splats for stages on this kind of device; see `splats.rasterizer.backend`."""
    if backend is None:
        sentence = "Splats can be neither learned nor rendered: other cameras are rendered from the voxels."
        return Finding("rasterizer", WARNING, sentence, INSTALL, install_command(FAST))
    if backend == "gsplat" or kind != "cuda":
        where = "the card" if backend == "gsplat" else PROCESSOR
        return Finding("rasterizer", OK, f"Splats are computed on {where}, by {backend}.")
    sentence = f"Splats are computed on {PROCESSOR}, by {backend}: gsplat has no kernels for the card here."
    remedy = "For splats on an NVIDIA card install gsplat, and a CUDA toolkit to compile its kernels:"
    return Finding("rasterizer", OK, sentence, remedy, f'"{sys.executable}" -m pip install "{GSPLAT}"')


def processors() -> Finding:
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return Finding("processor", OK, f"{usable} processor cores can be used.")


def memory() -> Finding:
    total = total_memory()
    if total is None:
        return Finding("memory", OK, "This system does not say how much memory it has.")
    sentence = f"The computer has {total / GB:.1f} GB of memory."
    if total < LITTLE_MEMORY:
        remedy = "Use the preset demo and small photos, and close other programs."
        return Finding("memory", WARNING, sentence, remedy)
    return Finding("memory", OK, sentence)


def total_memory() -> int | None:
    if os.name == "nt":
        status = _MemoryStatus(dwLength=ctypes.sizeof(_MemoryStatus))
        answered = ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status))  # pyright: ignore[reportAttributeAccessIssue]
        return status.ullTotalPhys if answered else None
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        return None


def disk(folder: Path) -> Finding:
    try:
        free = shutil.disk_usage(folder).free
    except OSError as error:
        return _unwritable("disk", error)
    sentence = f"{free / GB:.1f} GB are free on the disk of {folder}."
    if free < NO_DISK:
        return Finding("disk", ERROR, sentence, FREE_SPACE, code=DataError.code)
    return Finding("disk", OK, sentence) if free >= LITTLE_DISK else Finding("disk", WARNING, sentence, FREE_SPACE)


def locks(folder: Path) -> Finding:
    """Check that a lock in this folder keeps out a second holder."""
    try:
        from filelock import SoftFileLease, Timeout

        from ..io.locks import acquire
    except ImportError:
        return Finding("locks", OK, "Locks are not tried without the package filelock.")
    try:
        with tempfile.TemporaryDirectory(prefix=".karf-doctor-", dir=folder) as inside:
            lock = acquire(Path(inside) / "lock")
            try:
                if isinstance(lock, SoftFileLease):
                    sentence = f"{folder} is on a file system without locks: a file with the owner's name stands in."
                    return Finding("locks", WARNING, sentence, ONE_AT_A_TIME)
                acquire(Path(inside) / "lock").release()
            finally:
                lock.release()
    except Timeout:
        return Finding("locks", OK, f"Locks work in {folder}.")
    except OSError as error:
        return _unwritable("locks", error)
    sentence = f"Locks do not hold in {folder}: two jobs could write at once."
    return Finding("locks", WARNING, sentence, ONE_AT_A_TIME)


def temporary() -> Finding:
    try:
        with tempfile.TemporaryFile() as stream:
            stream.write(b"KaRF")
            return Finding("temporary", OK, f"Temporary files can be written to {tempfile.gettempdir()}.")
    except OSError as error:
        return _unwritable("temporary", error)


def _unwritable(name: str, error: OSError) -> Finding:
    known = translate_error(error) or KarfError(f"No folder takes files: {error}.", OTHER_FOLDER)
    return error_finding(name, known)


class _MemoryStatus(ctypes.Structure):
    """MEMORYSTATUSEX of the Windows API."""

    _fields_ = (
        ("dwLength", ctypes.c_uint32),
        ("dwMemoryLoad", ctypes.c_uint32),
        *((name, ctypes.c_uint64) for name in ("ullTotalPhys", "ullAvailPhys", "ullTotalPageFile", "ullAvailPageFile")),
        *((name, ctypes.c_uint64) for name in ("ullTotalVirtual", "ullAvailVirtual", "ullAvailExtendedVirtual")),
    )
