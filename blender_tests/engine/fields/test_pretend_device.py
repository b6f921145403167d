"""The pretend device catches what a graphics card would refuse, and computes what the CPU computes."""

import pytest

torch = pytest.importorskip("torch")
PRETEND = "blender_tests.engine.pretend_device"
pytest.importorskip(PRETEND, reason="this torch has no device made of Python alone", exc_type=ImportError)

from blender_tests.engine.pretend_device import NAME, WrongDevice, pretend_device
from karf_engine.compute.runtime import Runtime


@pytest.fixture
def there():
    with pretend_device() as device:
        yield device


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
}


@pytest.mark.parametrize("mixture", MIXTURES.values(), ids=MIXTURES)
def test_tensors_of_both_devices_do_not_mix(there, mixture):
    with pytest.raises(WrongDevice, match="of the CPU and of another device"):
        mixture(torch.ones(4, 3, device=there))


def test_values_do_not_become_an_array_where_they_are(there):
    x = torch.arange(6.0, device=there).view(2, 3)
    with pytest.raises((RuntimeError, TypeError)):
        x.numpy()
    assert x.cpu().numpy().tolist() == x.tolist() == [[0, 1, 2], [3, 4, 5]]


def test_a_generator_serves_its_own_device(there):
    own, other = torch.Generator(device=there), torch.Generator()
    for draw in (torch.rand, torch.randn):
        with pytest.raises(WrongDevice, match="generator"):
            draw(3, generator=other, device=there)
        with pytest.raises(WrongDevice, match="generator"):
            draw(3, generator=own)
    with pytest.raises(WrongDevice, match="generator"):
        torch.randint(3, (2,), generator=other, device=there)
    runtime = Runtime(there, own.manual_seed(3))
    assert runtime.rand(2).tolist() == torch.rand(2, generator=torch.Generator().manual_seed(3)).tolist()


def test_what_may_cross_does(there):
    x = torch.zeros(3, device=there)
    assert x.device.type == NAME and (x + torch.tensor(2.0)).sum() == 6  # one number of the CPU, as on a real device
    x.copy_(torch.ones(3))
    x[0:1] = torch.full((1,), 5.0)
    assert x.cpu().device.type == "cpu" and x.tolist() == [5, 1, 1]
    assert torch.ones(2).to(x).device == x.device
    assert torch.tensor([1, 2], device=there).device == x.device
    assert x[[0, 2]].tolist() == [5, 1]


def test_learning_gives_what_it_gives_on_the_cpu(there):
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

    assert all(torch.equal(a, b) for a, b in zip(learned(there), learned("cpu"), strict=True))
