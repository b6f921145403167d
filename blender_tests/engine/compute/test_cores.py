"""Cores: work is shared out where torch does not have them, and nothing depends on who did which part."""

import threading

import pytest

torch = pytest.importorskip("torch")

from karf_engine.compute import cores


@pytest.fixture(autouse=True)
def one_core_afterwards():
    yield
    cores.use(1)


def test_torch_has_all_cores_until_they_are_taken_from_it():
    cores.use(2)
    assert (cores.count(), torch.get_num_threads()) == (2, 2)
    cores.take_from_torch()
    assert (cores.count(), torch.get_num_threads()) == (2, 1)


@pytest.mark.parametrize("taken", [False, True])
def test_every_number_is_visited_once_and_by_other_threads_only_where_torch_has_let_go(taken):
    visits, threads = [0] * 37, set()

    def visit(first, last):
        threads.add(threading.current_thread())
        for number in range(first, last):
            visits[number] += 1

    cores.use(2)
    if taken:
        cores.take_from_torch()
    cores.share(visit, len(visits))
    assert visits == [1] * 37
    assert (threads != {threading.current_thread()}) == taken


def test_a_part_that_shares_out_itself_does_not_wait_for_ever():
    found = []

    def part(first, last):
        cores.share(lambda a, b: found.extend(range(a, b)), last - first)

    cores.use(2)
    cores.take_from_torch()
    cores.share(part, 16)
    assert len(found) == 16


def test_the_threads_compute_as_a_stage_does():
    states = []

    def look(first, last):
        tiny = torch.tensor([1e-40]) * 1.0
        states.append((torch.get_num_threads(), torch.is_grad_enabled(), float(tiny)))

    cores.use(2)
    cores.take_from_torch()
    cores.share(look, 8)
    assert set(states) == {(1, False, 0.0)}


def test_an_error_of_a_part_is_raised():
    cores.use(2)
    cores.take_from_torch()
    with pytest.raises(ZeroDivisionError):
        cores.share(lambda first, last: 1 // 0, 8)
