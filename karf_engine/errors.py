"""Translatable messages, and the exceptions whose sentence and remedy are shown to users."""

from __future__ import annotations

import errno
import re
import sys
from typing import Any

INSTALL_NAMES = {
    "PIL": "pillow",
    "pillow_heif": "pillow-heif",
    "cv2": "opencv-python-headless",
}  # pip names that differ from import names
MAX_MESSAGE_LENGTH = 1500  # characters of a message, or of one value in it
PLACE = re.compile(r"\{(\w+)((?:![rs])?)((?::[^{}]*)?)\}")  # placeholder in a template: name, conversion, format
# torch on the CPU, OpenCV and C++ libraries raise generic classes when memory runs out
MEMORY_MESSAGES = (
    "out of memory",
    "allocate memory",
    "unable to allocate",
    "insufficient memory",
    "not enough memory",
    "bad_alloc",
    "storage size calculation overflowed",
    "larger than the maximum possible size",
    "failed to map segment from shared object",  # the dynamic linker
    "`pillow` plugin is not installed",  # imageio, where importing it runs out of memory
)
CONVERSIONS = {"": lambda value: value, "!r": repr, "!s": str}


class Message(str):
    """An English sentence that keeps its template and values, so that it can be translated.

    Placeholders are `{name}`, `{name!r}` or `{name:.1f}`; braces around any other name stay in the text.

    Examples:
        >>> message = Message("{path} has {share:.0%} of {name!r}.", path="a.png", share=0.25, name="pot")
        >>> message.key, message.values
        ('{path} has {share} of {name}.', {'path': 'a.png', 'share': '25%', 'name': "'pot'"})
    """

    key: str  # the template with plain placeholders, the key of translation tables
    values: dict[str, str]  # formatted values by placeholder; nested messages stay messages

    def __new__(cls, template: str, /, **values: Any) -> Message:
        texts = {name: text for place in PLACE.finditer(template) for name, text in _formatted(place, values)}
        message = super().__new__(cls, PLACE.sub(lambda place: texts.get(place[1], place[0]), template))
        message.key = PLACE.sub(lambda place: f"{{{place[1]}}}" if place[1] in texts else place[0], template)
        message.values = texts
        return message

    def to_json(self) -> dict[str, Any]:
        """Return key and values as JSON values, for `from_json` in another process."""
        values = {name: text.to_json() if isinstance(text, Message) else text for name, text in self.values.items()}
        return {"key": self.key, "values": values}

    @classmethod
    def from_json(cls, content: Any) -> Message:
        """Rebuild a message from `to_json`. Raises ValueError where the content is not a message."""
        key, values = (content.get("key"), content.get("values")) if isinstance(content, dict) else (None, None)
        if not isinstance(key, str) or not isinstance(values, dict):
            raise ValueError("not a message: a key and values were expected")
        return cls(
            key, **{name: cls.from_json(each) if isinstance(each, dict) else each for name, each in values.items()}
        )


def _formatted(place: re.Match[str], values: dict[str, Any]) -> list[tuple[str, str]]:
    """Return [(name, text)] for a placeholder; [] if no value has its name."""
    name, conversion, form = place.groups()
    if name not in values:
        return []
    value = values[name]
    if isinstance(value, Message) and not conversion and not form:
        return [(name, value)]
    return [(name, _cut(format(CONVERSIONS[conversion](value), form[1:])))]


def _cut(text: str) -> str:
    return text if len(text) <= MAX_MESSAGE_LENGTH else f"{text[:MAX_MESSAGE_LENGTH]} ..."


class KarfError(Exception):
    """Base class of all errors that a user can act on.

    Args:
        sentence: Template of the problem, see `Message`; names the file and the value.
        hint: Template of the remedy.
        **values: Values of both templates.

    Example:
        try:
            learn("garden", "masks", project="garden_karf")
        except KarfError as error:
            print(error.sentence, error.hint)
    """

    code = "internal"  # stable identifier of the class
    exit_code = 70  # of a process that ends with this error

    def __init__(self, sentence: str, hint: str = "", /, **values: Any) -> None:
        for name, text in (("sentence", sentence), ("hint", hint)):
            if not isinstance(text, str):
                raise TypeError(f"{type(self).__name__} takes a text as {name}, not {text!r:.80}.")
        self.sentence, self.hint = (
            text if isinstance(text, Message) else Message(_cut(text), **values) for text in (sentence, hint)
        )
        super().__init__(str(self.message))

    @property
    def message(self) -> Message:
        """Sentence and hint in one message."""
        return Message("{sentence} {hint}", sentence=self.sentence, hint=self.hint) if self.hint else self.sentence


class BadRequest(KarfError):
    """The command or request is wrong: unknown option, value out of range, stage called too early."""

    code = "request"
    exit_code = 2


class MissingDependency(KarfError):
    """A package or file that the engine needs is not installed."""

    code = "dependency"
    exit_code = 3


class DataError(KarfError):
    """A capture, mask, project or edit file is missing, damaged, contradicts another, or cannot be read or written."""

    code = "data"
    exit_code = 4


class OutOfMemory(KarfError):
    """The device ran out of memory even with the smallest batch."""

    code = "memory"
    exit_code = 5


class Cancelled(KarfError):
    """The user asked to stop; the last good state is kept."""

    code = "cancelled"
    exit_code = 6


class Diverged(KarfError):
    """Training produced a value that is not finite."""

    code = "diverged"
    exit_code = 7


ERROR_CLASSES = (BadRequest, MissingDependency, DataError, OutOfMemory, Cancelled, Diverged)


def error_from_code(code: str, sentence: str, hint: str = "") -> KarfError:
    """Rebuild an error from its code, for example one sent by another process."""
    for error_class in ERROR_CLASSES:
        if error_class.code == code:
            return error_class(sentence, hint)
    return KarfError(sentence, hint)


def is_out_of_memory(error: BaseException) -> bool:
    """Test whether an error reports a failed allocation, on any device and by any library."""
    if isinstance(error, KarfError):
        return isinstance(error, OutOfMemory)
    if isinstance(error, MemoryError) or type(error).__name__ == "OutOfMemoryError":
        return True
    if getattr(error, "errno", None) == errno.ENOMEM or any(word in str(error).lower() for word in MEMORY_MESSAGES):
        return True
    # packages wrap the failure to load a shared library in errors without a common class
    before = error.__cause__ or error.__context__
    return isinstance(error, ImportError | OSError) and before is not None and is_out_of_memory(before)


def missing_package(name: str) -> MissingDependency:
    """Return the error for a missing package, given its import name."""
    return MissingDependency(
        "The engine's Python ({executable}) has no package {name!r}.",
        "Install it there: {executable} -m pip install {package}",
        executable=sys.executable,
        name=name,
        package=INSTALL_NAMES.get(name, name),
    )


def missing_extra(name: str, extra: str) -> MissingDependency:
    """Return the error for a missing package (import name) that belongs to an extra of pyproject.toml."""
    return MissingDependency(
        "The engine's Python ({executable}) has no package {name!r}.",
        'Install the extra there: {executable} -m pip install "karf[{extra}]"',
        executable=sys.executable,
        name=name,
        extra=extra,
    )
