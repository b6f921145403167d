"""The ranges that pyproject.toml allows against the versions that requirements/ pins."""

import re
import subprocess
import sys
import tomllib

import pytest
from packaging.requirements import Requirement

from blender_tests.engine.conftest import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
ENVIRONMENTS = {
    "engine": [
        *PROJECT["dependencies"],
        *EXTRAS["photos"],
        *EXTRAS["fast"],
        *EXTRAS["splats"],
        *EXTRAS["metrics"],
        *EXTRAS["farm"],
        *EXTRAS["test"],
        *EXTRAS["readers"],
        *EXTRAS["lint"],
    ],
    "blender": [*EXTRAS["blender"], *EXTRAS["test"]],
    "docs": EXTRAS["docs"],
}


def pins(environment):
    """Package -> version of every line."""
    text = (ROOT / "requirements" / f"{environment}.txt").read_text(encoding="utf-8")
    lines = [line.partition("#")[0].strip() for line in text.splitlines()]
    return dict(line.lower().split("==") for line in lines if line)


@pytest.mark.parametrize("environment", ["engine", "blender", "docs", "wheel", "lock"])
def test_every_version_is_pinned_to_the_digit(environment):
    assert all(re.fullmatch(r"[\d.]+(post\d+|b\d+)?", version) for version in pins(environment).values())


@pytest.mark.parametrize("environment", ENVIRONMENTS)
def test_the_pinned_versions_lie_in_the_allowed_ranges(environment):
    pinned = pins(environment)
    for text in ENVIRONMENTS[environment]:
        wanted = Requirement(text)
        assert wanted.specifier.contains(pinned[wanted.name.lower()]), text


def test_every_range_has_both_ends():
    ranges = [Requirement(text) for text in PROJECT["dependencies"]]
    assert all({part.operator for part in wanted.specifier} == {">=", "<"} for wanted in ranges)


def test_what_learns_and_renders_is_imported_without_any_extra():
    extras = ("skimage", "numba", "pycolmap", "openjd", "gsply", "pxr")
    code = f"import sys; sys.modules.update(dict.fromkeys({extras!r})); import karf_engine.commands.dispatch; "
    code += "from karf_engine.commands import geometry, palette, recoloring, render, segmentation, splats"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
