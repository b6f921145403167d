"""The doctor on made-up computers: what it finds, what it advises, and the verdict."""

import importlib
import os
import shutil
import signal
import subprocess
import sys
import time
import weakref
from collections import namedtuple

import pytest

pytest.importorskip("torch")

from blender_tests.engine.conftest import ROOT
from karf_engine.cli import doctor, main, smoke
from karf_engine.worker.findings import ERROR, OK, REQUIRED, WARNING, Finding, Range

Usage = namedtuple("Usage", "total used free")


def package(name):
    return next(each for each in REQUIRED if each.name == name)


def examined(folder, **options):
    """The findings by their names, without the stages."""
    return {finding.name: finding for finding in doctor.examine(folder, quick=True, **options)}


@pytest.fixture
def lacking(monkeypatch):
    """Takes packages away from this Python: `lacking(errors)`, by their names."""
    errors, load = {}, importlib.import_module

    def load_or_fail(name):
        if name in errors:
            raise errors[name]
        return load(name)

    monkeypatch.setattr(doctor, "import_module", load_or_fail)
    return errors.update


def missing(*names):
    return {name: ModuleNotFoundError(f"No module named {name!r}", name=name) for name in names}


def test_this_computer_passes_also_before_the_folder_is_made(tmp_path):
    found = examined(tmp_path / "films" / "pots_karf")
    assert {finding.status for finding in found.values()} <= {OK, WARNING}
    assert found["engine"].exit_code == 0 and "torch" in found["engine"].sentence
    assert {each.name for each in REQUIRED} <= set(found)
    assert str(tmp_path) in found["disk"].sentence and not (tmp_path / "films").exists()


def test_without_packages_it_says_so_and_one_command_installs_all(lacking, tmp_path):
    lacking(missing("torch", "cv2"))
    found = examined(tmp_path)
    assert found["torch"].sentence == "torch is not installed." and "device" not in found
    assert f'"{sys.executable}" -m pip install "torch>=' in found["torch"].command
    assert found["engine"].exit_code == 3 and "torch" in found["engine"].sentence
    command = found["engine"].command
    assert command.count("pip install") == 1 and '"torch>=' in command and '"opencv-python-headless>=' in command


def test_a_package_that_cannot_be_loaded_is_told_from_one_that_is_missing(lacking):
    lacking({"torch": OSError("libcudart.so.12: cannot open shared object file"), "scipy": missing("numpy")["numpy"]})
    broken, incomplete = doctor.check_package(package("torch")), doctor.check_package(package("scipy"))
    assert broken.status == ERROR and "libcudart.so.12" in broken.sentence and "--force-reinstall" in broken.command
    assert incomplete.sentence == "scipy needs numpy, which is not installed."


def test_without_what_learns_fast_the_engine_works_and_the_doctor_says_what_it_would_bring(monkeypatch):
    monkeypatch.setattr(doctor, "installed_version", lambda package: None)
    found = doctor.fast()
    assert found.status == OK and "is not installed" in found.sentence and "as fast" in found.sentence
    assert f'"{sys.executable}" -m pip install "numba>=' in found.command


def test_what_learns_fast_is_no_reason_to_fail_where_it_cannot_be_loaded(monkeypatch, lacking):
    lacking({"numba": ImportError("Numba needs NumPy 2.4 or less")})
    monkeypatch.setattr(doctor, "installed_version", lambda package: "0.68.1")
    found = doctor.fast()
    assert found.status == WARNING and found.exit_code == 0
    assert "Numba needs NumPy 2.4 or less" in found.sentence and "--force-reinstall" in found.command


@pytest.mark.parametrize(("version", "status"), [("2.5.1", WARNING), ("2.6.0", OK), ("3.0.0", WARNING)])
def test_versions_outside_the_tested_ones_are_a_warning(monkeypatch, version, status):
    monkeypatch.setattr(doctor, "installed_version", lambda package: version)
    found = doctor.check_package(package("torch"))
    assert found.status == status and version in found.sentence
    assert bool(found.remedy) == (status == WARNING)


def test_a_python_that_was_not_tested_is_a_warning(monkeypatch):
    monkeypatch.setattr(doctor, "PYTHON", Range("3.90", "3.91"))
    found = doctor.python()
    assert found.status == WARNING and sys.executable in found.sentence and found.remedy


@pytest.mark.parametrize(("free", "status"), [(10**7, ERROR), (10**9, WARNING), (10**11, OK)])
def test_the_free_disk_is_judged(monkeypatch, tmp_path, free, status):
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: Usage(10**12, 0, free))
    found = doctor.disk(tmp_path)
    assert found.status == status and str(tmp_path) in found.sentence
    assert found.exit_code == (4 if status == ERROR else 0)


@pytest.mark.parametrize(("total", "status"), [(2 * 10**9, WARNING), (16 * 10**9, OK), (None, OK)])
def test_the_memory_is_judged(monkeypatch, total, status):
    monkeypatch.setattr(doctor, "total_memory", lambda: total)
    assert doctor.memory().status == status


def test_locks_are_tried_and_nothing_is_left(tmp_path):
    assert doctor.locks(tmp_path) == Finding("locks", OK, f"Locks work in {tmp_path}.")
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


@pytest.mark.parametrize("check", [lambda folder: doctor.locks(folder), lambda folder: doctor.temporary()])
def test_folders_that_take_no_files_are_errors(monkeypatch, tmp_path, check):
    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied", str(tmp_path))

    monkeypatch.setattr(doctor.tempfile, "TemporaryDirectory", refuse)
    monkeypatch.setattr(doctor.tempfile, "TemporaryFile", refuse)
    found = check(tmp_path)
    assert found.status == ERROR and found.exit_code == 4 and str(tmp_path) in found.sentence and found.remedy


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


# -------------------------------------------------------------------------------------------------------- bare Python
def test_a_python_without_any_package_gets_all_findings_and_no_traceback(tmp_path):
    command = [sys.executable, "-S", "-I", ROOT / "karf_engine", "doctor", "--json", "--folder", tmp_path]
    done = subprocess.run(command, capture_output=True, text=True)
    found = {finding.name: finding for finding in map(Finding.from_line, done.stdout.splitlines())}
    assert done.returncode == 3 and done.stderr == ""
    assert all(found[each.name].status == ERROR for each in REQUIRED)
    assert found["disk"].status != ERROR and found["locks"].status == OK
