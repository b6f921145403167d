"""Work in a child process: its messages arrive in order, and its failure or death is told of."""

import os
import time

import pytest

from karf_engine.child import child_messages
from karf_engine.errors import KarfError


def count(send, task):
    for number in range(task):
        send("number", number)
    return "all told"


def fail(send, task):
    raise ValueError(task)


def die(send, task):
    os._exit(task)


def sleep(send, task):
    time.sleep(task)


def test_messages_arrive_in_order_and_the_result_is_last():
    with child_messages("counting", count, 3) as messages:
        told = [message for message in messages if message[0]]
    assert told == [("number", 0), ("number", 1), ("number", 2), ("result", "all told")]


@pytest.mark.parametrize(("work", "task", "words"), [(fail, "no film", "no film"), (die, 7, "exit code 7")])
def test_a_child_that_fails_or_dies_is_told_of(work, task, words):
    with pytest.raises(KarfError, match=words), child_messages("the camera", work, task) as messages:
        list(messages)


def test_leaving_early_ends_the_child():
    start = time.monotonic()
    with child_messages("sleeping", sleep, 600) as messages:
        assert next(messages)[0] == ""
    assert time.monotonic() - start < 60
