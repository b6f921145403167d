"""Cores: work is shared out where torch does not have them, and nothing depends on who did which part."""

import threading

import pytest

torch = pytest.importorskip("torch")

from karf_engine.compute import cores


@pytest.fixture
def two_cores():
    cores.set_core_count(2)
    yield
    cores.set_core_count(1)


@pytest.mark.parametrize("taken", [False, True])
def test_every_number_is_visited_once(two_cores, taken):
    visits, threads = [0] * 37, set()

    def visit(first, last):
        threads.add(threading.current_thread())
        for number in range(first, last):
            visits[number] += 1

    if taken:
        cores.limit_torch_threads()
    assert (cores.core_count(), torch.get_num_threads()) == (2, 1 if taken else 2)
    cores.parallel_for(visit, len(visits))
    assert visits == [1] * 37
    assert (threads != {threading.current_thread()}) == taken


def test_nested_parts_finish_and_errors_are_raised(two_cores):
    found, states = [], set()

    def part(first, last):
        cores.parallel_for(lambda a, b: found.extend(range(a, b)), last - first)
        states.add((torch.get_num_threads(), torch.is_grad_enabled(), float(torch.tensor([1e-40]) * 1.0)))

    cores.limit_torch_threads()
    cores.parallel_for(part, 16)
    assert len(found) == 16 and states == {(1, False, 0.0)}
    with pytest.raises(ZeroDivisionError):
        cores.parallel_for(lambda first, last: 1 // 0, 8)
