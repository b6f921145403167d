"""Version ranges of pyproject.toml, pins of requirements/, and lock files of the engine's environment."""

import re
import subprocess
import sys
import tomllib

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name, parse_wheel_filename

from blender_tests.engine.conftest import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
ENGINE_EXTRAS = ("photos", "fast", "gpu", "splats", "metrics", "farm", "test", "readers", "lint")
WANTED = {
    "engine": [*PROJECT["dependencies"], *(text for extra in ENGINE_EXTRAS for text in EXTRAS[extra])],
    "blender": [*EXTRAS["blender"], *EXTRAS["test"]],
    "docs": EXTRAS["docs"],
}


def pins(environment):
    """Version by package."""
    text = (ROOT / "requirements" / f"{environment}.txt").read_text(encoding="utf-8")
    lines = [line.partition("#")[0].strip() for line in text.splitlines()]
    return dict(line.lower().split("==") for line in lines if line)


@pytest.mark.parametrize("environment", ["engine", "blender", "docs", "wheel", "lock"])
def test_versions_are_pinned_exactly(environment):
    assert all(re.fullmatch(r"[\d.]+(post\d+|b\d+)?", version) for version in pins(environment).values())


@pytest.mark.parametrize("environment", WANTED)
def test_pins_are_within_declared_ranges(environment):
    pinned = pins(environment)
    for text in WANTED[environment]:
        wanted = Requirement(text)
        assert wanted.specifier.contains(pinned[wanted.name.lower()]), text


def test_dependency_ranges_have_both_bounds():
    ranges = [Requirement(text) for text in PROJECT["dependencies"]]
    assert all({part.operator for part in wanted.specifier} == {">=", "<"} for wanted in ranges)


def test_learning_and_rendering_import_without_extras():
    extras = ("skimage", "numba", "pycolmap", "openjd", "gsply", "gsplat", "pxr")
    code = f"import sys; sys.modules.update(dict.fromkeys({extras!r})); import karf_engine.commands.dispatch; "
    code += "from karf_engine.commands import geometry, palette, recoloring, render, segmentation, splats"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


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
    """Version, files and number of hashes by package."""
    rows = PACKAGE.findall(LOCKS[lock])
    return {name: (version, re.findall(r"# (\S+)", files), rest.count("--hash")) for files, name, version, rest in rows}


def versions(lock):
    return {name: version for name, (version, _, _) in packages(lock).items()}


def test_every_system_has_its_lock_files():
    photos = [f"{system}-photos" for system in BUILDS if system != "linux-aarch64"]
    assert set(LOCKS) == {*ENVIRONMENTS, *photos, "uv"}
    (wanted,) = map(Requirement, EXTRAS["photos"])
    for lock in photos:
        assert set(versions(lock)) == {"pycolmap"} and wanted.specifier.contains(versions(lock)["pycolmap"])


@pytest.mark.parametrize("lock", ENVIRONMENTS)
def test_lock_file_has_the_pinned_versions(lock):
    found, pinned = versions(lock), pins("engine")
    for text in PROJECT["dependencies"] + EXTRAS["fast"]:
        wanted = Requirement(text)
        name = canonicalize_name(wanted.name)
        assert found[name].partition("+")[0] == pinned[name], f"run `python3 tools/dev.py lock`: {name} was changed"
        assert wanted.specifier.contains(found[name])
    assert {name: version for name, version in found.items() if pinned.get(name, version) != version} == {}


def test_locked_uv_is_the_pinned_one():
    assert versions("uv") == {"uv": pins("lock")["uv"]} and len(packages("uv")["uv"][1]) == len(BUILDS)


@pytest.mark.parametrize("lock", LOCKS)
def test_locked_files_have_hashes_and_cover_every_python(lock):
    text = LOCKS[lock]
    assert text.count("\n# ") == len(re.findall(r"^# \S+\.whl \d+$", text, re.M)) and "//" not in text
    assert PACKAGE.sub("", text.partition("\n")[2]) == ""
    for name, (version, files, hashes) in packages(lock).items():
        if hashes == 0:  # from torch's own index
            assert name == "torch" and re.fullmatch(r"torch-[\d.]+\+\w+\*?-\*\.whl", files[0])
            continue
        assert hashes == len(files)
        for file in files:
            file_name, file_version, *_ = parse_wheel_filename(file)
            assert (file_name, str(file_version)) == (canonicalize_name(name), version)
        tags = {file.split("-")[2] for file in files}
        assert tags == set(PYTHONS) or len(files) == 1 or name == "uv"
