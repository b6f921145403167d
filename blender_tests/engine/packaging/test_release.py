"""The extension's build: with Python alone, the same bytes each time, and one version everywhere."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
import zipfile

import pytest

from blender_tests.engine.conftest import ROOT
from tools.release.manifest import engine_version
from tools.release.packing import packed_files

FILES = ("__init__.py", "blender_manifest.toml", "LICENSE", "CITATION.cff", "README.md")
FOLDERS = ("karf_engine", "karf_blender", "tools")
PACKAGE = f"karf-{engine_version(ROOT)}.zip"


def copied(folder):
    """A copy of what is packed and what packs it, with other times and permissions, and no environments."""
    for name in FOLDERS:
        shutil.copytree(ROOT / name, folder / name, copy_function=shutil.copyfile)
    for name in FILES:
        shutil.copyfile(ROOT / name, folder / name)
    (folder / "karf_engine" / "version.py").chmod(0o700)
    return folder


@pytest.fixture
def checkout(tmp_path):
    return copied(tmp_path / "checkout")


def build(checkout, **environment):
    """Run the verb as a user does, with nothing installed."""
    command = [sys.executable, "-I", "-S", checkout / "tools" / "dev.py", "build"]
    return subprocess.run(command, env=os.environ | environment, capture_output=True, text=True)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A checkout that was built where there is no Blender, and what was said."""
    checkout = copied(tmp_path_factory.mktemp("release") / "checkout")
    done = build(checkout, PATH="")
    assert done.returncode == 0, done.stderr
    return checkout, done.stdout


def test_where_there_is_no_blender_the_build_says_that_nothing_was_validated(built):
    checkout, said = built
    assert f"{PACKAGE} was not validated" in said
    assert not (checkout / ".venv").exists()


def test_nothing_in_the_package_depends_on_this_computer(built):
    entries = zipfile.ZipFile(built[0] / "dist" / PACKAGE).infolist()
    assert [entry.filename for entry in entries] == sorted(entry.filename for entry in entries)
    assert {(entry.date_time, entry.external_attr, entry.create_system, entry.compress_type) for entry in entries} == {
        ((1980, 1, 1, 0, 0, 0), 0o100644 << 16, 3, zipfile.ZIP_STORED)
    }


def test_the_checksums_and_the_repository_are_of_the_package(built):
    out = built[0] / "dist"
    package = (out / PACKAGE).read_bytes()
    digest = hashlib.sha256(package).hexdigest()
    assert f"{digest}  {PACKAGE}\n" in (out / "SHA256SUMS").read_text()
    (listed,) = json.loads((out / "repository" / "index.json").read_text())["data"]
    assert (listed["archive_hash"], listed["version"]) == (f"sha256:{digest}", engine_version(ROOT))
    assert (out / "repository" / listed["archive_url"]).read_bytes() == package


def test_two_builds_have_the_same_bytes_whatever_times_and_permissions_files_have(built):
    checkout, _ = built
    names = (PACKAGE, "SHA256SUMS", "repository/index.json")
    before = [(checkout / "dist" / name).read_bytes() for name in names]
    os.utime(checkout / "README.md", (10**9, 10**9))
    (checkout / "karf_engine" / "version.py").chmod(0o644)
    assert build(checkout, PATH="").returncode == 0
    assert before == [(checkout / "dist" / name).read_bytes() for name in names]


@pytest.mark.parametrize("name", ["blender_manifest.toml", "CITATION.cff"])
def test_a_file_that_tells_another_version_stops_the_build(checkout, name):
    path = checkout / name
    path.write_text(path.read_text().replace(engine_version(ROOT), "9.8.7", 1))
    done = build(checkout, PATH="")
    assert done.returncode == 1 and f"{name} says version 9.8.7" in done.stderr
    assert not (checkout / "dist").exists()


@pytest.mark.parametrize("pattern", ["!kept.py", "a/b", "/docs/**", "/", "\\#a"])
def test_a_pattern_that_is_not_known_stops_the_build(tmp_path, pattern):
    with pytest.raises(SystemExit, match="does not know"):
        packed_files(tmp_path, [pattern])


@pytest.mark.skipif(os.name == "nt", reason="a script is not a program there")
@pytest.mark.parametrize("verdict", [0, 1])
def test_a_blender_on_the_path_judges_the_package(checkout, tmp_path, verdict):
    blender = tmp_path / "blender"
    blender.write_text(f'#!/bin/sh\necho "asked: $*"\nexit {verdict}\n')
    blender.chmod(0o755)
    done = build(checkout, PATH=str(tmp_path))
    assert f"asked: --command extension validate {checkout / 'dist' / PACKAGE}" in done.stdout
    assert done.returncode == verdict
