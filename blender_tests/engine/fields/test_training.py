"""The training loop follows schedules, reports progress and stops where it should."""

import math
import subprocess
import sys

import pytest
import torch

from blender_tests.engine.conftest import ROOT
from karf_engine.compute.progress import Progress
from karf_engine.compute.runtime import start_runtime
from karf_engine.errors import Cancelled, Diverged, OutOfMemory
from karf_engine.fields.training import Adam, TrainingState, cosine_with_warmup, exponential_with_warmup, train


class Recorder:
    """A parameter pulled to 3, and all that the training loop calls and emits."""

    def __init__(self, stop_after=None, total=10):
        self.value = torch.nn.Parameter(torch.zeros(()))
        self.optimizer = torch.optim.SGD([self.value], lr=0.5)
        self.events, self.calls, self.rates = [], [], []
        self.progress = Progress(
            lambda kind, **values: self.events.append(values),
            lambda: stop_after is not None and len(self.calls) >= stop_after,
            *("test", total),
        )

    def step(self, iteration, scale):
        self.calls.append((iteration, scale))
        self.rates.append(self.optimizer.param_groups[0]["lr"])
        return (self.value - 3) ** 2, {"loss": 1.0}

    def train(self, iterations, step=None, schedule=lambda i, n: 1.0):
        runtime = start_runtime(0, 1, "cpu")
        training_state = TrainingState(iterations, self.optimizer, lambda: {"value": self.value}, runtime)
        train(training_state, iterations, step or self.step, schedule, self.progress)


def test_schedules_warm_up_and_fall_to_their_floor():
    cosine, exponential = cosine_with_warmup(4, 0.1), exponential_with_warmup(10, 0.5, 0.01)
    second = 0.5 * (0.1 + 0.9 * 0.5 * (1 + math.cos(math.pi / 100)))
    assert [cosine(i, 100) for i in (0, 1, 50, 100)] == pytest.approx([0.25, second, 0.55, 0.1])
    found = [exponential(i, 100) for i in (0, 4, 9, 50, 75, 100)]
    assert found == pytest.approx([0.1, 0.5, 1, 1, 0.1, 0.01])


def test_steps_run_in_order_at_the_scheduled_rates():
    record = Recorder()
    record.train(5, schedule=lambda i, n: (i + 1) / n)
    assert record.calls == [(i, 1.0) for i in range(5)]
    assert record.rates == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5])
    assert record.optimizer.param_groups[0]["lr"] == 0.5
    assert abs(record.value.item() - 3) < 0.2


@pytest.mark.parametrize(("first_bad", "noticed"), [(0, 0), (3, 10), (17, 19)])
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_non_finite_loss_stops_training_soon(first_bad, noticed, bad):
    record = Recorder()

    def step(iteration, scale):
        loss, metrics = record.step(iteration, scale)
        return (loss * bad if iteration >= first_bad else loss), metrics

    with pytest.raises(Diverged, match=f"iteration {noticed}: loss"):
        record.train(20, step)
    assert len(record.calls) == noticed + 1


def test_cancelling_stops_training_at_once():
    record = Recorder(stop_after=3)
    with pytest.raises(Cancelled, match="test stage was cancelled"):
        record.train(10)
    assert len(record.calls) == 3


@pytest.mark.parametrize("largest_part", [0.3, 0.0])
def test_iteration_out_of_memory_is_repeated_in_smaller_parts(largest_part):
    record, whole, done = Recorder(total=6), Recorder(), []

    def step(iteration, scale):
        result = record.step(iteration, scale)
        if scale > largest_part:
            raise torch.OutOfMemoryError("no memory left")
        done.append((iteration, scale))
        return result

    if largest_part:
        record.train(6, step)
        assert done == [(iteration, 0.25) for iteration in range(6) for _ in range(4)]
        whole.train(6)  # the same steps without running out of memory
        assert record.value.item() == pytest.approx(whole.value.item())
        assert record.events[-1]["step"] == 6
    else:
        with pytest.raises(OutOfMemory, match="64th of the batch"):
            record.train(6, step)
        assert record.calls[-1][1] == 1 / 64
    assert record.calls[:2] == [(0, 1.0), (0, 0.5)]


@pytest.mark.parametrize("done", [0, 990])
def test_progress_estimates_the_rest_and_reports_the_last_step(done):
    record = Recorder(total=done + 10)
    if done:
        record.progress.resume_at(done)
    record.progress.step()
    first = record.events[0]
    assert (first["stage"], first["step"], first["total"], first["metrics"]) == ("test", done + 1, done + 10, {})
    assert first["eta_s"] == pytest.approx(9 / first["rate"], rel=0.2, abs=0.1)
    record.progress.step(8)
    assert len(record.events) == 1  # at most four events a second
    record.progress.step(loss=0.123456)
    assert record.events[-1]["step"] == done + 10 and record.events[-1]["metrics"] == {"loss": 0.1235}


def test_adam_matches_torch_bit_by_bit():
    networks = []
    for kind in (Adam, torch.optim.Adam):
        torch.manual_seed(0)
        network = torch.nn.Linear(5, 3)
        groups = [{"params": [network.weight], "lr": 0.1}, {"params": [network.bias]}]
        optimizer, resumed = (kind(groups, lr=0.01, betas=(0.9, 0.99)) for _ in range(2))
        for _ in range(4):
            optimizer.zero_grad()
            (network(torch.ones(2, 5)) ** 2).sum().backward()
            optimizer.step()
            resumed.load_state_dict(optimizer.state_dict())
            optimizer, resumed = resumed, optimizer
        networks.append(network)
    ours, theirs = networks
    assert torch.equal(ours.weight, theirs.weight) and torch.equal(ours.bias, theirs.bias)


def test_adam_does_not_load_the_compiler():
    code = (
        "import sys, torch; from karf_engine.fields.training import Adam; x = torch.nn.Parameter(torch.ones(2));"
        "adam = Adam([x]); x.sum().backward(); adam.step(); adam.zero_grad(); adam.state_dict();"
        "print('torch._dynamo' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.stdout.strip() == "False", done.stderr
