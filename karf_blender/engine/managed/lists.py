"""The lists of files that pip and uv are given, in pip's format: each file with its hash.

The installation writes them by `write`. Who installs by hand runs this file with any Python, so that it imports nothing
but the standard library:

    python lists.py FOLDER PLATFORM PYTHON LIST=PART,PART ...
"""

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

RECIPES = Path(__file__).with_name("recipes.json")


def requirement(name: str, version: str, sha256: str) -> str:
    """The line that allows one file only."""
    return f"{name}=={version} --hash=sha256:{sha256}"


def write(
    folder: Path, platform: str, python: str, lists: Mapping[str, Sequence[str]], recipes: Path = RECIPES
) -> None:
    """Write a list of files `<name>.txt` for each name in `lists`, of the parts of the recipe that stand there."""
    content = json.loads(recipes.read_text(encoding="utf-8"))
    folder.mkdir(parents=True, exist_ok=True)
    for name, parts in lists.items():
        files = [file for part in parts for file in content["recipes"][platform][python][part]]
        wheels = [content["wheels"][file] for file in files]
        lines = [requirement(wheel["name"], wheel["version"], wheel["sha256"]) for wheel in wheels]
        (folder / f"{name}.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    named = (argument.split("=") for argument in sys.argv[4:])
    write(Path(sys.argv[1]), sys.argv[2], sys.argv[3], {name: parts.split(",") for name, parts in named})
