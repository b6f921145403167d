"""A plan shows sizes, folders and commands before anything happens, or why installing is impossible."""

import shlex
import shutil
import sys
from collections import namedtuple
from pathlib import Path

import pytest

from .conftest import PYTHON

LINUX, WINDOWS, MAC = "linux-x86_64", "windows-x86_64", "macos-arm64"
USAGE = namedtuple("USAGE", "total used free")


@pytest.fixture
def plan(managed, tmp_path, monkeypatch):
    """A function that plans for any computer, with the real lock files and 100 GB free."""
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: USAGE(200e9, 100e9, 100e9))

    def make(platform=LINUX, devices=(), is_online=True, variables=None, **choices):
        here = managed.computer.Machine(platform, devices)
        chosen = managed.plan.Choices(**{"folder": tmp_path / "my engine", **choices})
        return managed.plan.make(chosen, sys.executable, is_online, variables or {"PATH": ""}, here)

    return make


def test_plan_names_size_source_and_folder_and_changes_nothing(managed, plan, tmp_path):
    made = plan(devices=("cuda",))
    sizes = [wheel.size for wheel in made.lock.wheels + made.tools]
    assert made.download_bytes == sum(sizes) > 2.5e9
    text = "\n".join(made.sentences)
    assert f"{len(sizes)} checked files, {managed.plan.size_text(sum(sizes))}." in text
    assert "Found an NVIDIA driver. Build of torch: cuda." in text
    assert "From the Python Package Index" in text
    assert f"To {tmp_path / 'my engine'}, about " in text and "are free" in text
    assert f"made by {sys.executable} (Python {PYTHON})" in text
    assert list(tmp_path.iterdir()) == []
    commands = [shlex.split(line) for line in made.commands("posix").splitlines()]
    assert commands == [list(step.command) for step in made.steps()]


@pytest.mark.parametrize(
    ("platform", "devices", "choice", "build", "backend"),
    [
        (LINUX, ("cuda",), "auto", "cuda", ""),
        (LINUX, (), "auto", "cpu", "cpu"),
        (LINUX, ("rocm",), "auto", "rocm", "auto"),
        (LINUX, ("cuda", "rocm"), "cpu", "cpu", "cpu"),
        (WINDOWS, (), "auto", "cpu", ""),
        (WINDOWS, ("cuda",), "auto", "cuda", "auto"),
        (MAC, ("mps",), "auto", "mps", ""),
        ("linux-aarch64", ("cuda",), "auto", "cuda", ""),
    ],
)
def test_torch_build_comes_from_the_index_that_has_it(plan, platform, devices, choice, build, backend):
    made = plan(platform, devices, build=choice)
    assert (made.lock.build, made.backend) == (build, backend)
    assert "numba" in [wheel.name for wheel in made.lock.wheels]
    if backend:
        assert "--torch-backend" in made.steps()[-1].command and "--require-hashes" not in made.steps()[-1].command
        assert any("no hash of torch" in line for line in made.sentences)
        assert any(", about " in line and f" for {build}" in line for line in made.sentences)
    else:
        assert made.lock.torch.sha256 and "--torch-backend" not in made.commands()
        assert "--require-hashes" in made.steps()[-1].command


@pytest.mark.parametrize(
    ("options", "error", "sentence"),
    [
        ({"build": "mps"}, "BadRequest", "no mps build"),
        ({"platform": WINDOWS, "build": "rocm"}, "BadRequest", "no rocm build"),
        ({"platform": MAC, "build": "cuda"}, "BadRequest", "no cuda build"),
        ({"build": "tpu"}, "BadRequest", "'tpu' is not a build"),
        ({"extras": ("fast",)}, "BadRequest", "fast is not an extra"),
        ({"platform": "freebsd-x86_64"}, "MissingDependency", "no engine for freebsd-x86_64"),
        ({"platform": "linux-aarch64", "extras": ("photos",)}, "MissingDependency", "photos cannot be had"),
        ({"is_online": False}, "BadRequest", "may not use the network.*Allow Online Access.*folder of wheels"),
        ({"folder": Path("engine")}, "BadRequest", "whole path"),
        ({"folder": Path(__file__)}, "DataError", "is a file"),
    ],
)
def test_impossible_choices_are_rejected(managed, plan, options, error, sentence):
    with pytest.raises(getattr(managed.api, error), match=sentence):
        plan(**options)


SECRET, MIRROR = "https://name:secret@mirror.example/simple", "https://mirror.example/other"


@pytest.mark.parametrize(
    ("variables", "index", "passed"),
    [
        ({"UV_DEFAULT_INDEX": SECRET}, "https://mirror.example/simple", {}),
        ({"UV_INDEX_URL": SECRET}, "https://mirror.example/simple", {}),
        ({"PIP_INDEX_URL": SECRET}, "https://mirror.example/simple", {"UV_DEFAULT_INDEX": SECRET}),
        (f"[global]\nindex-url = {MIRROR}\n", MIRROR, {"UV_DEFAULT_INDEX": MIRROR}),
        ("index-url without section", "the Python Package Index", {}),
    ],
)
def test_source_is_the_configured_index_without_its_password(plan, tmp_path, variables, index, passed):
    if isinstance(variables, str):  # pip's settings
        (tmp_path / "pip.conf").write_text(variables)
        variables = {"PIP_CONFIG_FILE": str(tmp_path / "pip.conf"), "HOME": str(tmp_path)}
    source = plan(variables={"PATH": "", **variables}).source
    assert index in source.sentence and "secret" not in source.sentence
    assert source.variables == passed


