"""Words that Blender translates: what it does not see by itself is marked or asked for here.

Labels, names and tooltips are translated where they are shown. Sentences with values in them are put together here,
after their translation. Sentences of errors and warnings stay English where they are raised, as in logs and reports to
developers, and as the engine says them; as messages they know their keys and values, and are translated where they are
shown. `tools/translations.py` collects all of them from the sources.
"""

from dataclasses import dataclass, field

from bpy.app.translations import pgettext_iface, pgettext_rpt

from .. import session
from ..engine_api import KarfError, Message

MOST_KEPT = 256


@dataclass
class KeptMessages:
    """The messages of which properties hold the English text."""

    by_text: dict[str, Message] = field(default_factory=dict)


def translatable(text: str) -> str:
    """A text as it is, marked as one that is shown, and translated, elsewhere."""
    return text


def translate(text: str, **values: object) -> str:
    """A text of the interface in the user's language, with its values in their places."""
    translated = pgettext_iface(text)
    return translated.format(**values) if values else translated


def translate_report(text: str, **values: object) -> str:
    """The same for a report."""
    return pgettext_rpt(text).format(**values)


def kept(message: str) -> str:
    """A message that a property is going to hold, which holds its English text alone: the rest is remembered here."""
    if isinstance(message, Message):
        kept_messages = session.get(KeptMessages).by_text
        kept_messages.pop(str(message), None)
        kept_messages[str(message)] = message
        if len(kept_messages) > MOST_KEPT:
            del kept_messages[next(iter(kept_messages))]
    return message


def translate_message(text: str) -> str:
    """A message, or the text of one that was kept, in the user's language.

    What no table has stays as it is. Values may be messages too; names are never translated.
    """
    message = text if isinstance(text, Message) else session.get(KeptMessages).by_text.get(text)
    if message is None:
        return translate(text) if text else ""
    values = {
        name: translate_message(each) if isinstance(each, Message) else each for name, each in message.values.items()
    }
    return Message(translate(message.key) if message.key else "", **values)


def translate_error(error: KarfError) -> str:
    """What went wrong and what can be done about it, in the user's language."""
    return translate_message(error.message)
