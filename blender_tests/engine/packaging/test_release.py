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

FILES = ("__init__.py", "blender_manifest.toml", "LICENSE", "CITATION.cff")
FOLDERS = ("karf_engine", "karf_blender", "tools")
PACKAGE = f"karf-{engine_version(ROOT)}.zip"


@pytest.fixture
def checkout(tmp_path):
    """A copy of what is packed and what packs it, with other times and permissions, and no environments."""
    copy = tmp_path / "checkout"
    for name in FOLDERS:
        shutil.copytree(ROOT / name, copy / name, copy_function=shutil.copyfile)
    for name in FILES:
        shutil.copyfile(ROOT / name, copy / name)
    shutil.copyfile(ROOT / "README.md", copy / "README.md")
    (copy / "karf_engine" / "version.py").chmod(0o700)
    return copy


def build(checkout, out, **environment):
    """Run the verb as a user does, with nothing installed."""
    command = [sys.executable, "-I", "-S", checkout / "tools" / "dev.py", "build"]
    done = subprocess.run(command, env=os.environ | environment, capture_output=True, text=True)
    if (checkout / "dist").is_dir():
        shutil.copytree(checkout / "dist", out, dirs_exist_ok=True)
    return done


def test_two_builds_have_the_same_bytes_whatever_times_and_permissions_files_have(checkout, tmp_path):
    first = build(checkout, tmp_path / "first", PATH="")
    os.utime(checkout / "README.md", (10**9, 10**9))
    second = build(checkout, tmp_path / "second", PATH="")
    assert first.returncode == second.returncode == 0, first.stderr + second.stderr
    for name in (PACKAGE, "SHA256SUMS", "repository/index.json"):
        assert (tmp_path / "first" / name).read_bytes() == (tmp_path / "second" / name).read_bytes()


def test_where_there_is_no_blender_the_build_says_that_nothing_was_validated(checkout, tmp_path):
    done = build(checkout, tmp_path / "out", PATH="")
    assert f"{PACKAGE} was not validated" in done.stdout
    assert not (checkout / ".venv").exists()


def test_nothing_in_the_package_depends_on_this_computer(checkout, tmp_path):
    build(checkout, tmp_path / "out", PATH="")
    entries = zipfile.ZipFile(tmp_path / "out" / PACKAGE).infolist()
    assert [entry.filename for entry in entries] == sorted(entry.filename for entry in entries)
    assert {(entry.date_time, entry.external_attr, entry.create_system, entry.compress_type) for entry in entries} == {
        ((1980, 1, 1, 0, 0, 0), 0o100644 << 16, 3, zipfile.ZIP_STORED)
    }


def test_the_checksums_and_the_repository_are_of_the_package(checkout, tmp_path):
    build(checkout, tmp_path / "out", PATH="")
    digest = hashlib.sha256((tmp_path / "out" / PACKAGE).read_bytes()).hexdigest()
    assert f"{digest}  {PACKAGE}\n" in (tmp_path / "out" / "SHA256SUMS").read_text()
    (listed,) = json.loads((tmp_path / "out" / "repository" / "index.json").read_text())["data"]
    assert (listed["archive_hash"], listed["version"]) == (f"sha256:{digest}", engine_version(ROOT))
    assert (tmp_path / "out" / "repository" / listed["archive_url"]).read_bytes() == (
        tmp_path / "out" / PACKAGE
    ).read_bytes()


@pytest.mark.parametrize("name", ["blender_manifest.toml", "CITATION.cff"])
def test_a_file_that_tells_another_version_stops_the_build(checkout, tmp_path, name):
    path = checkout / name
    path.write_text(path.read_text().replace(engine_version(ROOT), "9.8.7", 1))
    done = build(checkout, tmp_path / "out", PATH="")
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
    done = build(checkout, tmp_path / "out", PATH=str(tmp_path))
    assert f"asked: --command extension validate {checkout / 'dist' / PACKAGE}" in done.stdout
    assert done.returncode == verdict
