"""The pretend device catches what a graphics card would refuse, and computes what the CPU computes."""

import pytest

torch = pytest.importorskip("torch")
PRETEND = "blender_tests.engine.pretend_device"
pytest.importorskip(PRETEND, reason="this torch has no device made of Python alone", exc_type=ImportError)

from blender_tests.engine.pretend_device import NAME, WrongDevice, pretend_device


@pytest.fixture
def x():
    with pretend_device() as device:
        yield torch.ones(4, 3, device=device)


MIXTURES = {
    "a sum": lambda x: x + torch.ones(4, 3),
    "a product of matrices": lambda x: x @ torch.ones(3, 2),
    "an index": lambda x: x[torch.tensor([0, 1])],
    "a mask": lambda x: x[torch.ones(4, dtype=torch.bool)],
    "an index that is written to": lambda x: x.index_put_((torch.tensor([0]),), torch.zeros(1, 3, device=NAME)),
    "a join": lambda x: torch.cat([x, torch.zeros(1, 3)]),
    "a stack with one number": lambda x: torch.stack([x.sum(), torch.tensor(0.0)]),
    "a choice": lambda x: torch.where(x > 0, x, torch.zeros(4, 3)),
    "a search": lambda x: torch.searchsorted(x, torch.zeros(4, 1)),
    "a layer": lambda x: torch.nn.Linear(3, 2)(x),
    "an output": lambda x: torch.mul(x, x, out=torch.empty(4, 3)),
    "a scatter": lambda x: torch.zeros(4, 3).index_add(0, torch.arange(4, device=NAME), x),
    "a generator of the CPU": lambda x: torch.rand(3, generator=torch.Generator(), device=NAME),
    "a generator of its own for the CPU": lambda x: torch.randn(3, generator=torch.Generator(device=NAME)),
    "whole numbers": lambda x: torch.randint(3, (2,), generator=torch.Generator(), device=NAME),
}


@pytest.mark.parametrize("mixture", MIXTURES.values(), ids=MIXTURES)
def test_tensors_and_generators_of_both_devices_do_not_mix(x, mixture):
    with pytest.raises(WrongDevice, match=r"of the CPU and of another device|generator"):
        mixture(x)
    with pytest.raises((RuntimeError, TypeError)):
        x.numpy()


def test_values_can_be_copied_between_devices(x):
    x = torch.zeros_like(x[0])
    assert x.device.type == NAME and (x + torch.tensor(2.0)).sum() == 6  # one number of the CPU, as on a real device
    x.copy_(torch.ones(3))
    x[0:1] = torch.full((1,), 5.0)
    assert x.cpu().device.type == "cpu" and x.tolist() == x.cpu().numpy().tolist() == [5, 1, 1]
    assert torch.ones(2).to(x).device == torch.tensor([1, 2], device=NAME).device == x.device
    assert x[[0, 2]].tolist() == [5, 1]
    own, other = torch.Generator(device=NAME).manual_seed(3), torch.Generator().manual_seed(3)
    assert torch.rand(2, generator=own, device=NAME).tolist() == torch.rand(2, generator=other).tolist()


def test_learning_gives_what_it_gives_on_the_cpu(x):
    def learned(device):
        torch.manual_seed(0)
        network = torch.nn.Sequential(torch.nn.Linear(3, 8), torch.nn.ReLU(), torch.nn.Linear(8, 1)).to(device)
        optimizer = torch.optim.Adam(network.parameters(), fused=True)
        x = torch.randn(16, 3).to(device)
        for _ in range(3):
            optimizer.zero_grad()
            (network(x[x[:, 0] > 0]) ** 2).mean().backward()
            optimizer.step()
        return [parameter.cpu() for parameter in network.parameters()]

    assert all(torch.equal(a, b) for a, b in zip(learned(NAME), learned("cpu"), strict=True))
