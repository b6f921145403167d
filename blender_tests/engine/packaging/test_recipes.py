"""The extension's recipes of the engine's environment against what requirements/ and pyproject.toml say."""

import json
import re

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name, parse_wheel_filename

from blender_tests.engine.conftest import ROOT

from .test_requirements import EXTRAS, PROJECT, pins

TEXT = (ROOT / "karf_blender" / "engine" / "managed" / "recipes.json").read_text(encoding="utf-8")
CONTENT = json.loads(TEXT)
CASES = [(system, python) for system, pythons in CONTENT["recipes"].items() for python in pythons]


def versions(system, python, *parts):
    recipe = CONTENT["recipes"][system][python]
    wheels = [CONTENT["wheels"][file] for part in parts for file in recipe.get(part, ())]
    return {wheel["name"]: wheel["version"] for wheel in wheels}


def test_every_usual_system_and_python_has_a_recipe():
    systems = ("linux-x86_64", "linux-aarch64", "windows-x86_64", "macos-arm64")
    assert set(CASES) == {(system, python) for system in systems for python in ("3.11", "3.12", "3.13", "3.14")}


@pytest.mark.parametrize(("system", "python"), CASES)
def test_it_has_the_versions_that_development_has(system, python):
    found, pinned = versions(system, python, "base", "torch"), pins("engine")
    for text in PROJECT["dependencies"]:
        wanted = Requirement(text)
        name = canonicalize_name(wanted.name)
        assert found[name] == pinned[name], f"`python3 tools/dev.py lock` has not been run since {name} was changed"
        assert wanted.specifier.contains(found[name])
    assert {name: version for name, version in found.items() if pinned.get(name, version) != version} == {}


def test_the_extra_is_there_for_all_systems_that_pycolmap_has_files_for():
    (photos,) = map(Requirement, EXTRAS["photos"])
    for system, python in CASES:
        found = versions(system, python, "photos")
        assert set(found) == (set() if system == "linux-aarch64" else {"pycolmap"})
        assert all(photos.specifier.contains(version) for version in found.values())


def test_what_learns_fast_is_there_for_all_systems():
    (fast,) = map(Requirement, EXTRAS["fast"])
    for case in CASES:
        found = versions(*case, "fast")
        assert set(found) == {"numba", "llvmlite"} and fast.specifier.contains(found["numba"])
        assert {name: pins("engine")[name] for name in found} == found


def test_uv_is_the_one_that_has_looked_the_files_up():
    assert {versions(*case, "uv")["uv"] for case in CASES} == {pins("lock")["uv"]}


@pytest.mark.parametrize("file", CONTENT["wheels"])
def test_every_file_is_what_its_entry_says(file):
    entry = CONTENT["wheels"][file]
    name, version, _, _ = parse_wheel_filename(file)
    assert (name, str(version)) == (entry["name"], entry["version"])
    assert re.fullmatch("[0-9a-f]{64}", entry["sha256"]) and entry["size"] > 1000


def test_no_place_is_named():
    assert "//" not in TEXT
