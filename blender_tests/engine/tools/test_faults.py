"""Faults thrown at the engine, in small: the command itself with a few of each kind (all: python3 tools/dev.py faults)."""

import json
import os
import subprocess
import sys

import pytest

from blender_tests.engine.conftest import ROOT
from tools import dev

pytest.importorskip("torch")
pytest.importorskip("resource", reason="processes are forked and limited, which Windows cannot")
FAMILIES = ("kills", "events", "disk", "folders", "memory", "damage", "locks", "versions")


@pytest.fixture(scope="module")
def report(tmp_path_factory) -> dict:
    """What a quick run of the command finds."""
    out = tmp_path_factory.mktemp("faults")
    done = subprocess.run(
        [sys.executable, "-m", "tools.reliability.faults", "--quick", "--kills", "6", "--out", str(out)],
        cwd=ROOT,
        env=os.environ | dev.ONE_THREAD,
        capture_output=True,
        text=True,
        timeout=900,
    )
    assert (out / "faults.json").exists(), done.stderr
    return json.loads((out / "faults.json").read_text())


@pytest.mark.parametrize("family", FAMILIES)
def test_a_project_survives(report, family):
    rows = [row for row in report["rows"] if row["family"] == family]
    assert sum(row["tries"] for row in rows) > 0
    assert {row["fault"]: row["failures"] for row in rows if row["failures"]} == {}
