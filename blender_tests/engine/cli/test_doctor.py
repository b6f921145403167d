"""The doctor on made-up computers: what it finds, what it advises, and the verdict."""

import importlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import tomllib
import weakref
from collections import namedtuple
from dataclasses import replace

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

from blender_tests.engine.conftest import ROOT
from karf_engine.cli import doctor, main, smoke
from karf_engine.project.settings import PRESETS, seconds_of_stages
from karf_engine.worker.findings import ERROR, FAST, OK, POSES, REQUIRED, VERDICT, WARNING, Finding, Range

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PIP = f'"{sys.executable}" -m pip install'
PACKAGES = {package.name: package for package in REQUIRED}


def test_this_computer_passes_line_by_line_also_before_the_folder_is_made(tmp_path, capsys, monkeypatch):
    free = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: free)  # others write meanwhile
    folder = str(tmp_path / "films" / "pots_karf")
    assert main(["doctor", "--quick", "--folder", folder]) == 0
    text = capsys.readouterr().out
    assert main(["doctor", "--quick", "--json", "--folder", folder]) == 0
    found = [Finding.from_line(line) for line in capsys.readouterr().out.splitlines()]
    assert text.splitlines() == [line for finding in found for line in finding.to_text().splitlines()]
    assert set(json.loads(found[0].to_line())) == {"name", "status", "sentence", "remedy", "command", "code", "seconds"}
    assert [finding.name for finding in found].index(VERDICT) == len(found) - 1 and "torch" in found[-1].sentence
    assert {finding.status for finding in found} <= {OK, WARNING}
    by_name = {finding.name: finding for finding in found}
    assert PACKAGES.keys() <= by_name.keys()
    assert str(tmp_path) in by_name["disk"].sentence and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("line", ["", "{", "[]", "null", '{"name": "disk"}', '{"status": "fine"}', "a warning"])
def test_what_is_no_finding_is_refused(line):
    with pytest.raises(ValueError):
        Finding.from_line(line)


# ---------------------------------------------------------------------------------------------------- made-up computers
def lacking(**errors):
    """Python with packages that cannot be loaded."""

    def load(name):
        if name in errors:
            raise errors[name]
        return importlib.import_module(name)

    return {"import_module": load}


def missing(name):
    return ModuleNotFoundError(f"No module named {name!r}", name=name)


def with_version(version):
    return {"installed_version": lambda package: version}


def with_disk(free):
    return {"shutil.disk_usage": lambda folder: namedtuple("Usage", "total used free")(10**12, 0, free)}


def refuse(*_, **where):
    raise PermissionError(13, "Permission denied", str(where.get("dir", "/tmp")))


def torch_here(folder):
    return doctor.check_package(PACKAGES["torch"])


def fast_here(folder):
    return doctor.fast()


def memory_here(folder):
    return doctor.memory()


NUMBA = {"numba": ImportError("Numba needs NumPy 2.4 or less")}
BROKEN = {"torch": OSError("libcudart.so.12: cannot open shared object file")}
OTHER_PYTHON = {"PYTHON": Range("3.90", "3.91")}
READ_ONLY = {"tempfile.TemporaryDirectory": refuse, "tempfile.TemporaryFile": refuse}
COMPUTERS = [  # what is made up, the check, its status and exit code, and words of what it says and advises
    *((with_version(version), torch_here, WARNING, 0, [version, PIP]) for version in ("2.5.1", "3.0.0")),
    (with_version("2.6.0"), torch_here, OK, 0, ["2.6.0"]),
    (lacking(torch=missing("torch")), torch_here, ERROR, 3, ["torch is not installed.", f'{PIP} "torch>=']),
    (lacking(**BROKEN), torch_here, ERROR, 3, ["libcudart.so.12", "--force-reinstall"]),
    (lacking(torch=missing("numpy")), torch_here, ERROR, 3, ["torch needs numpy, which is not installed."]),
    (with_version(None), fast_here, OK, 0, ["is not installed", "as fast", f'{PIP} "numba>=']),
    (lacking(**NUMBA) | with_version("0.68.1"), fast_here, WARNING, 0, [str(NUMBA["numba"]), "--force-reinstall"]),
    (OTHER_PYTHON, lambda folder: doctor.python(), WARNING, 0, [sys.executable, "Use one of the tested versions"]),
    (with_disk(10**7), doctor.disk, ERROR, 4, ["FOLDER"]),
    (with_disk(10**9), doctor.disk, WARNING, 0, ["1.0 GB are free", "FOLDER"]),
    (with_disk(10**11), doctor.disk, OK, 0, ["FOLDER"]),
    ({"total_memory": lambda: 2 * 10**9}, memory_here, WARNING, 0, ["2.0 GB of memory"]),
    *(({"total_memory": lambda total=total: total}, memory_here, OK, 0, ["memory"]) for total in (16 * 10**9, None)),
    ({}, doctor.locks, OK, 0, ["Locks work in FOLDER."]),
    (READ_ONLY, doctor.locks, ERROR, 4, ["FOLDER", "Choose"]),
    (READ_ONLY, lambda folder: doctor.temporary(), ERROR, 4, ["/tmp", "Choose"]),
]


