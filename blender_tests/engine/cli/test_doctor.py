"""Findings, advice and verdict of the doctor on this and on simulated computers."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
import tomllib
import weakref
from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

from blender_tests.engine.conftest import ROOT
from karf_engine.cli import doctor, main, smoke
from karf_engine.project import STAGE_ORDER
from karf_engine.project.settings import PRESETS, seconds_of_stages
from karf_engine.worker.findings import ERROR, FAST, GSPLAT, OK, POSES, REQUIRED, VERDICT, WARNING, Finding, Range

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PIP = f'"{sys.executable}" -m pip install'
PACKAGES = {package.name: package for package in REQUIRED}


def test_this_computer_passes_in_text_and_json(tmp_path, capsys, monkeypatch):
    free = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: free)  # others write meanwhile
    folder = str(tmp_path / "films" / "pots_karf")
    assert main(["doctor", "--quick", "--folder", folder]) == 0
    text = capsys.readouterr().out
    assert main(["doctor", "--quick", "--json", "--folder", folder]) == 0
    found = [Finding.from_line(line) for line in capsys.readouterr().out.splitlines()]
    assert text.splitlines() == [line for finding in found for line in finding.to_text().splitlines()]
    assert set(json.loads(found[0].to_line())) == {"name", "status", "sentence", "remedy", "command", "code", "seconds"}
    assert {finding.status for finding in found} <= {OK, WARNING}
    by_name = {finding.name: finding for finding in found}
    assert [finding.name for finding in found].index(VERDICT) == len(found) - 1 and "torch" in found[-1].sentence
    assert PACKAGES.keys() <= by_name.keys()
    assert str(tmp_path) in by_name["disk"].sentence and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("line", ["", "{", "[]", "null", '{"name": "disk"}', '{"status": "fine"}', "a warning"])
def test_malformed_findings_are_rejected(line):
    with pytest.raises(ValueError):
        Finding.from_line(line)


def with_import_error(error):
    return {"import_module": Mock(side_effect=error)}


def with_version(version):
    return {"installed_version": lambda package: version}


def with_disk(free):
    return {"shutil.disk_usage": lambda folder: SimpleNamespace(total=10**12, used=0, free=free)}


def deny(*_, **where):
    raise PermissionError(13, "Permission denied", str(where.get("dir", "/tmp")))


RASTERIZERS = [("cpu", "numba"), ("cuda", "numba"), ("cuda", "gsplat"), ("cpu", None), ("cuda", None)]
CHECKS = {  # each is given a folder
    "torch": lambda _: doctor.check_package(PACKAGES["torch"]),
    "fast": lambda _: doctor.fast(),
    "python": lambda _: doctor.python(),
    **{f"{kind}, {by}": lambda _, kind=kind, by=by: doctor.rasterizer(kind, by) for kind, by in RASTERIZERS},
    "memory": lambda _: doctor.memory(),
    "temporary": lambda _: doctor.temporary(),
    "disk": doctor.disk,
    "locks": doctor.locks,
}


NO_TORCH, NO_NUMPY = (with_import_error(ModuleNotFoundError(name=name)) for name in ("torch", "numpy"))
BROKEN = with_import_error(OSError("libcudart.so.12: cannot open shared object file"))
NUMBA_ERROR = "Numba needs NumPy 2.4 or less"
OLD_NUMBA = with_import_error(ImportError(NUMBA_ERROR)) | with_version("0.68.1")
OTHER_PYTHON = {"PYTHON": Range("3.90", "3.91")}
READ_ONLY = {"tempfile.TemporaryDirectory": deny, "tempfile.TemporaryFile": deny}
COMPUTERS = [  # patches of the doctor, the check, its status and exit code, and words of its lines
    *((with_version(version), "torch", WARNING, 0, [version, PIP]) for version in ("2.5.1", "3.0.0")),
    (with_version("2.6.0"), "torch", OK, 0, ["2.6.0"]),
    (NO_TORCH, "torch", ERROR, 3, ["torch is not installed.", f'{PIP} "torch>=']),
    (BROKEN, "torch", ERROR, 3, ["libcudart.so.12", "--force-reinstall"]),
    (NO_NUMPY, "torch", ERROR, 3, ["torch needs numpy, which is not installed."]),
    (with_version(None), "fast", OK, 0, ["is not installed", "as fast", f'{PIP} "numba>=']),
    (OLD_NUMBA, "fast", WARNING, 0, [NUMBA_ERROR, "--force-reinstall"]),
    ({}, "cpu, numba", OK, 0, ["Splats are computed on the processor, by numba."]),
    ({}, "cuda, numba", OK, 0, ["on the processor, by numba: gsplat has no kernels", f'{PIP} "gsplat==']),
    ({}, "cuda, gsplat", OK, 0, ["Splats are computed on the card, by gsplat."]),
    *(({}, f"{kind}, None", WARNING, 0, ["rendered from the voxels", f'{PIP} "numba>=']) for kind in ("cpu", "cuda")),
    (OTHER_PYTHON, "python", WARNING, 0, [sys.executable, "Use one of the tested versions"]),
    (with_disk(10**7), "disk", ERROR, 4, ["FOLDER"]),
    (with_disk(10**9), "disk", WARNING, 0, ["1.0 GB are free", "FOLDER"]),
    (with_disk(10**11), "disk", OK, 0, ["FOLDER"]),
    ({"total_memory": lambda: 2 * 10**9}, "memory", WARNING, 0, ["2.0 GB of memory"]),
    *(({"total_memory": lambda total=total: total}, "memory", OK, 0, ["memory"]) for total in (16 * 10**9, None)),
    ({}, "locks", OK, 0, ["Locks work in FOLDER."]),
    (READ_ONLY, "locks", ERROR, 4, ["FOLDER", "Choose"]),
    (READ_ONLY, "temporary", ERROR, 4, ["/tmp", "Choose"]),
]


@pytest.mark.parametrize(("patches", "check", "status", "code", "words"), COMPUTERS)
def test_check_reports_status_and_remedy(monkeypatch, tmp_path, patches, check, status, code, words):
    for name, value in patches.items():
        monkeypatch.setattr(f"karf_engine.cli.doctor.{name}", value)
    found = CHECKS[check](tmp_path)
    assert (found.status, found.exit_code) == (status, code)
    assert all(each.replace("FOLDER", str(tmp_path)) in " ".join(found.lines) for each in words)
    assert found.remedy or status == OK
    assert list(tmp_path.iterdir()) == []


def test_locks_that_do_not_hold_give_a_warning(monkeypatch, tmp_path):
    import filelock

    class Loose(filelock.FileLock):
        def _acquire(self):
            self._context.lock_file_fd = os.open(os.devnull, os.O_RDONLY)

        def _release(self):
            os.close(self._context.lock_file_fd)
            self._context.lock_file_fd = None

    monkeypatch.setattr("karf_engine.io.locks.FileLock", Loose)
    found = doctor.locks(tmp_path)
    assert found.status == WARNING and "two jobs could write at once" in found.sentence


def test_cuda_build_without_cards_gives_a_warning(monkeypatch):
    monkeypatch.setattr("torch.version.cuda", "12.8")
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    build, *_, device, _ = doctor.devices(None)
    assert build.status == WARNING and "CUDA 12.8" in build.sentence and "driver" in build.remedy
    assert device == Finding("device", OK, "Stages compute on the processor.")


def test_cards_are_listed_with_their_memory(monkeypatch):
    facts = SimpleNamespace(name="RTX 4090", total_memory=24 * 10**9)
    monkeypatch.setattr("torch.cuda.is_available", lambda: True)
    monkeypatch.setattr("torch.cuda.device_count", lambda: 1)
    monkeypatch.setattr("torch.cuda.get_device_properties", lambda number: facts)
    found = {finding.name: finding.sentence for finding in doctor.devices("cpu")}
    assert found["cuda:0"] == "cuda:0 is RTX 4090 with 24.0 GB of memory."


def test_apple_gpu_is_listed_as_untested_and_not_used(monkeypatch):
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    monkeypatch.setattr("torch.backends.mps.is_available", lambda: True)
    found = {finding.name: finding.sentence for finding in doctor.devices(None)}
    assert "untested" in found["mps"] and found["device"] == "Stages compute on the processor."


def test_missing_device_is_an_error_and_skips_the_stages(tmp_path):
    found = {finding.name: finding for finding in doctor.examine(tmp_path, device="cuda:7")}
    assert found["device"].status == ERROR and found["engine"].exit_code == 2 and "geometry" not in found


def test_smoke_run_times_every_stage(monkeypatch, tmp_path):
    monkeypatch.setattr(smoke.tempfile, "tempdir", str(tmp_path))
    found = list(smoke.stages(device="cpu", threads=1))
    assert [each.name for each in found] == [*STAGE_ORDER, "render"]
    assert all(each.status == OK and each.seconds > 0 for each in found)
    assert list(tmp_path.glob("karf-*")) == []


@pytest.mark.skipif(os.name == "nt", reason="a terminated process cannot clean up there")
def test_terminated_doctor_leaves_no_files(tmp_path):
    environment = os.environ | {"TMPDIR": str(tmp_path), "OMP_NUM_THREADS": "1"}
    process = subprocess.Popen([sys.executable, ROOT / "karf_engine", "doctor"], env=environment, cwd=tmp_path)
    while not list(tmp_path.glob("karf-doctor-*/capture")):
        assert process.poll() is None
        time.sleep(0.02)
    process.terminate()
    assert process.wait(60) == 6 and list(tmp_path.glob("karf-*")) == []


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_doctor_stops_when_python_drops_the_signals_exception(monkeypatch, capsys):
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


def test_failing_stage_is_named_and_ends_the_smoke_run(monkeypatch, capsys):
    monkeypatch.setattr("karf_engine.api.learn_geometry", Mock())
    monkeypatch.setattr("karf_engine.api.segment", Mock(side_effect=ValueError("operands do not fit")))
    geometry, segmentation = smoke.stages()
    assert geometry.status == OK and segmentation.status == ERROR
    assert "The stage segmentation does not run: ValueError('operands do not fit')." == segmentation.sentence
    assert "operands do not fit" in capsys.readouterr().err


def test_python_without_packages_gets_all_findings(tmp_path):
    command = [sys.executable, "-S", "-I", ROOT / "karf_engine", "doctor", "--json", "--folder", tmp_path]
    done = subprocess.run(command, capture_output=True, text=True)
    found = {finding.name: finding for finding in map(Finding.from_line, done.stdout.splitlines())}
    assert done.returncode == 3 and done.stderr == ""
    assert all(found[name].status == ERROR for name in PACKAGES) and "device" not in found
    assert found["disk"].status != ERROR and found["locks"].status == OK
    command = found["engine"].command  # one for all of them
    assert command.count("pip install") == 1 and all(f'"{package.requirement}"' in command for package in REQUIRED)
    assert "torch" in found["engine"].sentence


def test_doctor_requires_the_declared_package_ranges():
    def parsed(*texts):  # without markers
        return {(wanted.name, wanted.specifier) for wanted in map(Requirement, texts)}

    extras = PROJECT["optional-dependencies"]
    assert parsed(*(each.requirement for each in REQUIRED)) == parsed(*PROJECT["dependencies"])
    assert parsed(POSES.requirement) == parsed(*extras["photos"])
    assert parsed(GSPLAT) == parsed(*extras["gpu"])
    assert parsed(FAST.requirement) == parsed(*extras["fast"])


@pytest.mark.parametrize(
    ("system", "processor", "is_required"),
    [("linux", "x86_64", True), ("win32", "AMD64", True), ("darwin", "arm64", True), ("darwin", "x86_64", False)],
)
def test_fast_extra_is_required_only_on_supported_platforms(system, processor, is_required):
    (wanted,) = map(Requirement, PROJECT["optional-dependencies"]["fast"])
    assert wanted.marker.evaluate({"sys_platform": system, "platform_machine": processor}) == is_required


def test_doctor_accepts_the_declared_python_versions():
    assert SpecifierSet(PROJECT["requires-python"]) == SpecifierSet(f">={doctor.PYTHON.lowest}")
    named = [line.rpartition(" ")[2] for line in PROJECT["classifiers"] if "Python :: 3." in line]
    assert named and all(doctor.PYTHON.contains(version) for version in named)


def test_range_includes_lowest_and_excludes_end():
    supported = Range("2.6", "3")
    assert all(map(supported.contains, ("2.6", "2.6.0", "2.13.0+cu128", "2.99.99", "2.7.0a0+git12")))
    assert not any(map(supported.contains, ("2.5.9", "3", "3.0.0", "10.1", "?", "")))


def test_measured_speed_excludes_the_first_iterations(monkeypatch):
    times = iter((0.0, 5.0, 5.5, 6.5))
    monkeypatch.setattr(smoke.time, "perf_counter", lambda: next(times))

    def learn(*_, emit, **__):
        emit("stage", name="geometry")
        for step in (4, 12, 20, 40):
            emit("progress", stage="geometry", step=step)

    monkeypatch.setattr("karf_engine.api.learn_geometry", learn)
    assert smoke.samples_per_second() == pytest.approx(smoke.REAL_SPEED * smoke.SAMPLES * 28 / 1.5)


def test_estimated_seconds_scale_with_samples():
    def seconds_of(rate=1e6, preset="demo", is_open=False, **splats):
        settings = PRESETS[preset]
        settings = replace(settings, splats=replace(settings.splats, **splats))
        return seconds_of_stages(settings, rate, is_open=is_open)

    slow, fast, none = seconds_of(1e5), seconds_of(2e5), seconds_of(iterations=0)
    assert all(slow[stage] == 2 * fast[stage] for stage in ("geometry", "segmentation", "recoloring", "splats"))
    assert seconds_of(1e5, is_open=True)["geometry"] > slow["geometry"]
    small, large, huge = (seconds_of(long_side=side)["splats"] for side in (200, 400, 4000))
    assert none["splats"] == 0 < small < large == huge  # large photos are learned in windows
    assert seconds_of(preset="paper") is None  # the paper's NeRF was not measured
