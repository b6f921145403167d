"""Check the computer: Python, processor, memory, disk, locks and temporary files."""

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
from ...io.failures import FREE_SPACE, OTHER_FOLDER, translate_error
from ...worker.findings import ERROR, OK, WARNING, Finding, error_finding
from ...worker.requirements import PYTHON

GB = 1e9
LITTLE_MEMORY = 4 * GB  # the preset demo learns in 1 GB; Blender and the system need as much again
LITTLE_DISK = 2 * GB  # a project and its pictures take tens of megabytes to some gigabytes
NO_DISK = 0.1 * GB  # too little for any project
ONE_AT_A_TIME = "Let one program at a time work on a project there, or choose a folder on another disk."


def findings(folder: Path) -> Iterator[Finding]:
    """Yield the findings about the computer and the disk of this folder, which need not exist."""
    folder = _existing(folder)
    yield processors()
    yield memory()
    yield disk(folder)
    yield locks(folder)
    yield temporary()


def python() -> Finding:
    """Compare this Python's version with the tested ones."""
    version = platform.python_version()
    if PYTHON.contains(version):
        return Finding("python", OK, f"Python {version} is among the tested versions ({PYTHON}): {sys.executable}.")
    sentence = f"Python {version} is not among the tested versions ({PYTHON}): {sys.executable}."
    return Finding("python", WARNING, sentence, "Use one of the tested versions where something fails.")


def processors() -> Finding:
    """Count the processor cores that this process may use."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return Finding("processor", OK, f"{usable} processor cores can be used.")


def memory() -> Finding:
    """Judge the size of the main memory."""
    total = total_memory()
    if total is None:
        return Finding("memory", OK, "This system does not say how much memory it has.")
    sentence = f"The computer has {total / GB:.1f} GB of memory."
    if total < LITTLE_MEMORY:
        remedy = "Use the preset demo and small photos, and close other programs."
        return Finding("memory", WARNING, sentence, remedy)
    return Finding("memory", OK, sentence)


def total_memory() -> int | None:
    """Return the main memory in bytes, or None where the system does not tell."""
    if os.name == "nt":
        return _windows_memory()
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        return None


def disk(folder: Path) -> Finding:
    """Judge the free space of a folder's disk."""
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
    """Check that temporary files can be written."""
    try:
        with tempfile.TemporaryFile() as stream:
            stream.write(b"KaRF")
            return Finding("temporary", OK, f"Temporary files can be written to {tempfile.gettempdir()}.")
    except OSError as error:
        return _unwritable("temporary", error)


def _unwritable(name: str, error: OSError) -> Finding:
    known = translate_error(error) or KarfError(f"No folder takes files: {error}.", OTHER_FOLDER)
    return error_finding(name, known)


def _existing(folder: Path) -> Path:
    """Return the folder, or its nearest existing parent."""
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
    answered = ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status))  # pyright: ignore[reportAttributeAccessIssue]
    return status.ullTotalPhys if answered else None
