"""Cores: work is shared out where torch does not have them, and nothing depends on who did which part."""

import threading

import pytest

torch = pytest.importorskip("torch")

from karf_engine.compute import cores


@pytest.fixture(autouse=True)
def one_core_afterwards():
    yield
    cores.set_core_count(1)


def test_torch_has_all_cores_until_they_are_taken_from_it():
    cores.set_core_count(2)
    assert (cores.core_count(), torch.get_num_threads()) == (2, 2)
    cores.limit_torch_threads()
    assert (cores.core_count(), torch.get_num_threads()) == (2, 1)


@pytest.mark.parametrize("taken", [False, True])
def test_every_number_is_visited_once_and_by_other_threads_only_where_torch_has_let_go(taken):
    visits, threads = [0] * 37, set()

    def visit(first, last):
        threads.add(threading.current_thread())
        for number in range(first, last):
            visits[number] += 1

    cores.set_core_count(2)
    if taken:
        cores.limit_torch_threads()
    cores.parallel_for(visit, len(visits))
    assert visits == [1] * 37
    assert (threads != {threading.current_thread()}) == taken


def test_a_part_that_shares_out_itself_does_not_wait_for_ever():
    found = []

    def part(first, last):
        cores.parallel_for(lambda a, b: found.extend(range(a, b)), last - first)

    cores.set_core_count(2)
    cores.limit_torch_threads()
    cores.parallel_for(part, 16)
    assert len(found) == 16


def test_the_threads_compute_as_a_stage_does():
    states = []

    def look(first, last):
        tiny = torch.tensor([1e-40]) * 1.0
        states.append((torch.get_num_threads(), torch.is_grad_enabled(), float(tiny)))

    cores.set_core_count(2)
    cores.limit_torch_threads()
    cores.parallel_for(look, 8)
    assert set(states) == {(1, False, 0.0)}


def test_an_error_of_a_part_is_raised():
    cores.set_core_count(2)
    cores.limit_torch_threads()
    with pytest.raises(ZeroDivisionError):
        cores.parallel_for(lambda first, last: 1 // 0, 8)
