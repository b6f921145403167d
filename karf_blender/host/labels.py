"""Long texts in panels, which do not break lines themselves."""

import textwrap

from ..engine_api import Message
from .words import translate_message

WIDE = "\u2e7f"  # letters after this one are twice as wide
SIDEBAR = 34  # letters that fit the sidebar's usual width


def draw_text(layout, text, icon, width=SIDEBAR):
    """Draw a text as labels of at most `width` letters, one below the other; the first has the icon."""
    column = layout.column(align=True)
    paragraphs = [text] if isinstance(text, Message) else text.splitlines()
    text = "\n".join(map(translate_message, paragraphs))
    if any(letter > WIDE for letter in text):
        width //= 2
    for paragraph in text.splitlines():
        for line in textwrap.wrap(paragraph, width):
            column.label(text=line, icon=icon)
            icon = "BLANK1"
