"""Words that Blender translates: what it does not see by itself is marked or asked for here.

Labels, names and tooltips are translated where they are shown. Sentences with values in them are put together here,
after their translation. `tools/translations.py` collects both from the sources.
"""

from bpy.app.translations import pgettext_iface, pgettext_rpt


def shown(text: str) -> str:
    """A text as it is, marked as one that is shown, and translated, elsewhere."""
    return text


def say(text: str, **values: object) -> str:
    """A text of the interface in the user's language, with its values in their places."""
    translated = pgettext_iface(text)
    return translated.format(**values) if values else translated


def tell(text: str, **values: object) -> str:
    """The same for a report."""
    return pgettext_rpt(text).format(**values)
