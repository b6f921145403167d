"""The versions that the doctor knows are those of pyproject.toml."""

import tomllib

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

from blender_tests.engine.conftest import ROOT
from karf_engine.worker.findings import FAST, POSES, PYTHON, REQUIRED, Range

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def declared(*texts):
    """Names and ranges of requirements, without their markers."""
    return {(wanted.name, wanted.specifier) for wanted in map(Requirement, texts)}


def test_the_packages_and_their_ranges_are_those_that_are_installed():
    extras = PROJECT["optional-dependencies"]
    assert declared(*(each.requirement for each in REQUIRED)) == declared(*PROJECT["dependencies"])
    assert declared(POSES.requirement) == declared(*extras["photos"])
    assert declared(FAST.requirement) == declared(*extras["fast"])


@pytest.mark.parametrize(
    ("system", "processor", "is_asked_for"),
    [("linux", "x86_64", True), ("win32", "AMD64", True), ("darwin", "arm64", True), ("darwin", "x86_64", False)],
)
def test_what_learns_fast_is_asked_for_where_it_has_files(system, processor, is_asked_for):
    (wanted,) = map(Requirement, PROJECT["optional-dependencies"]["fast"])
    assert wanted.marker.evaluate({"sys_platform": system, "platform_machine": processor}) == is_asked_for


def test_the_lowest_python_is_the_one_that_is_required_and_all_named_ones_are_tested():
    assert SpecifierSet(PROJECT["requires-python"]) == SpecifierSet(f">={PYTHON.lowest}")
    named = [line.rpartition(" ")[2] for line in PROJECT["classifiers"] if "Python :: 3." in line]
    assert named and all(PYTHON.contains(version) for version in named)


@pytest.mark.parametrize(
    ("versions", "is_inside"),
    [
        (["2.6", "2.6.0", "2.13.0+cu128", "2.99.99", "2.7.0a0+git12"], True),
        (["2.5.9", "3", "3.0.0", "10.1", "?", ""], False),
    ],
    ids=["inside", "outside"],
)
def test_a_range_holds_versions_from_its_lowest_to_below_its_end(versions, is_inside):
    assert [Range("2.6", "3").contains(version) for version in versions] == [is_inside] * len(versions)
