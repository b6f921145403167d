"""The computer: Python, processor, memory, disk, locks, temporary files. With the standard library alone."""

from __future__ import annotations

import ctypes
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from ...errors import DataError, KarfError
from ...io.failures import FREE_SPACE, OTHER_FOLDER, known_failure
from ...worker.findings import ERROR, OK, WARNING, Finding, failing
from ...worker.requirements import PYTHON

GB = 1e9
LITTLE_MEMORY = 4 * GB  # the preset demo learns in 1 GB; Blender and the system need as much again
LITTLE_DISK = 2 * GB  # a project and its pictures take tens of megabytes to some gigabytes
NO_DISK = 0.1 * GB  # no project fits
ONE_AT_A_TIME = "Let one program at a time work on a project there, or choose a folder on another disk."


def findings(folder: Path) -> Iterator[Finding]:
    """What is found of the computer, and of the disk on which this folder lies or would lie."""
    folder = _existing(folder)
    yield processors()
    yield memory()
    yield disk(folder)
    yield locks(folder)
    yield temporary()


def python() -> Finding:
    """This Python's version, against those that were tested."""
    version = platform.python_version()
    if PYTHON.contains(version):
        return Finding("python", OK, f"Python {version} is among the tested versions ({PYTHON}): {sys.executable}.")
    sentence = f"Python {version} is not among the tested versions ({PYTHON}): {sys.executable}."
    return Finding("python", WARNING, sentence, "Use one of the tested versions where something fails.")


def processors() -> Finding:
    """How many processor cores this process may use."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return Finding("processor", OK, f"{usable} processor cores can be used.")


def memory() -> Finding:
    """How much main memory the computer has."""
    total = total_memory()
    if total is None:
        return Finding("memory", OK, "This system does not say how much memory it has.")
    sentence = f"The computer has {total / GB:.1f} GB of memory."
    if total < LITTLE_MEMORY:
        remedy = "Use the preset demo and small photos, and close other programs."
        return Finding("memory", WARNING, sentence, remedy)
    return Finding("memory", OK, sentence)


def total_memory() -> int | None:
    """Main memory in bytes; None where the system does not say."""
    if os.name == "nt":
        return _windows_memory()
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        return None


def disk(folder: Path) -> Finding:
    """How much space is free where projects would lie."""
    try:
        free = shutil.disk_usage(folder).free
    except OSError as error:
        return failing("disk", known_failure(error))
    sentence = f"{free / GB:.1f} GB are free on the disk of {folder}."
    if free < NO_DISK:
        return Finding("disk", ERROR, sentence, FREE_SPACE, code=DataError.code)
    return Finding("disk", OK, sentence) if free >= LITTLE_DISK else Finding("disk", WARNING, sentence, FREE_SPACE)


def locks(folder: Path) -> Finding:
    """Whether a second holder of a lock is kept out in this folder."""
    try:
        from filelock import SoftFileLease, Timeout

        from ...io.locks import acquire
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
    """Whether the folder of temporary files takes one."""
    try:
        with tempfile.TemporaryFile() as stream:
            stream.write(b"KaRF")
            return Finding("temporary", OK, f"Temporary files can be written to {tempfile.gettempdir()}.")
    except OSError as error:
        return _unwritable("temporary", error)


def _unwritable(name: str, error: OSError) -> Finding:
    known = known_failure(error) or KarfError(f"No folder takes files: {error}.", OTHER_FOLDER)
    return failing(name, known)


def _existing(folder: Path) -> Path:
    """The folder, or the nearest one above it that is there."""
    folder = folder.absolute()
    return next((each for each in (folder, *folder.parents) if each.is_dir()), folder)


class _MemoryStatus(ctypes.Structure):
    """MEMORYSTATUSEX of the Windows API."""

    _fields_ = (
        ("dwLength", ctypes.c_uint32),
        ("dwMemoryLoad", ctypes.c_uint32),
        *((name, ctypes.c_uint64) for name in ("ullTotalPhys", "ullAvailPhys", "ullTotalPageFile", "ullAvailPageFile")),
        *((name, ctypes.c_uint64) for name in ("ullTotalVirtual", "ullAvailVirtual", "ullAvailExtendedVirtual")),
    )


def _windows_memory() -> int | None:
    status = _MemoryStatus(dwLength=ctypes.sizeof(_MemoryStatus))
    answered = ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status))
    return status.ullTotalPhys if answered else None
