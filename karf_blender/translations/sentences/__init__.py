"""Sentences of errors and warnings in other languages, of the extension and the commonest of the engine.

They come put together, so they are known by their fixed parts: {0}, {1} .. in a key stand for values of any letters.
"""

import re

from . import zh_hans

# languages by Blender's own names
TABLES = {"zh_HANS": zh_hans.TEXTS}


def _pattern(template: str) -> re.Pattern[str]:
    fixed = re.split(r"\{\d\}", template)
    return re.compile("(.+)".join(map(re.escape, fixed)), re.DOTALL)


# the one with the most fixed letters first: it says the most
PATTERNS = {
    template: _pattern(template)
    for template in sorted({text for table in TABLES.values() for text in table}, key=len, reverse=True)
}
