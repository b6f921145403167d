"""What a plan says before anything happens: sizes, places, commands, and why it cannot be."""

import shlex
import shutil
import subprocess
import sys
from collections import namedtuple
from pathlib import Path

import pytest

from .conftest import PYTHON

LINUX, WINDOWS, MAC = "linux-x86_64", "windows-x86_64", "macos-arm64"


USAGE = namedtuple("USAGE", "total used free")


@pytest.fixture
def plan(managed, tmp_path, monkeypatch):
    """A function that plans for any computer, of whatever disk, by the real recipes."""
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: USAGE(200e9, 100e9, 100e9))

    def make(platform=LINUX, devices=(), is_online=True, variables=None, **choices):
        here = managed.computer.Machine(platform, devices)
        wanted = managed.plan.Choices(**{"folder": tmp_path / "my engine", **choices})
        return managed.plan.make(wanted, sys.executable, is_online, variables or {"PATH": ""}, here)

    return make


def test_it_says_how_much_from_where_and_where_to_and_changes_nothing(managed, plan, tmp_path):
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
def test_each_build_comes_from_where_it_is(plan, platform, devices, choice, build, backend):
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


@pytest.mark.parametrize(("platform", "build"), [(LINUX, "mps"), (WINDOWS, "rocm"), (MAC, "cuda"), (LINUX, "tpu")])
def test_a_build_that_does_not_exist_is_refused(managed, plan, platform, build):
    with pytest.raises(managed.api.BadRequest, match=build):
        plan(platform, build=build)


def test_a_computer_without_recipe_is_told_so(managed, plan):
    with pytest.raises(managed.api.MissingDependency, match="no engine for freebsd-x86_64"):
        plan("freebsd-x86_64")
    with pytest.raises(managed.api.MissingDependency, match="photos cannot be had"):
        plan("linux-aarch64", ("cuda",), extras=("photos",))


def test_without_leave_to_use_the_network_the_preference_is_named(managed, plan):
    with pytest.raises(managed.api.BadRequest, match="may not use the network") as caught:
        plan(is_online=False)
    assert "Allow Online Access" in caught.value.hint and "folder of wheels" in caught.value.hint


def test_the_source_is_that_of_this_computer_without_its_password(plan, tmp_path):
    def source(**variables):
        return plan(variables={"PATH": "", **variables}).source

    secret = "https://name:secret@mirror.example/simple"
    for name in ("UV_DEFAULT_INDEX", "UV_INDEX_URL"):
        found = source(**{name: secret})
        assert "https://mirror.example/simple" in found.sentence and "secret" not in found.sentence
        assert found.variables == {}
    assert source(PIP_INDEX_URL=secret).variables == {"UV_DEFAULT_INDEX": secret}
    settings = tmp_path / "pip.conf"
    settings.write_text("[global]\nindex-url = https://mirror.example/other\n")
    found = source(PIP_CONFIG_FILE=str(settings))
    assert "mirror.example/other" in found.sentence and str(settings) in found.sentence
    assert found.variables == {"UV_DEFAULT_INDEX": "https://mirror.example/other"}
    settings.write_text("index-url without section")
    assert source(PIP_CONFIG_FILE=str(settings), HOME=str(tmp_path)).sentence


def test_a_lock_file_is_read_for_one_python(managed):
    for platform, python in ((LINUX, "3.11"), (WINDOWS, "3.14"), (MAC, "3.12")):
        wheels = managed.locks.read(platform, "cpu", python, ("photos",)).wheels
        assert len({wheel.name for wheel in wheels}) == len(wheels) == 20
        tag = f"cp{python.replace('.', '')}"
        assert all("-cp3" not in wheel.file or tag in wheel.file or "abi3" in wheel.file for wheel in wheels)
    with pytest.raises(managed.api.MissingDependency, match=r"Python 3\.9"):
        managed.locks.read(LINUX, "cpu", "3.9")


