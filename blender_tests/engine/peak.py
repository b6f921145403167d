"""Measure the peak memory of code in its own process."""

import subprocess
import sys

from blender_tests.engine.conftest import ROOT

HEAD = f"import re, resource, sys; from pathlib import Path; sys.path.insert(0, {str(ROOT)!r})\n"
TAIL = """
finally:
    own = re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())  # getrusage includes the parent's
    print(max(int(own[1]), resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss))
"""


def peak_of(code: str, *arguments: object, fails_with: str = "") -> int:
    """Peak bytes of one line of code, or of its largest child process; Linux.

    The code may use `Path`, and the arguments as `sys.argv[1:]`; `fails_with` is the error that it must raise, if any.
    """
    command = [sys.executable, "-c", f"{HEAD}try:\n    {code}{TAIL}", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode != 0) == bool(fails_with) and fails_with in done.stderr, done.stderr
    return 1024 * int(done.stdout)