def test_lock_has_one_wheel_per_package_for_each_python(managed):
    for platform, python in ((LINUX, "3.11"), (WINDOWS, "3.14"), (MAC, "3.12")):
        wheels = managed.locks.read(platform, "cpu", python, ("photos",)).wheels
        assert len({wheel.name for wheel in wheels}) == len(wheels) == 21
        tag = f"cp{python.replace('.', '')}"
        assert all("-cp3" not in wheel.file or tag in wheel.file or "abi3" in wheel.file for wheel in wheels)
    with pytest.raises(managed.api.MissingDependency, match=r"Python 3\.9"):
        managed.locks.read(LINUX, "cpu", "3.9")


def test_full_disk_is_named_unless_the_cache_suffices(managed, plan, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: USAGE(9e9, 8e9, 1_000_000_000))
    with pytest.raises(managed.api.DataError, match=r"has 1\.0 GB free; the engine needs about 5\.\d GB"):
        plan(devices=("cuda",))
    monkeypatch.setattr(managed.home, "measure", lambda folder: iter([1_000_000, 4_900_000_000]))
    assert plan(devices=("cuda",)).free_bytes < 1.1e9


def test_long_paths_are_warned_of_only_on_windows(plan, tmp_path):
    deep = tmp_path / ("d" * 120)
    assert any("long paths" in line for line in plan(WINDOWS, folder=deep).sentences)
    assert not any("long paths" in line for line in plan(MAC, ("mps",), folder=deep).sentences)


def test_missing_and_incomplete_wheels_are_named(managed, stock, planned):
    half = next(stock.folder.glob("numpy-*"))
    whole = half.read_bytes()
    half.write_bytes(whole[:100])
    with pytest.raises(managed.api.DataError, match=r"numpy-1\.0-py3-none-any\.whl has 100 bytes in place of"):
        planned()
    half.write_bytes(whole)
    for path in [*stock.folder.glob("scipy-*"), *stock.folder.glob("pillow-*")]:
        path.unlink()
    with pytest.raises(managed.api.DataError, match=r"lacks 2 of 11 files: scipy-1\.0.*whl, pillow-1\.0.*whl\."):
        planned()
    next(stock.folder.glob("torch-*")).unlink()
    with pytest.raises(managed.api.DataError, match=r"lacks 3 of 11 files: .*torch-2\.0"):
        planned()


def test_listing_for_offline_use_has_hashes(addon, managed):
    listing, command = addon.steps.engine_files("windows-x86_64", "3.12", "cpu", ("photos",), "cmd")
    lock = managed.locks.read(WINDOWS, "cpu", "3.12", ("photos",))
    wheels = (*lock.wheels, managed.locks.read_uv(WINDOWS))
    assert [line.partition("  #")[0] for line in listing.splitlines()] == [wheel.requirement for wheel in wheels]
    assert all(wheel.file in listing for wheel in wheels)
    assert "--platform win_amd64" in command and "--python-version 3.12" in command and "--require-hashes" in command


PIP_HASH = """Collecting uv==0.13.9
ERROR: THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE.
    uv==0.13.9 from file:///wheels/uv.whl (from -r uv.txt (line 1)):
        Expected sha256 aa
             Got        bb"""
CERTIFICATE = "error: Request failed after 3 retries\n  cause: invalid peer certificate: UnknownIssuer"
PIP_NETWORK = """WARNING: Retrying: Failed to establish a new connection: [Errno -3] Temporary failure in name resolution
ERROR: No matching distribution found for uv==0.13.9"""


@pytest.mark.parametrize(
    ("output", "sentence"),
    [
        (PIP_HASH, "uv==0.13.9 is not the file that KaRF was tested with"),
        (CERTIFICATE, "The certificate of "),
        (PIP_NETWORK, "No connection to .*temporary failure in name resolution"),
        ("error: failed to write\n  cause: No space left on device (os error 28)", "The disk of .* is full"),
        ("error: No solution found when resolving dependencies", "A file that the engine needs is not to be had from"),
        ("error: something new\n", r"Installing packages failed \(exit code 2\): something new"),
        ("", r"Installing packages failed \(exit code 2\): it said nothing"),
    ],
)
def test_pip_or_uv_failure_is_explained_with_a_remedy(managed, plan, output, sentence):
    made = plan()
    error = managed.installation.explain(made, made.steps()[-1], output.splitlines(), "exit code 2")
    assert error.hint.endswith("Install goes on from there.")
    with pytest.raises(managed.api.KarfError, match=sentence):
        raise error


@pytest.mark.parametrize("devices, is_offered", [((), True), (("cuda",), False)])
def test_usual_index_is_offered_if_torchs_is_unreachable(managed, plan, devices, is_offered):
    made = plan(devices=devices)
    error = managed.installation.explain(made, made.steps()[-1], ["dns error"], "exit code 2")
    assert ("build cuda" in error.hint) == ("torch's own index" in error.sentence) == is_offered
