"""Whether this Python can run the engine: which packages are there, and what computes."""

from __future__ import annotations

import platform
import sys
from importlib import import_module
from typing import Any

from .errors import INSTALL_NAMES

PACKAGES = ("numpy", "scipy", "torch", "safetensors", "filelock", "PIL", "imageio", "cv2", "OpenEXR")


def examine() -> dict[str, Any]:
    """Facts about this Python: `ok`, versions, device, and for what is missing a sentence and the remedy."""
    versions, missing = {}, []
    for name in PACKAGES:
        try:
            versions[name] = getattr(import_module(name), "__version__", "?")
        except ImportError:
            missing.append(INSTALL_NAMES.get(name, name))
    report: dict[str, Any] = {
        "ok": not missing,
        "python": platform.python_version(),
        "executable": sys.executable,
        "versions": versions,
        "missing": missing,
    }
    if missing:
        report["sentence"] = f"{sys.executable} has no {', '.join(missing)}."
        report["hint"] = f"Install: {sys.executable} -m pip install {' '.join(missing)}"
    if "torch" in versions:
        import torch

        report["device"] = torch.cuda.get_device_name() if torch.cuda.is_available() else "cpu"
    return report
