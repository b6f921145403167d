"""Installing, stopping, going on, repairing and updating, with tiny wheels and without network."""

import json
import os
import shutil
import subprocess
import sys

import pytest

from . import wheels as making
from .conftest import PYTHON, finish


def site(place):
    """Where the packages of the environment that counts lie."""
    name = json.loads((place / "installed.json").read_text())["environment"]
    (folder,) = [*place.glob(f"{name}/lib/python*/site-packages"), *place.glob(f"{name}/Lib/site-packages")]
    return folder


def finished_in(place):
    """The files that uv's cache holds whole."""
    return [path for path in place.glob("cache/wheels-*/**/*.http") if path.is_file()]


def test_an_installed_engine_is_found_and_shares_its_files_with_the_cache(
    addon, chosen, managed, install, place, monkeypatch
):
    assert managed.home.python_in(place) is None
    status = install()
    assert (status.state, status.build, status.python, status.torch) == ("ready", "cuda", PYTHON, "2.0")
    python = managed.home.python_in(place)
    monkeypatch.delenv("KARF_ENGINE_PYTHON")
    chosen.engine_folder = str(place)
    assert addon.preferences.engine_python() == python
    assert subprocess.run([python, "-c", "import torch, cv2, OpenEXR"]).returncode == 0
    # the cache takes no room of its own
    for file in place.glob("cache/archive-v*/*/*/*.py"):
        assert file.stat().st_nlink == 2


def test_pycolmap_is_installed_where_it_is_ticked_and_numba_always(install, planned, place):
    def packages():
        return {name for name in ("pycolmap", "numba") if (site(place) / name).is_dir()}

    install()
    assert packages() == {"numba"}
    assert install(planned(extras=("photos",))).extras == ("photos",)
    assert packages() == {"pycolmap", "numba"}
    install()
    assert packages() == {"numba"}


def test_python_alone_makes_it_where_there_is_no_uv(kitchen, managed, install, planned, uv, place):
    """uv then comes as a file of the recipe, by the pip of the new environment."""
    if os.name == "nt":
        pytest.skip("the made wheel has a shell script")
    script = {"uv-0.1.data/scripts/uv": f'#!/bin/sh\nexec "{uv}" "$@"\n'}
    (name,) = [path.name for path in kitchen.folder.glob("uv-*")]
    kitchen.add("uv", "uv", "0.1", script, name.removesuffix(".whl").partition("0.1-")[2])
    kitchen.write()
    plan = planned(starter=sys.executable)
    assert plan.starter.uv == "" and len(plan.steps()) == 4
    assert install(plan).state == "ready"
    uv = managed.home.program_of(place / "uv", "uv")
    assert len(planned(starter=sys.executable).steps()) == 2  # the next one finds it
    uv.write_text("half")
    assert install(planned(starter=sys.executable)).state == "ready" and "exec" in uv.read_text()


def test_the_commands_by_hand_make_the_same(kitchen, managed, planned, place):
    plan = planned()
    for step in plan.steps():
        done = subprocess.run(step.command, capture_output=True, text=True, cwd=kitchen.folder)
        assert done.returncode == 0, done.stderr
    assert subprocess.run([managed.home.python_of(plan.environment), "-c", "import torch, scipy, cv2"]).returncode == 0
    assert managed.home.python_in(place) is None  # what is made by hand is set by hand


def test_a_wrong_file_is_refused_by_its_name(kitchen, managed, install, place):
    path = making.make(kitchen.folder, "scipy", "1.0", {"scipy/__init__.py": "name = 'shady'\n"})
    assert f"{path.name} {path.stat().st_size}" in kitchen.lists["packages"]["scipy"]
    with pytest.raises(managed.api.DataError, match=r"scipy==1\.0 is not the file") as caught:
        install()
    assert "not installed" in caught.value.hint
    assert managed.home.status(place).state == "unfinished" and managed.home.python_in(place) is None


def test_a_build_that_is_in_no_recipe_is_taken_by_its_version(kitchen, managed, install, planned, place):
    for path in kitchen.folder.glob("torch-*.whl"):
        path.unlink()
    system = {"linux": "linux_x86_64", "windows": "win_amd64", "macos": "macosx_14_0_arm64"}
    tag = system[kitchen.here.platform.partition("-")[0]]
    python = f"cp{PYTHON.replace('.', '')}"
    making.make_torch(kitchen.folder, "2.0+cpu", tag=f"{python}-{python}-{tag}")
    plan = planned(build="auto")
    assert plan.unchecked == "torch 2.0 for cpu" and any("no hash of torch" in line for line in plan.sentences)
    assert install(plan).torch == "2.0+cpu"


