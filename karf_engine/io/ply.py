"""PLY files: G. Turk, "The PLY Polygon File Format"; headers, tables of numbers as text and binary, without lists.

Own code, since Blender's Python reads these too, with numpy alone, and since a file is to keep what is not understood.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
WORDS = {kind: word for word, kind in reversed(TYPES.items())}  # the older words, which every program knows
ORDERS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
END = re.compile(rb"^end_header[ \t]*\r?\n", re.MULTILINE)
MOST_HEADER = 1 << 20  # bytes
SPACE = re.compile(rb"\s")
BLOCK = 1 << 16  # bytes of text that are taken apart at a time: its words take ten times the room


@dataclass(frozen=True)
class Element:
    """One table of a PLY file.

    Attributes:
        name: Such as vertex.
        count: How many rows it has.
        dtype: Of a row; None where it has lists.
        end: Where the line of its last property ends in the header; bytes.
    """

    name: str
    count: int
    dtype: np.dtype | None
    end: int


@dataclass(frozen=True)
class Header:
    """What stands before a PLY file's tables.

    Attributes:
        encoding: A key of `ORDERS`.
        elements: The tables, in the file's order.
        comments: Text of the comments.
        size: Bytes, with the line end_header.
    """

    encoding: str
    elements: tuple[Element, ...]
    comments: tuple[str, ...]
    size: int

    def element(self, name: str) -> Element | None:
        """The table of this name, if there is one."""
        return next((element for element in self.elements if element.name == name), None)


def read_header(data: bytes) -> Header:
    """The header of a PLY file that begins with these bytes.

    Raises:
        ValueError: It is none; says why.
    """
    end = END.search(data[:MOST_HEADER])
    if end is None:
        raise ValueError("it has no line end_header")
    lines = data[: end.start()].splitlines(keepends=True)
    if not lines or lines[0].split() != [b"ply"]:
        raise ValueError("it does not begin with ply")
    encoding, comments, found, position = "", [], [], len(lines[0])
    for line in lines[1:]:
        position += len(line)
        word, _, rest = line.decode("utf-8", "replace").strip().partition(" ")
        if word == "format":
            encoding = rest.split()[0]
        elif word == "comment":
            comments.append(rest)
        elif word == "element":
            name, count = rest.split()
            found.append((name, _count(count), [], [position]))
        elif word == "property":
            *_, fields, ends = found[-1]
            fields.append(rest.split())
            ends.append(position)
    order = ORDERS[encoding]
    elements = (Element(name, count, _dtype(fields, order), ends[-1]) for name, count, fields, ends in found)
    return Header(encoding, tuple(elements), tuple(comments), end.end())


def _count(word: str) -> int:
    if not re.fullmatch("[0-9]{1,19}", word):
        raise ValueError(f"an element has {word[:20]} rows")
    return int(word)


def _dtype(fields: list[list[str]], order: str) -> np.dtype | None:
    if any(kind == "list" for kind, *_ in fields):
        return None
    return np.dtype([(name, order + TYPES[kind]) for kind, name in fields])


def read_rows(data: bytes, header: Header, name: str) -> np.ndarray:
    """The rows of one table.

    Args:
        data: The whole file.
        header: Its header.
        name: Of the element; it and those before it must have no lists.

    Returns:
        [count] of the element's dtype; a view of the data where that is binary.

    Raises:
        ValueError: The file is cut off, or has text where numbers are wanted.
    """
    element, start = locate(header, name)
    if header.encoding == "ascii":
        return _text_rows(data, header.size, element, start)
    body = len(data) - header.size
    if body < start + element.count * element.dtype.itemsize:
        raise ValueError(f"it is cut off: {element.count} rows do not fit into its {body} bytes")
    return np.frombuffer(data, element.dtype, element.count, header.size + start)


def locate(header: Header, name: str) -> tuple[Element, int]:
    """A table without lists, and where it starts behind the header: bytes, or numbers where the file is text.

    Raises:
        ValueError: There is none, or its place depends on lists before it.
    """
    start = 0
    for element in header.elements:
        if element.dtype is None:
            break
        if element.name == name:
            return element, start
        start += element.count * (len(element.dtype) if header.encoding == "ascii" else element.dtype.itemsize)
    raise ValueError(f"it has no element {name} without lists")


def _text_rows(data: bytes, at: int, element: Element, start: int) -> np.ndarray:
    """The rows of a table that starts behind `start` numbers, in text that starts at a byte."""
    width = len(element.dtype)
    end, found, parts = start + element.count * width, 0, []
    for words in _words(data, at):
        if found >= end:
            break
        parts.append(_numbers(words[max(0, start - found) : end - found]))
        found += len(words)
    if found < end:
        raise ValueError(f"it is cut off: {element.count} rows do not fit into its {found} numbers")
    numbers = np.concatenate([*parts, np.empty(0)]).reshape(element.count, width)
    table = np.empty(element.count, element.dtype)
    with np.errstate(invalid="ignore", over="ignore"):  # nan in place of a whole number
        for name, column in zip(element.dtype.names or (), numbers.T, strict=True):
            table[name] = column
    return table


def _words(data: bytes, at: int) -> Iterator[list[bytes]]:
    """The words of a text from a byte on, some at a time."""
    while at < len(data):
        space = SPACE.search(data, at + BLOCK)
        end = space.start() if space else len(data)
        yield data[at:end].split()
        at = end


def _numbers(words: list[bytes]) -> np.ndarray:
    try:
        return np.array(words, np.float64)
    except ValueError as error:
        raise ValueError("its rows are not numbers") from error


def properties(dtype: np.dtype) -> list[str]:
    """The header's lines of these fields.

    Raises:
        ValueError: PLY has no such type.

    Examples:
        >>> properties(np.dtype([("x", "<f4"), ("red", "u1")]))
        ['property float x', 'property uchar red']
    """
    kinds = {name: dtype[name].str[1:] for name in dtype.names or ()}
    unknown = sorted(set(kinds.values()) - set(WORDS))
    if unknown:
        raise ValueError(f"PLY has no type {' '.join(unknown)}")
    return [f"property {WORDS[kind]} {name}" for name, kind in kinds.items()]


def vertex_file(table: np.ndarray, comments: tuple[str, ...] = ()) -> bytes:
    """A PLY file of vertices, binary, little end first.

    Args:
        table: [n] of a dtype with fields of PLY's types, little end first.
        comments: Text of the header's comments.
    """
    notes = [f"comment {comment}" for comment in comments]
    start = ["ply", "format binary_little_endian 1.0", *notes, f"element vertex {len(table)}"]
    return "\n".join([*start, *properties(table.dtype), "end_header", ""]).encode() + table.tobytes()
