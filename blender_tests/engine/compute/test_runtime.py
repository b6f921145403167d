"""Devices are chosen or rejected, cores share work, and solvers report poor convergence."""

import math
import subprocess
import sys
import threading
import warnings

import numpy as np
import pytest
import torch
from scipy import sparse

from karf_engine.cli import main
from karf_engine.compute import cores, sparse_systems
from karf_engine.compute.neighbors import build_kd_tree
from karf_engine.compute.runtime import find_device, start_runtime
from karf_engine.compute.sparse_systems import NotConverged, convergence_as_event, warn_not_converged
from karf_engine.errors import BadRequest
from karf_engine.segmentation import label_propagation

UNKNOWN = ("gpu", "cuda", "cuda:0", "cuda:x", "cpu:1", "CPU", "", "xla", "meta", "vulkan", "mps", "mps:0", "🏺")


def pretend_cards(count, monkeypatch):
    """Pretend that the machine has this many cards, which do not answer."""
    monkeypatch.setattr(torch.cuda, "is_available", lambda: count > 0)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: count)


@pytest.mark.parametrize(
    ("name", "cards", "sentence", "known"),
    [
        *((name, 0, f"There is no device {name!r}.", "can be used: cpu.") for name in UNKNOWN),
        ("cuda:2", 2, "There is no device 'cuda:2'.", "cpu, cuda, cuda:0, cuda:1."),
    ],
)
def test_missing_device_is_rejected_with_available_ones(name, cards, sentence, known, monkeypatch):
    pretend_cards(cards, monkeypatch)
    with pytest.raises(BadRequest) as raised:
        find_device(name)
    assert sentence in raised.value.sentence and known in raised.value.hint


@pytest.mark.skipif(torch.cuda.is_available(), reason="the card answers")
@pytest.mark.parametrize("name", ["cuda:1", None])
def test_unresponsive_card_is_rejected(name, monkeypatch):
    pretend_cards(2, monkeypatch)
    with pytest.raises(BadRequest, match="does not answer"):
        start_runtime(device=name)


@pytest.mark.parametrize("has_mps", [False, True])
def test_cpu_is_the_default_without_a_card(has_mps, monkeypatch):
    pretend_cards(0, monkeypatch)
    monkeypatch.setattr(torch.backends.mps, "is_available", lambda: has_mps)
    assert find_device(None) == find_device("cpu") == torch.device("cpu")


@pytest.mark.skipif(torch.backends.mps.is_available(), reason="it answers")
def test_mps_is_listed_as_untested_and_tried(monkeypatch):
    pretend_cards(0, monkeypatch)
    monkeypatch.setattr(torch.backends.mps, "is_available", lambda: True)
    with pytest.raises(BadRequest, match="There is no device") as raised:
        find_device("gpu")
    assert "can be used: cpu, mps (untested)." in raised.value.hint
    with pytest.raises(BadRequest, match="Device 'mps' does not answer"):
        find_device("mps")


@pytest.mark.parametrize("name", ["gpu", "mps"])
def test_command_line_reports_missing_devices(learned, capsys, name):
    assert main(["palette", str(learned.project), "--device", name]) == BadRequest.exit_code
    printed = capsys.readouterr().err
    assert "Internal error" not in printed and "can be used: cpu" in printed


@pytest.fixture
def two_cores():
    cores.set_core_count(2)
    yield
    cores.set_core_count(1)


@pytest.mark.parametrize("torch_is_limited", [False, True])
def test_parallel_for_visits_every_number_once(two_cores, torch_is_limited):
    visits, threads = [0] * 37, set()

    def visit(first, last):
        threads.add(threading.current_thread())
        for number in range(first, last):
            visits[number] += 1

    if torch_is_limited:
        cores.limit_torch_threads()
    assert (cores.core_count(), torch.get_num_threads()) == (2, 1 if torch_is_limited else 2)
    cores.parallel_for(visit, len(visits))
    assert visits == [1] * 37
    assert (threads != {threading.current_thread()}) == torch_is_limited


def test_nested_parallel_for_finishes_and_raises_errors(two_cores):
    found, states = [], set()

    def part(first, last):
        cores.parallel_for(lambda a, b: found.extend(range(a, b)), last - first)
        states.add((torch.get_num_threads(), torch.is_grad_enabled(), float(torch.tensor([1e-40]) * 1.0)))

    cores.limit_torch_threads()
    cores.parallel_for(part, 16)
    assert len(found) == 16 and states == {(1, False, 0.0)}
    with pytest.raises(ZeroDivisionError):
        cores.parallel_for(lambda first, last: 1 // 0, 8)


# most points lie at z = 0, which makes SciPy split them at the least denormal number
TREE_OF_FLAT_POINTS = """
import numpy as np, torch
from karf_engine.compute.neighbors import build_kd_tree
torch.set_flush_denormal(True)
flat = np.random.default_rng(0).random((2000, 3))
flat[:1500, 2] = 0
print(build_kd_tree(flat).query(flat[0] + 1e-9)[1])
"""


def test_points_in_a_plane_have_a_kd_tree():
    """In a child process, which a failure would crash."""
    command = [sys.executable, "-c", TREE_OF_FLAT_POINTS]
    child = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert (child.returncode, child.stdout.strip()) == (0, "0"), child.stderr[-500:]


@pytest.mark.parametrize("is_flushing", [True, False])
def test_building_a_kd_tree_keeps_the_denormal_mode(is_flushing):
    torch.set_flush_denormal(is_flushing)
    try:
        build_kd_tree(np.eye(3))
        with pytest.raises(ValueError, match="finite"):
            build_kd_tree(np.full((3, 2), np.nan))
        assert (math.ulp(0.0) * 1.0 == 0.0) == is_flushing
    finally:
        torch.set_flush_denormal(False)


N = 200
# a positive definite chain, which needs N iterations to pass a value from end to end
CHAIN = sparse.csr_array(sparse.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(N, N)))


def solve_photo(iterations):
    found = sparse_systems.solve(CHAIN, np.eye(N)[0], np.zeros(N), iterations=iterations)
    return np.linalg.norm(CHAIN @ found - np.eye(N)[0])


def solve_points(iterations, monkeypatch):
    monkeypatch.setattr(label_propagation, "MAX_STEPS", iterations)
    start, right = np.zeros((N, 1)), np.eye(N)[:, :1]
    label_propagation.conjugate_gradients(lambda x: CHAIN @ x, np.full(N, 2.0), right, start)


def test_unsolved_system_warns_with_residual_and_iterations(monkeypatch):
    with pytest.warns(NotConverged, match=r"after 5 iterations a relative residual of [0-9.]+e"):
        solve_photo(5)
    with pytest.warns(NotConverged, match="after 5 iterations"):
        solve_points(5, monkeypatch)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert solve_photo(2 * N) <= sparse_systems.TOLERANCE
        solve_points(2 * N, monkeypatch)


def test_stage_emits_only_the_worst_residual_and_keeps_other_warnings():
    events = []
    with pytest.warns(UserWarning, match="something else"), convergence_as_event(lambda *a, **k: events.append((a, k))):
        warn_not_converged(5, 0.02, 1e-3)
        warn_not_converged(5, 0.25, 1e-3)
        warnings.warn("something else", UserWarning, stacklevel=1)
    (((name,), event),) = events
    assert (name, event["code"]) == ("warning", "convergence") and "2.5e-01" in event["sentence"]
