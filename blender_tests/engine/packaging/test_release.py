"""The extension's build needs only Python, is reproducible, and has one version everywhere."""

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
    """A copy of the packed files and the build tools, with other times and permissions."""
    for name in FOLDERS:
        ignored = shutil.ignore_patterns("node_modules", "dist")
        shutil.copytree(ROOT / name, folder / name, copy_function=shutil.copyfile, ignore=ignored)
    for name in FILES:
        shutil.copyfile(ROOT / name, folder / name)
    (folder / "karf_engine" / "version.py").chmod(0o700)
    return folder


def build(checkout, **environment):
    """Build as a user does, with nothing installed."""
    command = [sys.executable, "-I", "-S", checkout / "tools" / "dev.py", "build"]
    return subprocess.run(command, env=os.environ | environment, capture_output=True, text=True)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A checkout that was built without Blender, and the output."""
    checkout = copied(tmp_path_factory.mktemp("release") / "checkout")
    done = build(checkout, PATH="")
    assert done.returncode == 0, done.stderr
    return checkout, done.stdout


def test_build_without_blender_reports_missing_validation(built):
    checkout, output = built
    assert f"{PACKAGE} was not validated" in output
    assert not (checkout / ".venv").exists()


def test_package_has_the_viewer_of_pages_alone_once_it_is_built(built, tmp_path):
    web = "karf_engine/export/page/web"
    assert "exports no web pages" in built[1] and "python3 tools/dev.py page" in built[1]
    checkout = copied(tmp_path / "checkout")
    for name in ("dist/index.html", "dist/page.js", "dist/licenses.txt", "src/a.js", "package.json", ".npmrc",
                 "node_modules/three/a.js"):  # fmt: skip
        (checkout / web / name).parent.mkdir(parents=True, exist_ok=True)
        (checkout / web / name).write_text("")
    assert "web pages" not in build(checkout, PATH="").stdout
    names = zipfile.ZipFile(checkout / "dist" / PACKAGE).namelist()
    found = {name.removeprefix(f"{web}/") for name in names if name.startswith(web)}
    assert found == {"dist/index.html", "dist/page.js", "dist/licenses.txt"}


def test_package_entries_do_not_depend_on_the_computer(built):
    entries = zipfile.ZipFile(built[0] / "dist" / PACKAGE).infolist()
    assert [entry.filename for entry in entries] == sorted(entry.filename for entry in entries)
    facts = {(entry.date_time, entry.external_attr, entry.create_system, entry.compress_type) for entry in entries}
    assert facts == {((1980, 1, 1, 0, 0, 0), 0o100644 << 16, 3, zipfile.ZIP_STORED)}


def test_checksums_and_repository_match_the_package(built):
    out = built[0] / "dist"
    package = (out / PACKAGE).read_bytes()
    digest = hashlib.sha256(package).hexdigest()
    assert f"{digest}  {PACKAGE}\n" in (out / "SHA256SUMS").read_text()
    (listed,) = json.loads((out / "repository" / "index.json").read_text())["data"]
    assert (listed["archive_hash"], listed["version"]) == (f"sha256:{digest}", engine_version(ROOT))
    assert (out / "repository" / listed["archive_url"]).read_bytes() == package


def test_builds_are_byte_identical(built):
    checkout, _ = built
    names = (PACKAGE, "SHA256SUMS", "repository/index.json")
    before = [(checkout / "dist" / name).read_bytes() for name in names]
    os.utime(checkout / "README.md", (10**9, 10**9))
    (checkout / "karf_engine" / "version.py").chmod(0o644)
    assert build(checkout, PATH="").returncode == 0
    assert before == [(checkout / "dist" / name).read_bytes() for name in names]


@pytest.mark.parametrize("name", ["blender_manifest.toml", "CITATION.cff"])
def test_differing_version_stops_the_build(tmp_path, name):
    checkout = copied(tmp_path / "checkout")
    path = checkout / name
    path.write_text(path.read_text().replace(engine_version(ROOT), "9.8.7", 1))
    done = build(checkout, PATH="")
    assert done.returncode == 1 and f"{name} says version 9.8.7" in done.stderr
    assert not (checkout / "dist").exists()


@pytest.mark.parametrize("pattern", ["!kept.py", "a/b", "/docs/**", "/", "\\#a"])
def test_unsupported_pattern_stops_the_build(tmp_path, pattern):
    with pytest.raises(SystemExit, match="does not know"):
        packed_files(tmp_path, [pattern])


@pytest.mark.skipif(os.name == "nt", reason="shell script")
@pytest.mark.parametrize("verdict", [0, 1])
def test_blender_on_the_path_validates_the_package(tmp_path, verdict):
    checkout, blender = copied(tmp_path / "checkout"), tmp_path / "blender"
    blender.write_text(f'#!/bin/sh\necho "asked: $*"\nexit {verdict}\n')
    blender.chmod(0o755)
    done = build(checkout, PATH=str(tmp_path))
    assert f"asked: --command extension validate {checkout / 'dist' / PACKAGE}" in done.stdout
    assert done.returncode == verdict
