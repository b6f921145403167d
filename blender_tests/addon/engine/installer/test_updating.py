"""An update is made beside the engine that works, which works on whenever and however it ends."""

import subprocess
import time

import pytest

from .conftest import finish

STEPS = (
    "Checking what is there",
    "Making the environment",
    "Installing packages",
    "Testing",
)


@pytest.fixture
def outdated(kitchen, install, planned):
    """An engine with one package too many, whose update has a newer one."""
    install(planned(extras=("photos",)))
    kitchen.add("packages", "scipy", "1.1", {"scipy/__init__.py": "name = 'newer'\n"})
    kitchen.write()


def said_by(python, code="import scipy; print(scipy.name)"):
    return subprocess.run([python, "-I", "-c", code], capture_output=True, text=True, check=True).stdout.strip()


def names(place):
    return {path.name for path in place.glob("env*")}


def begin(managed, plan, title):
    """The installation at the step of this title."""
    work = managed.installation.Installation(plan)
    while work.progress.title != title:
        work.poll()
        assert not work.ended
        time.sleep(0.002)
    return work


@pytest.mark.parametrize("title", STEPS)
@pytest.mark.parametrize("outlives", [True, False], ids=["its child lives on", "its child dies too"])
def test_blender_may_be_killed_at_any_step(managed, outdated, install, planned, place, title, outlives):
    python = managed.home.python_in(place)
    work = begin(managed, planned(), title)
    if not outlives:
        managed.processes.send(work._process, managed.processes.KILL)
    work._process.wait()  # nobody polls any more
    assert managed.home.status(place).is_usable and managed.home.python_in(place) == python
    assert said_by(python) == "scipy" and said_by(python, "import pycolmap, torch; print(3)") == "3"
    assert install().state == "ready"
    assert said_by(managed.home.python_in(place)) == "newer"
    assert names(place) == {managed.home.status(place).environment}


def test_the_environments_of_before_go_and_those_in_which_a_job_runs_stay_until_the_next_update(
    managed, outdated, install, planned, place
):
    first = managed.home.python_in(place)
    program = "import sys; print(3, flush=True); sys.stdin.readline(); import scipy; print(scipy.name)"
    running = subprocess.Popen([first, "-I", "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert running.stdout.readline() == "3\n"
    work = begin(managed, planned(), "Making the environment")
    managed.processes.end(work._process)
    install()
    assert names(place) == {"env", managed.home.status(place).environment}
    assert running.communicate("\n")[0] == "scipy\n"
    install()
    assert names(place) == {managed.home.status(place).environment}


def test_cancelled_or_failed_it_leaves_the_engine_that_works(kitchen, managed, outdated, install, planned, place):
    python = managed.home.python_in(place)
    work = begin(managed, planned(), "Making the environment")
    work.end()
    finish(work)
    with pytest.raises(managed.api.Cancelled):
        work.check()
    kitchen.add("packages", "scipy", "1.2", {"scipy/__init__.py": "raise ImportError('no BLAS on this computer')\n"})
    kitchen.write()
    with pytest.raises(managed.api.MissingDependency, match="no BLAS"):
        install()
    assert managed.home.python_in(place) == python and said_by(python) == "scipy"
    assert managed.home.status(place).extras == ("photos",)


def test_where_the_disk_has_no_hard_links_no_second_copy_is_kept(managed, install, place):
    install()
    (copy,) = place.glob("cache/archive-v*/*/torch-*.dist-info/METADATA")
    text = copy.read_text()
    copy.unlink()
    copy.write_text(text)
    managed.chores.clear(place, "env")
    assert not copy.parent.exists() and managed.home.status(place).state == "ready"
