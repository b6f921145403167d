"""Commands as a person types them, for each kind of shell. No bpy."""

import re
import shlex
from collections.abc import Sequence

SHELLS = ("posix", "powershell", "cmd")
PLAIN = re.compile(r"[\w./:\\=+-]+")  # text that no Windows shell interprets


def line(command: Sequence[str], shell: str) -> str:
    """A command as one line for a shell of `SHELLS`.

    Examples:
        >>> print(line(["C:\\\\my env\\\\python.exe", "-m", "venv"], "powershell"))
        & 'C:\\my env\\python.exe' -m venv
    """
    if shell == "posix":
        return shlex.join(command)
    if shell == "powershell":
        words = [word if PLAIN.fullmatch(word) else "'" + word.replace("'", "''") + "'" for word in command]
        return " ".join(["&", *words])
    # a quotation mark cannot be in a Windows path, and no other argument has one
    return " ".join(word if PLAIN.fullmatch(word) else f'"{word}"' for word in command)
