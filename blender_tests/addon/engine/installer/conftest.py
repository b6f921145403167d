"""Tiny wheels with lock files for this computer and Python, and the uv that installs them."""

import importlib
import os
import shutil
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from ...conftest import MODULE
from . import wheels

MODULE_NAMES = "chores computer home installation locks plan".split()
PYTHON = f"{sys.version_info.major}.{sys.version_info.minor}"


@pytest.fixture
def managed(addon):
    """The installer's modules by name."""
    package = f"{MODULE}.karf_blender.engine.installer"
    modules = {name: importlib.import_module(f"{package}.{name}") for name in MODULE_NAMES}
    return SimpleNamespace(**modules, api=addon.engine_api, processes=addon.processes)


@pytest.fixture
def uv(monkeypatch):
    """uv from KARF_TEST_UV, this environment or the PATH, without any configured index."""
    beside = shutil.which("uv", path=Path(sys.executable).parent)
    found = os.environ.get("KARF_TEST_UV") or beside or shutil.which("uv")
    if not found:
        pytest.skip("uv is not installed")
    for name in [name for name in os.environ if name.startswith(("UV_", "PIP_"))]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("UV_NO_CONFIG", "1")
    monkeypatch.setenv("PIP_CONFIG_FILE", os.devnull)
    return found


class Stock:
    """Wheels with lock files for this computer, which tests may change."""

    def __init__(self, folder, managed):
        self.folder, self.requirements, self.locks = folder / "wheels", folder / "requirements", managed.locks
        self.folder.mkdir()
        self.requirements.mkdir()
        self.here = managed.computer.Machine(managed.computer.detect_machine().platform)
        self.lists = {"cuda": {}, "photos": {}, "uv": {}}
        for name in wheels.MODULES:
            self.add(name, "1.0")
        self.add("torch", "2.0", wheels.torch("2.0", "13.0"))
        self.add("pycolmap", "4.0")
        system, _, processor = self.here.platform.partition("-")
        tags = {"linux": f"manylinux_2_17_{processor}", "windows": "win_amd64", "macos": "macosx_11_0_arm64"}
        self.uv_tag = f"py3-none-{tags[system]}"
        self.add("uv", "0.1", tag=self.uv_tag)

    def add(self, name, version, code=None, tag="py3-none-any", more=None):
        """Make the wheel of a package and lock it."""
        path = wheels.make(self.folder, name, version, code, tag, more)
        part = {"pycolmap": "photos", "uv": "uv"}.get(name, "cuda")
        self.lists[part][name] = wheels.locked(path, name, version)
        builds = self.lists | {"cpu": self.lists["cuda"] | {"torch": "# torch-2.0+cpu-*.whl 1000\ntorch==2.0\n"}}
        for each, packages in builds.items():
            file = "uv.txt" if each == "uv" else f"{self.here.platform}-{each}.txt"
            (self.requirements / file).write_text("".join(packages.values()))
        self.locks.read.cache_clear()


@pytest.fixture
def stock(managed, tmp_path, monkeypatch):
    monkeypatch.setattr(managed.locks, "FOLDER", tmp_path / "requirements")
    yield Stock(tmp_path, managed)
    managed.locks.read.cache_clear()


@pytest.fixture
def place(tmp_path):
    """The engine's folder, whose path has spaces and non-ASCII letters."""
    return tmp_path / "Pötte & Äpfel 李" / "engine"


@pytest.fixture
def index(stock):
    served = wheels.Index(stock.folder)
    yield served
    served.close()


@pytest.fixture
def planned(managed, stock, uv, place, monkeypatch):
    """A function that plans from the folder of wheels or from an index."""

    def plan(index=None, extras=(), build="cuda", folder=place, starter=uv):
        choices = managed.plan.Choices(folder, build, extras, None if index else stock.folder, starter)
        if index:
            monkeypatch.setenv("UV_DEFAULT_INDEX", index.url)
        return managed.plan.make(choices, sys.executable, True, os.environ, stock.here)

    return plan


@pytest.fixture
def install(managed, planned):
    """A function that installs a plan and returns the folder's status."""

    def install(plan=None):
        work = managed.installation.Installation(plan or planned())
        finish(work)
        work.check()
        return managed.home.status(work.plan.folder)

    return install


def finish(work):
    """Poll until the end."""
    while not work.ended:
        work.poll()
        time.sleep(0.02)