@pytest.mark.parametrize(("made_up", "check", "status", "code", "words"), COMPUTERS)
def test_a_computer_is_judged_with_a_remedy(monkeypatch, tmp_path, made_up, check, status, code, words):
    for name, value in made_up.items():
        monkeypatch.setattr(f"karf_engine.cli.doctor.{name}", value)
    found = check(tmp_path)
    assert (found.status, found.exit_code) == (status, code)
    assert all(each.replace("FOLDER", str(tmp_path)) in " ".join(found.lines) for each in words)
    assert found.remedy or status == OK
    assert list(tmp_path.iterdir()) == []


def test_locks_that_do_not_hold_are_a_warning(monkeypatch, tmp_path):
    import filelock

    from karf_engine.io import locks as io_locks

    class Loose(filelock.FileLock):
        def _acquire(self):
            self._context.lock_file_fd = os.open(os.devnull, os.O_RDONLY)

        def _release(self):
            os.close(self._context.lock_file_fd)
            self._context.lock_file_fd = None

    monkeypatch.setattr(io_locks, "FileLock", Loose)
    found = doctor.locks(tmp_path)
    assert found.status == WARNING and "two jobs could write at once" in found.sentence


def test_a_build_for_cards_that_are_not_there_is_a_warning(monkeypatch):
    import torch

    monkeypatch.setattr(torch.version, "cuda", "12.8")
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    build, device = doctor.devices(None)
    assert build.status == WARNING and "CUDA 12.8" in build.sentence and "driver" in build.remedy
    assert device == Finding("device", OK, "Stages compute on the processor.")


def test_cards_are_named_with_their_memory(monkeypatch):
    import torch

    facts = namedtuple("Facts", "name total_memory")("RTX 4090", 24 * 10**9)
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    monkeypatch.setattr(torch.cuda, "get_device_properties", lambda number: facts)
    found = {finding.name: finding.sentence for finding in doctor.devices("cpu")}
    assert found["cuda:0"] == "cuda:0 is RTX 4090 with 24.0 GB of memory."


def test_a_device_that_is_not_there_is_an_error_and_no_stage_is_tried(tmp_path):
    found = {finding.name: finding for finding in doctor.examine(tmp_path, device="cuda:7")}
    assert found["device"].status == ERROR and found["engine"].exit_code == 2 and "geometry" not in found


# ------------------------------------------------------------------------------------------------------------ smoke run
def test_every_stage_is_run_and_timed(monkeypatch, tmp_path):
    monkeypatch.setattr(smoke.tempfile, "tempdir", str(tmp_path))
    found = list(smoke.stages(device="cpu", threads=1))
    assert [(each.name, each.status) for each in found] == [
        (stage, OK) for stage in ("geometry", "segmentation", "palette", "recoloring", "splats", "render")
    ]
    assert all(each.seconds > 0 for each in found)
    assert list(tmp_path.glob("karf-*")) == []


@pytest.mark.skipif(os.name == "nt", reason="ended processes clear nothing up there")
def test_a_doctor_that_is_ended_leaves_nothing(tmp_path):
    environment = os.environ | {"TMPDIR": str(tmp_path), "OMP_NUM_THREADS": "1"}
    process = subprocess.Popen([sys.executable, ROOT / "karf_engine", "doctor"], env=environment, cwd=tmp_path)
    while not list(tmp_path.glob("karf-doctor-*/capture")):
        assert process.poll() is None
        time.sleep(0.02)
    process.terminate()
    assert process.wait(60) == 6 and list(tmp_path.glob("karf-*")) == []


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_doctor_ends_where_python_drops_what_the_signal_raised(monkeypatch, capsys):
    class Thing:
        pass

    def examine(*_):
        thing = Thing()
        reference = weakref.ref(thing, lambda _: signal.raise_signal(signal.SIGTERM))
        del thing
        yield Finding("python", OK, f"Still there after {reference}.")

    monkeypatch.setattr(doctor, "examine", examine)
    before = signal.getsignal(signal.SIGTERM)
    try:
        assert main(["doctor"]) == 6
    finally:
        signal.signal(signal.SIGTERM, before)
    assert "Still there" not in capsys.readouterr().out


