"""Translation of sentences with values, and long texts in panels; Blender itself translates labels and tooltips.

Errors and warnings are raised in English, as messages that keep key and values until they are translated for display.
"""

import textwrap
from dataclasses import dataclass, field

from bpy.app.translations import pgettext_iface, pgettext_rpt

from .. import session
from ..engine_api import KarfError, Message

MOST_KEPT = 256
WIDE = "\u2e7f"  # letters after this one are twice as wide
SIDEBAR = 34  # letters that fit the sidebar's usual width


@dataclass
class KeptMessages:
    by_text: dict[str, Message] = field(default_factory=dict)  # English, for properties that only store text


def translatable(text: str) -> str:
    """Mark a text for translation; it is displayed elsewhere."""
    return text


def translate(text: str, **values: object) -> str:
    """Translate a text of the interface and insert its values."""
    translated = pgettext_iface(text)
    return translated.format(**values) if values else translated


def translate_report(text: str, **values: object) -> str:
    """Translate a report and insert its values."""
    return pgettext_rpt(text).format(**values)


def kept(message: str) -> str:
    """Return a message for a property, which stores only its English text, and remember the rest."""
    if isinstance(message, Message):
        kept_messages = session.get(KeptMessages).by_text
        kept_messages.pop(str(message), None)
        kept_messages[str(message)] = message
        if len(kept_messages) > MOST_KEPT:
            del kept_messages[next(iter(kept_messages))]
    return message


def translate_message(text: str) -> str:
    """Translate a message or the text of a kept one, and messages among its values; names are never translated."""
    message = text if isinstance(text, Message) else session.get(KeptMessages).by_text.get(text)
    if message is None:
        return translate(text) if text else ""
    values = {
        name: translate_message(each) if isinstance(each, Message) else each for name, each in message.values.items()
    }
    return Message(translate(message.key) if message.key else "", **values)


def translate_error(error: KarfError) -> str:
    """Translate an error and how to solve it."""
    return translate_message(error.message)


def draw_text(layout, text, icon, width=SIDEBAR):
    """Draw a text as labels of at most `width` letters: panels do not break lines. The first label has the icon."""
    column = layout.column(align=True)
    paragraphs = [text] if isinstance(text, Message) else text.splitlines()
    text = "\n".join(map(translate_message, paragraphs))
    if any(letter > WIDE for letter in text):
        width //= 2
    for paragraph in text.splitlines():
        for line in textwrap.wrap(paragraph, width):
            column.label(text=line, icon=icon)
            icon = "BLANK1"
