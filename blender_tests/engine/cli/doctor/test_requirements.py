"""The versions that the doctor knows are those of pyproject.toml."""

import tomllib

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

from blender_tests.engine.conftest import ROOT
from karf_engine.worker.findings import FAST, POSES, PYTHON, REQUIRED, Range

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_the_packages_and_their_ranges_are_those_that_are_installed():
    declared = {(wanted.name, wanted.specifier) for wanted in map(Requirement, PROJECT["dependencies"])}
    assert {
        (wanted.name, wanted.specifier) for wanted in (Requirement(each.requirement) for each in REQUIRED)
    } == declared


def test_the_package_for_poses_is_that_of_its_extra():
    (declared,) = map(Requirement, PROJECT["optional-dependencies"]["photos"])
    assert Requirement(POSES.requirement) == declared


def test_the_package_that_learns_fast_is_that_of_its_extra():
    (declared,) = map(Requirement, PROJECT["optional-dependencies"]["fast"])
    assert (declared.name, declared.specifier) == (FAST.name, Requirement(FAST.requirement).specifier)


@pytest.mark.parametrize(
    ("system", "processor", "is_asked_for"),
    [("linux", "x86_64", True), ("win32", "AMD64", True), ("darwin", "arm64", True), ("darwin", "x86_64", False)],
)
def test_it_is_asked_for_where_it_has_files(system, processor, is_asked_for):
    (declared,) = map(Requirement, PROJECT["optional-dependencies"]["fast"])
    assert declared.marker.evaluate({"sys_platform": system, "platform_machine": processor}) == is_asked_for


def test_the_lowest_python_is_the_one_that_is_required_and_all_named_ones_are_tested():
    assert SpecifierSet(PROJECT["requires-python"]) == SpecifierSet(f">={PYTHON.lowest}")
    named = [line.rpartition(" ")[2] for line in PROJECT["classifiers"] if "Python :: 3." in line]
    assert named and all(PYTHON.contains(version) for version in named)


@pytest.mark.parametrize("version", ["2.6", "2.6.0", "2.13.0+cu128", "2.99.99", "2.7.0a0+git12"])
def test_versions_in_a_range(version):
    assert Range("2.6", "3").contains(version)


@pytest.mark.parametrize("version", ["2.5.9", "3", "3.0.0", "10.1", "?", ""])
def test_versions_outside_a_range(version):
    assert not Range("2.6", "3").contains(version)
