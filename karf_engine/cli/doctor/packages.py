"""Check the packages: whether each loads, its version, and torch's devices."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module, metadata

from ...errors import KarfError, MissingDependency
from ...io.failures import first_line
from ...worker.findings import ERROR, OK, WARNING, Finding, error_finding
from ...worker.requirements import FAST, POSES, REQUIRED, Package
from .machine import GB

PROCESSOR = "the processor"
INSTALL = "Install it, in a terminal:"
MISSING = MissingDependency.code
FAST_BRINGS = "With it the processor learns a scene nearly three times as fast."


def required() -> Iterator[Finding]:
    """Load and judge the required packages."""
    for package in REQUIRED:
        yield check_package(package)


def optional() -> Iterator[Finding]:
    """Judge the packages without which stages do less, or take longer."""
    yield poses()
    yield fast()


def poses() -> Finding:
    """Judge the package that finds camera poses, without loading it: stages load it in a child process."""
    version = installed_version(POSES)
    if version is None:
        sentence = "pycolmap is not installed: only photos without camera poses need it."
        return Finding(POSES.name, OK, sentence, INSTALL, install_command(POSES))
    return _judged(POSES, version)


def fast() -> Finding:
    """Judge the package that compiles kernels for the processor; torch computes the same without it."""
    if installed_version(FAST) is None:
        found = Finding(FAST.name, OK, f"{FAST.pip} is not installed.", INSTALL, install_command(FAST))
    else:
        found = check_package(FAST)
    status = WARNING if found.status == ERROR else found.status
    return replace(found, status=status, sentence=f"{found.sentence} {FAST_BRINGS}", code="")


def check_package(package: Package) -> Finding:
    """Load a package and judge its version."""
    try:
        module = import_module(package.name)
    except ModuleNotFoundError as error:
        what = package.pip if error.name == package.name else f"{package.pip} needs {error.name}, which"
        return Finding(package.name, ERROR, f"{what} is not installed.", INSTALL, install_command(package), MISSING)
    except Exception as error:  # a broken shared library may raise anything
        sentence = f"{package.pip} is installed, and cannot be loaded: {first_line(error)}."
        command = install_command(package, options="--force-reinstall ")
        return Finding(package.name, ERROR, sentence, "Install it anew:", command, MISSING)
    return _judged(package, installed_version(package) or getattr(module, "__version__", "?"))


def devices(chosen: str | None) -> Iterator[Finding]:
    """Yield what torch was built for, its cards, and the device of stages; `chosen` is their option."""
    import torch

    from ...compute.runtime import find_device

    build = _build(torch)
    if build != PROCESSOR and not torch.cuda.is_available():
        sentence = f"This torch was built for {build}, and finds no such card: it computes on the processor."
        yield Finding("build", WARNING, sentence, "Update the card's driver, or install a torch for the processor.")
    elif build == PROCESSOR and shutil.which("nvidia-smi"):
        sentence = "This torch was built for the processor, and this computer has an NVIDIA card."
        yield Finding("build", WARNING, sentence, "Install a torch built for CUDA to learn on the card.")
    else:
        yield Finding("build", OK, f"This torch was built for {build}.")
    try:
        device = find_device(chosen)
    except KarfError as error:
        yield error_finding("device", error)
        return
    for number in range(torch.cuda.device_count()) if torch.cuda.is_available() else ():
        facts = torch.cuda.get_device_properties(number)
        sentence = f"cuda:{number} is {facts.name} with {facts.total_memory / GB:.1f} GB of memory."
        yield Finding(f"cuda:{number}", OK, sentence)
    yield Finding("device", OK, f"Stages compute on {PROCESSOR if device.type == 'cpu' else device}.")


def install_command(*packages: Package, options: str = "") -> str:
    """Return the terminal command that installs packages."""
    wanted = " ".join(f'"{package.requirement}"' for package in packages)
    return f'"{sys.executable}" -m pip install {options}{wanted}'


def installed_version(package: Package) -> str | None:
    """Return a package's version by its metadata, also where another distribution provides it, or None."""
    for distribution in (package.pip, *metadata.packages_distributions().get(package.name, ())):
        try:
            return metadata.version(distribution)
        except metadata.PackageNotFoundError:
            continue
    return None


def _build(torch) -> str:
    if getattr(torch.version, "hip", None):
        return f"AMD cards (ROCm {torch.version.hip})"
    if torch.version.cuda:
        return f"NVIDIA cards (CUDA {torch.version.cuda})"
    return PROCESSOR


def _judged(package: Package, version: str) -> Finding:
    if package.range.contains(version):
        return Finding(package.name, OK, f"{package.pip} {version} is among the tested versions ({package.range}).")
    sentence = f"{package.pip} {version} is not among the tested versions ({package.range})."
    return Finding(package.name, WARNING, sentence, "Install a tested version:", install_command(package))
