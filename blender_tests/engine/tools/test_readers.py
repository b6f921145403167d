"""Every reader and files that are nearly right: valid, refused in a sentence, and never anything else.

What is never to happen stands in tools/reliability/fuzz/watch.py. Longer: python3 tools/dev.py fuzz.
"""

import json
import os
import subprocess
import sys

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from blender_tests.engine.conftest import ROOT
from tools import dev

torch = pytest.importorskip("torch")
pytest.importorskip("resource", reason="processes are forked and limited, which Windows cannot")

from tools.reliability.fuzz import samples
from tools.reliability.fuzz.readers import Bed, readers
from tools.reliability.fuzz.watch import read_watched

MUTANTS = 30
NAMES = [reader.name for reader in readers(None)]


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A project with every stage done, planes and an edit."""
    threads = torch.get_num_threads()
    learned = samples.learned_project(tmp_path_factory.mktemp("fuzz"))
    torch.set_num_threads(threads)
    return learned


@pytest.fixture(autouse=True)
def small_numbers(project):
    """Those next to zero, which the engine flushes, are numbers to hypothesis."""
    torch.set_flush_denormal(False)


@pytest.fixture
def bed(request, project, tmp_path):
    """The valid files of the reader of this name, ready to be changed."""
    return Bed(next(reader for reader in readers(project) if reader.name == request.param), tmp_path)


@pytest.mark.parametrize("bed", NAMES, indirect=True, ids=NAMES)
def test_valid_files_are_read(bed):
    assert [outcome for outcome in bed.read_valid() if outcome.refused or outcome.finding] == []


@pytest.mark.parametrize("bed", NAMES, indirect=True, ids=NAMES)
def test_changed_files_are_read_or_refused(bed):
    examples = 3 if bed.reader.is_slow else 10

    @settings(max_examples=examples, deadline=None, derandomize=True, database=None, suppress_health_check=HealthCheck)
    @given(st.randoms(use_true_random=False))
    def changed(chance):
        outcome = bed.try_one(chance)
        torch.set_flush_denormal(False)
        assert outcome.finding is None

    changed()


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    """What a short run of the command finds, by reader."""
    out = tmp_path_factory.mktemp("fuzz_out")
    command = [sys.executable, "-m", "tools.reliability.fuzz", "--mutants", str(MUTANTS), "--out", str(out)]
    done = subprocess.run(
        command, cwd=ROOT, env=os.environ | dev.ONE_THREAD, capture_output=True, text=True, timeout=900
    )
    assert (out / "fuzz.json").exists(), done.stderr
    return {row["reader"]: row for row in json.loads((out / "fuzz.json").read_text())["rows"]}


@pytest.mark.parametrize("name", NAMES)
def test_many_changed_files(rows, name):
    assert rows[name]["executions"] > 0
    assert rows[name]["findings"] == {}


# ------------------------------------------------------------------------------------------------ the watch sees what it must
def test_the_watch_sees_memory(tmp_path):
    outcome = read_watched(lambda path: bytearray(2 << 30), tmp_path / "file", tmp_path)
    assert "more than 1 GB" in outcome.finding


def test_the_watch_sees_and_prevents_writing_outside(tmp_path):
    outside = tmp_path / "outside.txt"
    outcome = read_watched(lambda path: outside.write_text("x"), tmp_path / "file", tmp_path / "inside")
    assert "writes outside" in outcome.finding
    assert not outside.exists()


def test_the_watch_sees_unpickling(tmp_path):
    import pickle

    data = pickle.dumps(os.getpid)
    outcome = read_watched(lambda path: pickle.loads(data), tmp_path / "file", tmp_path)
    assert "pickle.find_class" in outcome.finding


def test_the_watch_sees_a_trace(tmp_path):
    outcome = read_watched(lambda path: {}["absent"], tmp_path / "file", tmp_path)
    assert outcome.finding.startswith("KeyError")
