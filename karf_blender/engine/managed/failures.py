"""What pip, uv and Python say when they fail, as a sentence and a remedy. No bpy."""

import re
from collections.abc import Sequence
from typing import Any

from ...engine_api import BadRequest, DataError, KarfError, MissingDependency
from .plan import Plan, Step

NETWORK = (  # phrases of network errors, the most specific first
    "temporary failure in name resolution",
    "failed to lookup address",
    "connection refused",
    "connection reset",
    "network is unreachable",
    "operation timed out",
    "read timed out",
    "error decoding response body",
    "failed to establish a new connection",
    "proxyerror",
    "dns error",
    "tcp connect error",
    "error sending request",
    "request failed after",
)
CERTIFICATE = ("invalid peer certificate", "certificate verify failed", "unknownissuer")
FULL = ("no space left on device", "os error 28", "os error 112", "not enough space on the disk", "disk quota exceeded")
HASH = ("hash mismatch", "do not match the hashes")
BACKEND_NAMES = {"cuda": ("cuda",), "rocm": ("rocm",), "cpu": ("cpu",), "mps": ("cpu",)}
OTHER_BUILD = "Or choose the build cuda: the usual index has it, and it computes on processors too. "
GO_ON = "What was fetched is kept; Install goes on from there."


def explained(plan: Plan, step: Step, said: Sequence[str], how: str) -> KarfError:
    """The error for a command that failed.

    Args:
        plan: The installation's.
        step: The command.
        said: Its words.
        how: Its exit code or signal.
    """
    text = "\n".join(said)
    low = text.lower()
    if any(word in low for word in HASH):
        return DataError(
            f"{_named(text)} is not the file that KaRF was tested with: its hash is another.",
            f"It was not installed. Is {step.source} to be trusted? {GO_ON}",
        )
    if any(word in low for word in FULL):
        return DataError(
            f"The disk of {plan.choices.folder} is full.", f"Free some space, or choose another folder. {GO_ON}"
        )
    if any(word in low for word in CERTIFICATE):
        return DataError(
            f"The certificate of {step.source} is not accepted.",
            f"In a network with certificates of its own set UV_SYSTEM_CERTS=1, or SSL_CERT_FILE to their file, and start "
            f"Blender anew. {GO_ON}",
        )
    if reason := next((word for word in NETWORK if word in low), None):
        other = OTHER_BUILD if plan.backend == "cpu" and step.estimate else ""
        return DataError(
            f"No connection to {step.source} ({reason}).",
            f"Check network and proxy, or choose a folder of wheels. {other}{GO_ON}",
        )
    return MissingDependency(f"{step.title} failed ({how}): {_last(said)}", f"{plan.home.log} tells more. {GO_ON}")


def does_not_start(step: Step, error: OSError) -> KarfError:
    """The error for a command that is not there or may not run."""
    return MissingDependency(
        f"{step.command[0]} does not start ({error.strerror or error}).", "Choose another starter, then Repair."
    )


def check_build(plan: Plan, tested: dict[str, Any]) -> None:
    """Raise BadRequest where uv's backend has brought another build of torch than was meant."""
    if tested["build"] not in BACKEND_NAMES[plan.build]:
        raise BadRequest(
            f"torch {tested['torch']} is a {tested['build']} build, not the {plan.build} build that was chosen.",
            "Choose another build: uv found no driver on this computer for the chosen one.",
        )


def _named(text: str) -> str:
    """The package that a complaint about hashes names."""
    found = re.search(r"[Hh]ash mismatch for [`']?([\w.-]+==[\w.+]+)", text) or re.search(
        r"^\s+([\w.-]+==\S+) from", text, re.M
    )
    return found[1] if found else "A file"


def _last(said: Sequence[str]) -> str:
    """The last words that say something, without the marks that uv and pip put before them."""
    words = [re.sub(r"^([^\w`(/]+|cause: |error: |ERROR: )+", "", line) for line in said]
    return next((line for line in reversed(words) if line), "it said nothing")
