"""The lock files of the engine's environment against what requirements/ and pyproject.toml say."""

import re

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name, parse_wheel_filename

from blender_tests.engine.conftest import ROOT

from .test_requirements import EXTRAS, PROJECT, pins

FOLDER = ROOT / "karf_blender" / "engine" / "installer" / "requirements"
LOCKS = {path.stem: path.read_text(encoding="utf-8") for path in FOLDER.glob("*.txt")}
PYTHONS = ("cp311", "cp312", "cp313", "cp314")
BUILDS = {
    "linux-x86_64": ("cpu", "cuda", "rocm"),
    "linux-aarch64": ("cpu", "cuda"),
    "windows-x86_64": ("cpu", "cuda"),
    "macos-arm64": ("cpu", "mps"),
}
ENVIRONMENTS = [f"{system}-{build}" for system, builds in BUILDS.items() for build in builds]
PACKAGE = re.compile(r"((?:# \S+\.whl \d+\n)+)(\S+)==(\S+)((?: \\\n    --hash=sha256:[0-9a-f]{64})*)\n")


def packages(lock):
    """Name -> version, files, number of hashes."""
    found = PACKAGE.findall(LOCKS[lock])
    return {
        name: (version, re.findall(r"# (\S+)", files), rest.count("--hash")) for files, name, version, rest in found
    }


def versions(lock):
    return {name: version for name, (version, _, _) in packages(lock).items()}


def test_every_usual_system_has_its_builds_and_pycolmap_where_it_has_files():
    photos = [f"{system}-photos" for system in BUILDS if system != "linux-aarch64"]
    assert set(LOCKS) == {*ENVIRONMENTS, *photos, "uv"}
    (wanted,) = map(Requirement, EXTRAS["photos"])
    for lock in photos:
        assert set(versions(lock)) == {"pycolmap"} and wanted.specifier.contains(versions(lock)["pycolmap"])


@pytest.mark.parametrize("lock", ENVIRONMENTS)
def test_it_has_the_versions_that_development_has(lock):
    found, pinned = versions(lock), pins("engine")
    for text in PROJECT["dependencies"] + EXTRAS["fast"]:
        wanted = Requirement(text)
        name = canonicalize_name(wanted.name)
        assert found[name].partition("+")[0] == pinned[name], f"run `python3 tools/dev.py lock`: {name} was changed"
        assert wanted.specifier.contains(found[name])
    assert {name: version for name, version in found.items() if pinned.get(name, version) != version} == {}


def test_uv_is_the_one_that_has_looked_the_files_up():
    assert versions("uv") == {"uv": pins("lock")["uv"]} and len(packages("uv")["uv"][1]) == len(BUILDS)


@pytest.mark.parametrize("lock", LOCKS)
def test_every_file_has_a_hash_and_there_is_one_for_every_python(lock):
    text = LOCKS[lock]
    assert text.count("\n# ") == len(re.findall(r"^# \S+\.whl \d+$", text, re.M)) and "//" not in text
    assert PACKAGE.sub("", text.partition("\n")[2]) == ""
    for name, (version, files, hashes) in packages(lock).items():
        if hashes == 0:  # of torch's own index
            assert name == "torch" and re.fullmatch(r"torch-[\d.]+\+\w+\*?-\*\.whl", files[0])
            continue
        assert hashes == len(files)
        for file in files:
            assert parse_wheel_filename(file)[:2] == (canonicalize_name(name), parse_wheel_filename(file)[1])
            assert str(parse_wheel_filename(file)[1]) == version
        tags = {file.split("-")[2] for file in files}
        assert tags == set(PYTHONS) or len(files) == 1 or name == "uv"
