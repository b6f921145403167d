"""Installing, resuming, repairing and updating the engine, with tiny wheels and no network."""

import json
import os
import subprocess
import sys
import time

import pytest

from . import wheels
from .conftest import PYTHON, finish


def site(place):
    """The packages of the current environment."""
    name = json.loads((place / "installed.json").read_text())["environment"]
    (folder,) = [*place.glob(f"{name}/lib/python*/site-packages"), *place.glob(f"{name}/Lib/site-packages")]
    return folder


def output_of(python, code="import scipy; print(scipy.name)"):
    return subprocess.run([python, "-I", "-c", code], capture_output=True, text=True, check=True).stdout.strip()


def environments(place):
    return {path.name for path in place.glob("env*")}


def begin(managed, plan, title):
    """Start an installation and stop at the step of this title."""
    work = managed.installation.Installation(plan)
    while work.progress.title != title:
        work.poll()
        assert not work.ended
        time.sleep(0.002)
    return work


def test_installed_engine_is_found_and_shares_cached_files(addon, preferences, managed, install, place, monkeypatch):
    assert managed.home.python_in(place) is None
    status = install()
    assert (status.state, status.build, status.python, status.torch) == ("ready", "cuda", PYTHON, "2.0")
    python = managed.home.python_in(place)
    monkeypatch.delenv("KARF_ENGINE_PYTHON")
    preferences.engine_folder = str(place)
    assert addon.preferences.engine_python() == python
    assert subprocess.run([python, "-c", "import torch, cv2, OpenEXR"]).returncode == 0
    links = {file.stat().st_nlink for file in place.glob("cache/archive-v*/*/*/*.py")}
    assert links == {2}  # the cache takes no extra space


def test_cache_keeps_no_copies_on_disks_without_hard_links(managed, install, place):
    install()
    (copy,) = place.glob("cache/archive-v*/*/torch-*.dist-info/METADATA")
    text = copy.read_text()
    copy.unlink()
    copy.write_text(text)
    managed.chores.clear(place, "env")
    assert not copy.parent.exists() and managed.home.status(place).state == "ready"


@pytest.mark.skipif(os.name == "nt", reason="the wheel has a shell script")
def test_missing_uv_is_installed_by_pip(stock, managed, install, planned, uv, place):
    script = {"uv-0.1.data/scripts/uv": f'#!/bin/sh\nexec "{uv}" "$@"\n'}
    stock.add("uv", "0.1", tag=stock.uv_tag, more=script)
    plan = planned(starter=sys.executable)
    assert plan.starter.uv == "" and len(plan.steps()) == 4
    assert install(plan).state == "ready"
    assert len(planned(starter=sys.executable).steps()) == 2  # it is reused
    managed.home.program_of(place / "uv", "uv").write_text("half")
    assert len(planned(starter=sys.executable).steps()) == 4


def test_build_without_hash_is_installed_by_version(stock, install, planned):
    for path in stock.folder.glob("torch-*.whl"):
        path.unlink()
    system = {"linux": "linux_x86_64", "windows": "win_amd64", "macos": "macosx_14_0_arm64"}
    tag = system[stock.here.platform.partition("-")[0]]
    python = f"cp{PYTHON.replace('.', '')}"
    wheels.make(stock.folder, "torch", "2.0+cpu", wheels.torch("2.0+cpu"), f"{python}-{python}-{tag}")
    plan = planned(build="auto")
    assert plan.unchecked == "torch 2.0 for cpu" and any("no hash of torch" in line for line in plan.sentences)
    assert install(plan).torch == "2.0+cpu"


@pytest.mark.parametrize("is_killed", [False, True], ids=["cancelled", "killed"])
def test_interrupted_installation_resumes_from_fetched_files(managed, install, planned, index, place, is_killed):
    def n_cached():
        return len([path for path in place.glob("cache/wheels-*/**/*.http") if path.is_file()])

    index.holding = "torch-"
    work = managed.installation.Installation(planned(index))
    while not (index.begun.is_set() and len(index.fetched) == n_cached() == len(wheels.MODULES)):
        work.poll()
        assert not work.ended
    if is_killed:  # and polled no more, as after a crash of Blender
        managed.processes.send(work._process, managed.processes.KILL)
        work._process.wait()
    else:
        work.end()
        finish(work)
        with pytest.raises(managed.api.Cancelled, match=r"cancelled.*kept"):
            work.check()
    assert managed.home.status(place).state == "unfinished" and managed.home.python_in(place) is None
    index.release.set()
    index.fetched.clear()
    assert install(planned(index)).state == "ready"
    assert index.packages == {"torch"}  # the server counts the half that was never taken, too


