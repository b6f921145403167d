"""Adam: torch's, to the bit, without torch's compiler."""

import subprocess
import sys

import pytest

torch = pytest.importorskip("torch")

from blender_tests.engine.conftest import ROOT
from karf_engine.fields.training.adam import Adam


def _learn(optimizer_of):
    torch.manual_seed(0)
    network = torch.nn.Linear(5, 3)
    groups = [{"params": [network.weight], "lr": 0.1}, {"params": [network.bias]}]
    optimizer, again = (optimizer_of(groups, lr=0.01, betas=(0.9, 0.99)) for _ in range(2))
    for _ in range(4):
        optimizer.zero_grad()
        (network(torch.ones(2, 5)) ** 2).sum().backward()
        optimizer.step()
        again.load_state_dict(optimizer.state_dict())  # as a training that is resumed
        optimizer, again = again, optimizer
    return network


def test_it_learns_the_bits_that_torch_does():
    ours, theirs = _learn(Adam), _learn(torch.optim.Adam)
    assert torch.equal(ours.weight, theirs.weight) and torch.equal(ours.bias, theirs.bias)


def test_its_step_does_not_load_the_compiler():
    code = (
        "import sys, torch; from karf_engine.fields.training.adam import Adam; x = torch.nn.Parameter(torch.ones(2));"
        "adam = Adam([x]); x.sum().backward(); adam.step(); adam.zero_grad(); adam.state_dict();"
        "print('torch._dynamo' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.stdout.strip() == "False", done.stderr
