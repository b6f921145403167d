"""Long texts in panels, which break no lines by themselves."""

import textwrap

from .words import translate_sentences

WIDE = "\u2e7f"  # letters after this one are twice as wide
SIDEBAR = 34  # letters that fit the sidebar's usual width


def draw_text(layout, text, icon, width=SIDEBAR):
    """A text as labels, one below the other, of at most this many letters; the icon stands before the first."""
    column = layout.column(align=True)
    text = "\n".join(translate_sentences(paragraph) for paragraph in text.splitlines())
    if any(letter > WIDE for letter in text):
        width //= 2
    for paragraph in text.splitlines():
        for line in textwrap.wrap(paragraph, width):
            column.label(text=line, icon=icon)
            icon = "BLANK1"
