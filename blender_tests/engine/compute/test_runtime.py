"""Which devices can be asked for, and what is said of the others."""

import pytest

torch = pytest.importorskip("torch")

from karf_engine.cli import main
from karf_engine.compute.runtime import find_device, start_runtime
from karf_engine.errors import BadRequest


@pytest.fixture
def two_cards(monkeypatch):
    """A machine that says it has two cards; whether they answer is another question."""
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)


@pytest.fixture
def no_card(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)


@pytest.mark.parametrize("name", ["gpu", "cuda", "cuda:0", "cuda:x", "cpu:1", "CPU", "", "xla", "meta", "vulkan", "🏺"])
def test_a_device_that_is_not_there_is_refused_with_those_that_are(no_card, name):
    with pytest.raises(BadRequest) as raised:
        find_device(name)
    assert raised.value.sentence == f"There is no device {name!r}."
    assert "can be used: cpu." in raised.value.hint


def test_mps_is_refused_with_the_reason():
    for name in ("mps", "mps:0"):
        with pytest.raises(BadRequest, match="64-bit"):
            find_device(name)


def test_the_cards_that_are_there_are_named(two_cards):
    with pytest.raises(BadRequest) as raised:
        find_device("cuda:2")
    assert "cpu, cuda, cuda:0, cuda:1." in raised.value.hint


@pytest.mark.skipif(torch.cuda.is_available(), reason="the card answers")
def test_a_card_that_does_not_answer_is_refused_in_a_sentence(two_cards):
    for name in ("cuda:1", None):
        with pytest.raises(BadRequest, match="does not answer"):
            start_runtime(device=name)


def test_without_a_card_the_default_is_the_cpu(no_card):
    assert find_device(None) == find_device("cpu") == torch.device("cpu")


@pytest.mark.parametrize("name", ["gpu", "mps"])
def test_the_command_line_says_it_in_a_sentence(learned, capsys, name):
    assert main(["palette", str(learned.project), "--device", name]) == BadRequest.exit_code
    printed = capsys.readouterr().err
    assert "Internal error" not in printed and "can be used: cpu" in printed
