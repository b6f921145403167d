"""Long texts in panels, which break no lines by themselves."""

import textwrap

SIDEBAR = 34  # letters that fit the sidebar's usual width


def draw_text(layout, text, icon, width=SIDEBAR):
    """A text as labels, one below the other, of so many letters at most; the icon stands before the first."""
    column = layout.column(align=True)
    for paragraph in text.splitlines():
        for line in textwrap.wrap(paragraph, width):
            column.label(text=line, icon=icon)
            icon = "BLANK1"
