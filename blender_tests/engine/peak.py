"""How much memory code takes, measured in a process of its own."""

import subprocess
import sys

from blender_tests.engine.conftest import ROOT

HEAD = f"import re, resource, sys; from pathlib import Path; sys.path.insert(0, {str(ROOT)!r})\n"
TAIL = """
finally:
    own = re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())  # getrusage has the parent's in it
    print(max(int(own[1]), resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss))
"""


def peak_of(code: str, *arguments: object, fails_with: str = "") -> int:
    """Bytes that code takes at most, or the largest of its children does; Linux.

    Args:
        code: One line; it may use `sys.argv` and `Path`.
        arguments: `sys.argv[1:]`.
        fails_with: The error that it must raise, if any.
    """
    command = [sys.executable, "-c", f"{HEAD}try:\n    {code}{TAIL}", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode != 0) == bool(fails_with) and fails_with in done.stderr, done.stderr
    return 1024 * int(done.stdout)
