"""Process ids of this computer."""

from __future__ import annotations

import os
import platform
import sys
from contextlib import suppress
from pathlib import Path

SYNCHRONIZE, NO_SUCH_PROCESS, STILL_RUNS = 0x100000, 87, 0x102  # Windows: access right, error, wait result


def host_name() -> str:
    """Return the name of this computer, on Linux with its process namespace (containers number processes anew)."""
    with suppress(OSError):
        return f"{platform.node()} {Path('/proc/self/ns/pid').readlink()}"
    return platform.node()


def is_running(pid: int) -> bool:
    """Test whether a process of this computer has this id."""
    if sys.platform == "win32":  # `os.kill` would end the process
        import ctypes

        kernel = ctypes.WinDLL("kernel32", use_last_error=True)
        handle = kernel.OpenProcess(SYNCHRONIZE, False, pid)
        if not handle:
            return ctypes.get_last_error() != NO_SUCH_PROCESS
        running = kernel.WaitForSingleObject(handle, 0) == STILL_RUNS
        kernel.CloseHandle(handle)
        return running
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:  # another user's
        pass
    return True
