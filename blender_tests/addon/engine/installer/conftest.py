"""Made lock files of tiny wheels for this computer and Python, and the uv that puts them in place."""

import importlib
import os
import shutil
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from ...conftest import MODULE
from . import wheels as making

ROOM = "chores computer home installation locks plan".split()
PYTHON = f"{sys.version_info.major}.{sys.version_info.minor}"


@pytest.fixture
def managed(addon):
    """The room's modules by name."""
    package = f"{MODULE}.karf_blender.engine.installer"
    modules = {name: importlib.import_module(f"{package}.{name}") for name in ROOM}
    return SimpleNamespace(**modules, api=addon.engine_api, processes=addon.processes)


@pytest.fixture
def uv(monkeypatch):
    """uv: that of KARF_TEST_UV, of this environment, or of the PATH. It is shown no index but what a test gives it."""
    beside = shutil.which("uv", path=Path(sys.executable).parent)
    found = os.environ.get("KARF_TEST_UV") or beside or shutil.which("uv")
    if not found:
        pytest.skip("uv is not installed")
    for name in [name for name in os.environ if name.startswith(("UV_", "PIP_"))]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("UV_NO_CONFIG", "1")
    monkeypatch.setenv("PIP_CONFIG_FILE", os.devnull)
    return found


class Kitchen:
    """Lock files and their wheels, which a test may change."""

    def __init__(self, folder, managed, monkeypatch):
        self.folder, self.locks = folder / "wheels", managed.locks
        self.requirements = folder / "requirements"
        self.folder.mkdir()
        self.requirements.mkdir()
        self.here = managed.computer.Machine(managed.computer.detect_machine().platform)
        monkeypatch.setattr(managed.locks, "FOLDER", self.requirements)
        self.lists = {"packages": {}, "photos": {}, "uv": {}}
        for name, module in making.MODULES.items():
            self.add("packages", name, "1.0", {f"{module}/__init__.py": f"name = {name!r}\n"})
        self.add("photos", "pycolmap", "4.0", {"pycolmap/__init__.py": ""})
        self.note("packages", making.make_torch(self.folder, "2.0", "13.0"), "torch", "2.0")
        system, _, processor = self.here.platform.partition("-")
        tags = {"linux": f"manylinux_2_17_{processor}", "windows": "win_amd64", "macos": "macosx_11_0_arm64"}
        self.add("uv", "uv", "0.1", {"uv/__init__.py": ""}, f"py3-none-{tags[system]}")
        self.write()

    def add(self, part, name, version, files, tag="py3-none-any"):
        self.note(part, making.make(self.folder, name, version, files, tag), name, version)

    def note(self, part, path, name, version):
        self.lists[part][name] = making.locked(path, name, version)

    def write(self):
        without_hash = "# torch-2.0+cpu-*.whl 1000\ntorch==2.0\n"
        lists = {
            f"{self.here.platform}-cuda": self.lists["packages"],
            f"{self.here.platform}-cpu": self.lists["packages"] | {"torch": without_hash},
            f"{self.here.platform}-photos": self.lists["photos"],
            "uv": self.lists["uv"],
        }
        for name, packages in lists.items():
            (self.requirements / f"{name}.txt").write_text("".join(packages.values()))
        self.locks.read.cache_clear()


@pytest.fixture
def kitchen(managed, tmp_path, monkeypatch):
    yield Kitchen(tmp_path, managed, monkeypatch)
    managed.locks.read.cache_clear()


@pytest.fixture
def place(tmp_path):
    """Where the engine goes: a folder with spaces and letters of other languages."""
    return tmp_path / "Pötte & Äpfel 李" / "engine"


@pytest.fixture
def index(kitchen):
    served = making.Index(kitchen.folder)
    yield served
    served.close()


@pytest.fixture
def planned(managed, kitchen, uv, place, monkeypatch):
    """A function that plans: from the folder of wheels, or from an index."""

    def plan(index=None, extras=(), build="cuda", folder=place, starter=uv):
        choices = managed.plan.Choices(folder, build, extras, None if index else kitchen.folder, starter)
        if index:
            monkeypatch.setenv("UV_DEFAULT_INDEX", index.url)
        return managed.plan.make(choices, sys.executable, True, os.environ, kitchen.here)

    return plan


@pytest.fixture
def install(managed, planned):
    """A function that installs by a plan, and returns what the folder is then."""

    def run(plan=None):
        plan = plan or planned()
        work = managed.installation.Installation(plan)
        finish(work)
        work.check()
        return managed.home.status(plan.folder)

    return run


def finish(work):
    """Poll until the end."""
    while not work.ended:
        work.poll()
        time.sleep(0.02)