def test_a_stage_that_fails_is_named_and_later_ones_are_not_tried(monkeypatch, capsys):
    from karf_engine import api

    def fail(*_, **__):
        raise ValueError("operands do not fit")

    monkeypatch.setattr(api, "learn_geometry", lambda *_, **__: None)
    monkeypatch.setattr(api, "segment", fail)
    geometry, segmentation = smoke.stages()
    assert geometry.status == OK and segmentation.status == ERROR
    assert "The stage segmentation does not run: ValueError('operands do not fit')." == segmentation.sentence
    assert "operands do not fit" in capsys.readouterr().err


def test_a_python_without_any_package_gets_all_findings_and_no_traceback(tmp_path):
    command = [sys.executable, "-S", "-I", ROOT / "karf_engine", "doctor", "--json", "--folder", tmp_path]
    done = subprocess.run(command, capture_output=True, text=True)
    found = {finding.name: finding for finding in map(Finding.from_line, done.stdout.splitlines())}
    assert done.returncode == 3 and done.stderr == ""
    assert all(found[name].status == ERROR for name in PACKAGES) and "device" not in found
    assert found["disk"].status != ERROR and found["locks"].status == OK
    command = found["engine"].command  # one for all of them
    assert command.count("pip install") == 1 and all(f'"{package.requirement}"' in command for package in REQUIRED)
    assert "torch" in found["engine"].sentence


# ------------------------------------------------------------------------------------------------------ tested versions
def declared(*texts):
    """Names and ranges of requirements, without their markers."""
    return {(wanted.name, wanted.specifier) for wanted in map(Requirement, texts)}


def test_the_packages_and_their_ranges_are_those_that_are_installed():
    extras = PROJECT["optional-dependencies"]
    assert declared(*(each.requirement for each in REQUIRED)) == declared(*PROJECT["dependencies"])
    assert declared(POSES.requirement) == declared(*extras["photos"])
    assert declared(FAST.requirement) == declared(*extras["fast"])


@pytest.mark.parametrize(
    ("system", "processor", "is_asked_for"),
    [("linux", "x86_64", True), ("win32", "AMD64", True), ("darwin", "arm64", True), ("darwin", "x86_64", False)],
)
def test_what_learns_fast_is_asked_for_where_it_has_files(system, processor, is_asked_for):
    (wanted,) = map(Requirement, PROJECT["optional-dependencies"]["fast"])
    assert wanted.marker.evaluate({"sys_platform": system, "platform_machine": processor}) == is_asked_for


def test_the_lowest_python_is_the_one_that_is_required_and_all_named_ones_are_tested():
    assert SpecifierSet(PROJECT["requires-python"]) == SpecifierSet(f">={doctor.PYTHON.lowest}")
    named = [line.rpartition(" ")[2] for line in PROJECT["classifiers"] if "Python :: 3." in line]
    assert named and all(doctor.PYTHON.contains(version) for version in named)


@pytest.mark.parametrize(
    ("versions", "is_inside"),
    [
        (["2.6", "2.6.0", "2.13.0+cu128", "2.99.99", "2.7.0a0+git12"], True),
        (["2.5.9", "3", "3.0.0", "10.1", "?", ""], False),
    ],
    ids=["inside", "outside"],
)
def test_a_range_holds_versions_from_its_lowest_to_below_its_end(versions, is_inside):
    assert [Range("2.6", "3").contains(version) for version in versions] == [is_inside] * len(versions)


# ---------------------------------------------------------------------------------------------------------------- speed
def test_the_speed_is_that_of_the_iterations_behind_the_first(monkeypatch):
    from karf_engine import api

    times = iter((0.0, 5.0, 5.5, 6.5))
    monkeypatch.setattr(smoke.time, "perf_counter", lambda: next(times))

    def learn(*_, emit, **__):
        emit("stage", name="geometry")
        for step in (4, 12, 20, 40):
            emit("progress", stage="geometry", step=step)

    monkeypatch.setattr(api, "learn_geometry", learn)
    assert smoke.samples_per_second() == pytest.approx(smoke.REAL_SPEED * smoke.SAMPLES * 28 / 1.5)


def seconds_of(rate=1e6, preset="demo", is_open=False, **splats):
    settings = PRESETS[preset]
    settings = replace(settings, splats=replace(settings.splats, **splats))
    return seconds_of_stages(settings, rate, is_open=is_open)


def test_stages_take_as_long_as_their_samples():
    slow, fast, none = seconds_of(1e5), seconds_of(2e5), seconds_of(iterations=0)
    assert all(slow[stage] == 2 * fast[stage] for stage in ("geometry", "segmentation", "recoloring", "splats"))
    assert seconds_of(1e5, is_open=True)["geometry"] > slow["geometry"]
    small, large, huge = (seconds_of(long_side=side)["splats"] for side in (200, 400, 4000))
    assert none["splats"] == 0 < small < large == huge  # photos count no more than their windows
    assert seconds_of(preset="paper") is None  # a NeRF was not measured
