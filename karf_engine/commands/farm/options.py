"""What a bundle is told of its frames and its machines. With the standard library alone."""

from __future__ import annotations

PER_TASK = 10  # frames
PYTHON = "python3"
MACHINE = ("threads", "device")
PICTURES = ("base", "size", "format", "depth", "unsure", "layers", "alpha", "jpeg", "overrides", *MACHINE)