@pytest.mark.parametrize("state, fetched", [("ready", {"imageio", "scipy"}), ("outdated", {"scipy"})])
def test_update_and_repair_fetch_only_missing_wheels(stock, managed, install, planned, index, place, state, fetched):
    install(planned(index))
    if state == "ready":
        (site(place) / "scipy" / "__init__.py").write_text("name = 'other'\n")  # the cache's file is the same
        (site(place) / "cv2" / "__init__.py").unlink()
        for half in place.glob("cache/archive-v*/*/imageio-*.dist-info/RECORD"):
            half.unlink()
    else:
        stock.add("scipy", "1.1", "name = 'newer'\n")
    assert managed.home.status(place).state == state
    index.fetched.clear()
    plan = planned(index)
    assert any("whole is not fetched again" in line for line in plan.sentences)
    assert install(plan).state == "ready"
    assert index.packages == fetched
    assert output_of(managed.home.python_in(place)) == ("newer" if state == "outdated" else "scipy")
    assert (site(place) / "cv2" / "__init__.py").is_file()


@pytest.fixture
def outdated(stock, install, planned, monkeypatch):
    """An engine with an extra package and an update of another one."""
    assert install(planned(extras=("photos",))).extras == ("photos",)
    monkeypatch.setenv("UV_HTTP_RETRIES", "0")
    stock.add("scipy", "1.1", "name = 'newer'\n")


@pytest.mark.parametrize(
    ("failure", "error", "sentence"),
    [
        ("cancelled", "Cancelled", r"cancelled.*kept"),
        ("no network", "DataError", r"^No connection to the index http://127.*folder of wheels.*goes on from there"),
        ("another file", "DataError", r"scipy==1\.1 is not the file.*not installed"),
        ("does not load", "MissingDependency", "no BLAS on this computer"),
        ("another build", "BadRequest", "is a cpu build, not the cuda build"),
    ],
)
def test_failed_update_keeps_the_engine(stock, managed, outdated, planned, index, place, failure, error, sentence):
    python = managed.home.python_in(place)
    if failure == "another file":
        wheels.make(stock.folder, "scipy", "1.1", "name = 'shady'\n")
    elif failure == "does not load":
        stock.add("scipy", "1.2", "raise ImportError('no BLAS on this computer')\n")
    elif failure == "another build":
        stock.add("torch", "2.0", wheels.torch("2.0"))
    plan = planned(index if failure == "no network" else None)
    index.close()
    work = begin(managed, plan, "Making the environment")
    if failure == "cancelled":
        work.end()
    finish(work)
    with pytest.raises(getattr(managed.api, error), match=sentence):
        work.check()
    status = managed.home.status(place)
    assert (status.state, status.is_usable, status.extras) == ("outdated", True, ("photos",))
    assert "Update" in status.sentence
    assert managed.home.python_in(place) == python and output_of(python) == "scipy"


@pytest.mark.parametrize(
    ("title", "outlives"),
    [
        ("Checking what is there", True),
        ("Making the environment", False),
        ("Installing packages", True),
        ("Installing packages", False),
        ("Testing", True),
    ],
)
def test_blender_may_be_killed_at_any_step(managed, outdated, install, planned, place, title, outlives):
    python = managed.home.python_in(place)
    work = begin(managed, planned(), title)
    if not outlives:  # the process is killed with Blender
        managed.processes.send(work._process, managed.processes.KILL)
    work._process.wait()  # without polling
    assert managed.home.status(place).is_usable and managed.home.python_in(place) == python
    assert output_of(python) == "scipy" and output_of(python, "import pycolmap, torch; print(3)") == "3"
    assert install().state == "ready"
    assert output_of(managed.home.python_in(place)) == "newer"
    assert environments(place) == {managed.home.status(place).environment}
    assert {name for name in ("pycolmap", "numba") if (site(place) / name).is_dir()} == {"numba"}


def test_unused_old_environments_are_removed(managed, outdated, install, planned, place):
    first = managed.home.python_in(place)
    program = "import sys; print(3, flush=True); sys.stdin.readline(); import scipy; print(scipy.name)"
    running = subprocess.Popen([first, "-I", "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert running.stdout.readline() == "3\n"
    work = begin(managed, planned(), "Making the environment")
    managed.processes.end(work._process)
    install()
    assert environments(place) == {"env", managed.home.status(place).environment}
    assert running.communicate("\n")[0] == "scipy\n"
    install()
    assert environments(place) == {managed.home.status(place).environment}