@pytest.mark.parametrize("is_killed", [False, True], ids=["cancelled", "killed"])
def test_it_keeps_finished_files_and_goes_on_from_there(managed, install, planned, index, place, is_killed):
    index.holding = "torch-"
    work = managed.installation.Installation(planned(index))
    while not (index.begun.is_set() and len(index.fetched) == len(finished_in(place)) == len(making.MODULES)):
        work.poll()
        assert not work.ended
    if is_killed:  # and nobody polls any more: Blender is gone too
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
    # the server has noted the half that nobody took, too
    assert {name.partition("-")[0] for name in index.fetched} == {"torch"}


def test_repair_puts_back_what_is_missing_or_changed_and_fetches_nothing_else(managed, install, planned, index, place):
    install(planned(index))
    (site(place) / "scipy" / "__init__.py").write_text("name = 'other'\n")  # the cache's file is the same
    (site(place) / "cv2" / "__init__.py").unlink()
    for half in place.glob("cache/archive-v*/*/imageio-*.dist-info/RECORD"):
        half.unlink()
    index.fetched.clear()
    plan = planned(index)
    assert any("whole is not fetched again" in line for line in plan.sentences)
    assert install(plan).state == "ready"
    assert sorted({name.partition("-")[0] for name in index.fetched}) == ["imageio", "scipy"]
    assert (site(place) / "scipy" / "__init__.py").read_text() == "name = 'scipy'\n"
    assert (site(place) / "cv2" / "__init__.py").is_file()


def test_an_environment_whose_python_is_gone_is_broken_and_made_anew(managed, install, place):
    install()
    managed.home.python_in(place).unlink()
    assert managed.home.status(place).state == "broken" and managed.home.python_in(place) is None
    assert install().state == "ready"


def test_another_recipe_makes_it_outdated_and_an_update_gets_only_what_is_new(
    kitchen, managed, install, planned, index, place
):
    install(planned(index))
    kitchen.add("packages", "scipy", "1.1", {"scipy/__init__.py": "name = 'newer'\n"})
    kitchen.write()
    status = managed.home.status(place)
    assert status.state == "outdated" and status.is_usable and "Update" in status.sentence
    index.fetched.clear()
    assert install(planned(index)).state == "ready"
    assert index.fetched == ["scipy-1.1-py3-none-any.whl"]
    assert (site(place) / "scipy" / "__init__.py").read_text() == "name = 'newer'\n"


@pytest.mark.parametrize("is_update", [False, True])
def test_without_network_a_sentence_says_so_and_an_engine_that_works_stays(
    kitchen, managed, install, planned, index, place, monkeypatch, is_update
):
    if is_update:
        install(planned(index))
        kitchen.add("packages", "scipy", "1.1", {"scipy/__init__.py": ""})
        kitchen.write()
    monkeypatch.setenv("UV_HTTP_RETRIES", "0")
    plan = planned(index)
    index.close()
    with pytest.raises(managed.api.DataError, match=r"^No connection to the index http://127") as caught:
        install(plan)
    assert "folder of wheels" in caught.value.hint and "goes on from there" in caught.value.hint
    assert managed.home.status(place).state == ("outdated" if is_update else "unfinished")


def test_an_environment_of_an_earlier_version_is_recognized_and_updated(managed, install, place):
    """It had numba as an extra, and in installed.json neither its name nor what was chosen."""
    install()
    files = [place / name for name in ("karf-engine.json", "installed.json")]
    mark, installed = (json.loads(file.read_text()) for file in files)
    shutil.rmtree(place / "cache")
    files[0].write_text(json.dumps(mark | {"backend": "", "extras": ["photos", "fast"]}))
    files[1].write_text(
        json.dumps({name: installed[name] for name in ("schema", "torch", "build", "device", "digest")})
    )
    status = managed.home.status(place)
    assert (status.state, status.extras, status.environment) == ("outdated", ("photos",), "env")
    assert managed.home.python_in(place).is_file() and install().state == "ready"


def test_what_does_not_load_or_is_another_build_does_not_count(kitchen, managed, install, place):
    kitchen.note("packages", making.make_torch(kitchen.folder, "2.0"), "torch", "2.0")
    kitchen.write()
    with pytest.raises(managed.api.BadRequest, match="is a cpu build, not the cuda build"):
        install()
    kitchen.add("packages", "scipy", "1.0", {"scipy/__init__.py": "raise ImportError('no BLAS on this computer')\n"})
    kitchen.write()
    with pytest.raises(managed.api.MissingDependency, match="no BLAS on this computer"):
        install()
    assert managed.home.python_in(place) is None
