"""The reference of commands is what their options say."""

import pytest

pytest.importorskip("numpy")

from tools import reference


def test_the_page_is_what_the_options_say():
    assert reference.PAGE.read_text(encoding="utf-8") == reference.page(), "run python -m tools.reference"


def test_every_command_and_option_is_on_it():
    text = reference.page()
    for kind in reference.COMMANDS.values():
        section = text.split(f"## {kind.command}\n")[1].split("\n## ")[0]
        names = set(kind.__dataclass_fields__) - set(reference.Options.__dataclass_fields__)
        assert all(f"`{name}`" in section for name in names), kind
