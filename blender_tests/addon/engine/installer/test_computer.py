"""Finding the computer's devices for torch, programs that make environments, and shells."""

import shutil
import subprocess
import sys

import pytest

NODE = "sys/class/kfd/kfd/topology/nodes/1/properties"
AMD, NO_AMD = ({"dev/kfd": "", NODE: f"gfx_target_version {number}\n"} for number in (110000, 0))


@pytest.mark.parametrize(
    ("system", "processor", "files", "platform", "devices", "builds"),
    [
        ("Linux", "x86_64", {}, "linux-x86_64", (), "cpu cuda rocm"),
        ("Linux", "x86_64", {"proc/driver/nvidia/version": ""}, "linux-x86_64", ("cuda",), "cpu cuda rocm"),
        ("Linux", "aarch64", {"dev/nvidiactl": ""}, "linux-aarch64", ("cuda",), "cpu cuda"),
        ("Linux", "x86_64", {"usr/lib/wsl/lib/libcuda.so.1": ""}, "linux-x86_64", ("cuda",), "cpu cuda rocm"),
        ("Linux", "x86_64", AMD, "linux-x86_64", ("rocm",), "cpu cuda rocm"),
        ("Linux", "x86_64", NO_AMD, "linux-x86_64", (), "cpu cuda rocm"),
        ("Windows", "AMD64", {"Windows/System32/nvcuda.dll": ""}, "windows-x86_64", ("cuda",), "cpu cuda"),
        ("Windows", "AMD64", {}, "windows-x86_64", (), "cpu cuda"),
        ("Darwin", "arm64", {}, "macos-arm64", ("mps",), "cpu mps"),
        ("Darwin", "x86_64", {}, "macos-x86_64", (), ""),
        ("FreeBSD", "amd64", {}, "freebsd-x86_64", (), ""),
    ],
)
def test_drivers_are_detected_without_torch(managed, tmp_path, system, processor, files, platform, devices, builds):
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    here = managed.computer.detect_machine(system, processor, tmp_path)
    assert (here.platform, here.devices, here.builds) == (platform, devices, tuple(builds.split()))
    assert here.device_sentence.startswith("Found " if devices else "No graphics driver")


def program(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return str(path)


def python(path, version="3 12", has_venv=True, bits=64):
    return program(path, f"echo {version} {bits} {has_venv}")


@pytest.fixture
def find(managed, tmp_path, monkeypatch):
    """A function that searches a temporary PATH for a starter."""
    if sys.platform == "win32":
        pytest.skip("the programs are shell scripts")
    monkeypatch.setattr(managed.computer, "UNIX_FOLDERS", ())
    return lambda own, chosen="": managed.computer.find_starter(chosen, own, {"PATH": str(tmp_path / "bin")})


def test_starter_is_blenders_python_then_uv_then_others(managed, find, tmp_path):
    starter = managed.computer.Starter
    can, cannot = python(tmp_path / "own"), python(tmp_path / "bare", "3 14", has_venv=False)
    other = python(tmp_path / "bin" / "python3.13", "3 13")
    assert find(can) == starter(can, "3.12")
    assert find(cannot) == starter(other, "3.13")
    uv = program(tmp_path / "bin" / "uv", "exit 1")
    assert find(cannot) == starter(cannot, "3.14", uv)  # uv needs no ensurepip
    assert find(python(tmp_path / "old", "3 9")) == starter("", "3.13", uv)
    assert find(can, chosen=other).python == other
    assert find(can, chosen=uv).uv == uv


def test_error_without_a_starter_lists_the_candidates(managed, find, tmp_path):
    python(tmp_path / "bin" / "python3.11", "3 11", bits=32)
    program(tmp_path / "bin" / "python3", "exit 1")
    with pytest.raises(managed.api.MissingDependency) as caught:
        find(python(tmp_path / "own", has_venv=False))
    for part in ("own (Python 3.12 without venv),", "python3.11 (Python 3.11 of 32 bits)", "python3.", "python3-venv"):
        assert part in str(caught.value)
    with pytest.raises(managed.api.MissingDependency, match="gone"):
        find(python(tmp_path / "own"), chosen=str(tmp_path / "gone"))


@pytest.mark.parametrize(
    ("word", "powershell", "cmd"),
    [
        ("plain", "plain", "plain"),
        (r"C:\env\x.exe", r"C:\env\x.exe", r"C:\env\x.exe"),
        ("a b", "'a b'", '"a b"'),
        ("it's", "'it''s'", '"it\'s"'),
        ("(50%)", "'(50%)'", '"(50%)"'),
        ("ü&$HOME;", "'ü&$HOME;'", '"ü&$HOME;"'),
    ],
)
def test_arguments_survive_every_shell(managed, word, powershell, cmd):
    line = managed.computer.shell_line
    assert line(["run", word], "powershell") == f"& run {powershell}"
    assert line(["run", word], "cmd") == f"run {cmd}"
    if shutil.which("sh"):
        echo = line([sys.executable, "-c", "import sys; print(ascii(sys.argv[1]))", word], "posix")
        assert subprocess.run(["sh", "-c", echo], capture_output=True, text=True).stdout.strip() == ascii(word)
