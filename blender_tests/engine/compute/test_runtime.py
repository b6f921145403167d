"""Which devices can be asked for, and what is said of the others."""

import pytest

torch = pytest.importorskip("torch")

from karf_engine.cli import main
from karf_engine.compute.runtime import find_device, start_runtime
from karf_engine.errors import BadRequest

UNKNOWN = ("gpu", "cuda", "cuda:0", "cuda:x", "cpu:1", "CPU", "", "xla", "meta", "vulkan", "🏺")


def have_cards(count, monkeypatch):
    """Let the machine say that it has so many cards; whether they answer is another question."""
    monkeypatch.setattr(torch.cuda, "is_available", lambda: count > 0)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: count)


@pytest.mark.parametrize(
    ("name", "cards", "sentence", "known"),
    [
        *((name, 0, f"There is no device {name!r}.", "can be used: cpu.") for name in UNKNOWN),
        ("cuda:2", 2, "There is no device 'cuda:2'.", "cpu, cuda, cuda:0, cuda:1."),
        ("mps", 0, "64-bit", "can be used: cpu."),
        ("mps:0", 0, "64-bit", "can be used: cpu."),
    ],
)
def test_a_missing_device_is_refused_with_the_available_ones(name, cards, sentence, known, monkeypatch):
    have_cards(cards, monkeypatch)
    with pytest.raises(BadRequest) as raised:
        find_device(name)
    assert sentence in raised.value.sentence and known in raised.value.hint


@pytest.mark.skipif(torch.cuda.is_available(), reason="the card answers")
@pytest.mark.parametrize("name", ["cuda:1", None])
def test_an_unresponsive_card_is_refused_in_a_sentence(name, monkeypatch):
    have_cards(2, monkeypatch)
    with pytest.raises(BadRequest, match="does not answer"):
        start_runtime(device=name)


def test_without_a_card_the_default_is_the_cpu(monkeypatch):
    have_cards(0, monkeypatch)
    assert find_device(None) == find_device("cpu") == torch.device("cpu")


@pytest.mark.parametrize("name", ["gpu", "mps"])
def test_the_command_line_says_it_in_a_sentence(learned, capsys, name):
    assert main(["palette", str(learned.project), "--device", name]) == BadRequest.exit_code
    printed = capsys.readouterr().err
    assert "Internal error" not in printed and "can be used: cpu" in printed
