"""The one timer: it calls each function as often as it wants, and ends itself when none wants to be called."""

import pytest


@pytest.fixture
def timer(addon):
    yield addon.timer
    addon.extension.unregister()
    addon.extension.register()


def counted(*seconds):
    """A function that wants to be called again after these seconds, one after the other."""
    wanted = iter(seconds)
    return lambda: next(wanted)


def test_it_waits_as_short_as_one_wants_and_ends_with_the_last(bpy, timer):
    timer.start(counted(0.2, 0.2, None))
    timer.start(counted(0.02, None))
    assert bpy.app.timers.is_registered(timer._tick)
    assert [timer._tick() for _ in range(3)] == [0.02, 0.2, None]


def test_a_function_is_called_once_a_tick_however_often_it_is_started(timer):
    calls = []
    poll = lambda: calls.append(0)  # noqa: E731
    timer.start(poll)
    timer.start(poll)
    assert timer._tick() is None and len(calls) == 1


def test_what_is_started_in_a_tick_is_called_in_the_next(timer):
    later = counted(None)
    timer.start(lambda: timer.start(later))
    assert timer._tick() == timer.FIRST_SECONDS
    assert timer._tick() is None


def test_a_fault_in_one_is_printed_and_stops_no_other(timer, capfd):
    timer.start(lambda: 1 / 0)
    timer.start(counted(0.1, None))
    assert timer._tick() == 0.1
    assert "ZeroDivisionError" in capfd.readouterr().err
    assert timer._tick() is None