def test_a_disk_without_space_is_named_with_what_is_needed(managed, plan, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: USAGE(9e9, 8e9, 1_000_000_000))
    with pytest.raises(managed.api.DataError, match=r"has 1\.0 GB free; the engine needs about 5\.\d GB"):
        plan(devices=("cuda",))


def test_what_is_there_already_needs_no_more_space(managed, plan, tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: USAGE(9e9, 8e9, 1_000_000_000))
    monkeypatch.setattr(managed.home, "measure", lambda folder: iter([1_000_000, 4_900_000_000]))
    assert plan(devices=("cuda",)).free_bytes < 1.1e9


def test_a_folder_that_cannot_be_is_refused(managed, plan, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(managed.api.DataError, match="is a file"):
        plan(folder=tmp_path / "file")
    with pytest.raises(managed.api.BadRequest, match="whole path"):
        plan(folder=Path("engine"))


def test_long_paths_are_a_warning_on_windows_alone(plan, tmp_path):
    deep = tmp_path / ("d" * 120)
    assert any("long paths" in line for line in plan(WINDOWS, folder=deep).sentences)
    assert not any("long paths" in line for line in plan(MAC, ("mps",), folder=deep).sentences)


# --- commands by hand ---------------------------------------------------------------------------------------------
def test_commands_for_posix_shells_are_those_that_run(plan):
    made = plan()
    assert [tuple(shlex.split(line)) for line in made.commands("posix").splitlines()] == [
        step.command for step in made.steps()
    ]


@pytest.mark.parametrize(
    "word", ["a b", "it's", "50%", "(x86)", "a&b", "ü", "plain", r"C:\my env\x.exe", "$HOME", "a;b"]
)
def test_words_survive_every_shell(managed, word):
    line = managed.computer.shell_line
    echo = [sys.executable, "-c", "import sys; print(ascii(sys.argv[1]))", word]
    done = (
        subprocess.run(["sh", "-c", line(echo, "posix")], capture_output=True, text=True)
        if shutil.which("sh")
        else None
    )
    assert done is None or done.stdout.strip() == ascii(word)
    quoted = line(["run", word], "powershell").removeprefix("& run ")
    assert quoted == word or quoted == "'" + word.replace("'", "''") + "'"
    assert line(["run", word], "cmd").removeprefix("run ").strip('"') == word
    for special in " &()';$":
        assert special not in word or (line(["run", word], "cmd").endswith('"') and quoted.startswith("'"))


# --- without network ----------------------------------------------------------------------------------------------
def test_a_folder_that_lacks_files_names_them(managed, kitchen, planned):
    for path in [*kitchen.folder.glob("scipy-*"), *kitchen.folder.glob("pillow-*")]:
        path.unlink()
    with pytest.raises(managed.api.DataError, match=r"lacks 2 of 10 files: scipy-1\.0.*whl, pillow-1\.0.*whl\."):
        planned()
    next(kitchen.folder.glob("torch-*")).unlink()
    with pytest.raises(managed.api.DataError, match=r"lacks 3 of 10 files: .*torch-2\.0"):
        planned()


def test_a_file_that_is_not_whole_is_named(managed, kitchen, planned):
    path = next(kitchen.folder.glob("numpy-*"))
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(managed.api.DataError, match=r"numpy-1\.0-py3-none-any\.whl has 100 bytes in place of"):
        planned()


def test_what_must_be_fetched_elsewhere_is_listed_with_hashes(addon, managed):
    listing, command = addon.steps.engine_files("windows-x86_64", "3.12", "cpu", ("photos",), "cmd")
    lock = managed.locks.read(WINDOWS, "cpu", "3.12", ("photos",))
    wheels = (*lock.wheels, managed.locks.read_uv(WINDOWS))
    assert [line.partition("  #")[0] for line in listing.splitlines()] == [wheel.requirement for wheel in wheels]
    assert all(wheel.file in listing for wheel in wheels)
    assert "--platform win_amd64" in command and "--python-version 3.12" in command and "--require-hashes" in command
