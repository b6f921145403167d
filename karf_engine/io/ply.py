"""Read and write PLY files (G. Turk, "The PLY Polygon File Format"), text and binary, with numpy only.

Reads headers and elements without list properties.
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
WORDS = {kind: word for word, kind in reversed(TYPES.items())}  # the older type names, which every program knows
ORDERS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
END = re.compile(rb"^end_header[ \t]*\r?\n", re.MULTILINE)
MOST_HEADER = 1 << 20  # bytes
SPACE = re.compile(rb"\s")
BLOCK = 1 << 16  # bytes of text split at a time; the words take ten times the memory


@dataclass(frozen=True)
class Element:
    """An element of a PLY file: a table.

    Attributes:
        name: For example vertex.
        count: Number of rows.
        dtype: Type of a row; None if it has list properties.
        end: Offset in the header behind the line of its last property, bytes.
    """

    name: str
    count: int
    dtype: np.dtype | None
    end: int


@dataclass(frozen=True)
class Header:
    """The header of a PLY file.

    Attributes:
        encoding: A key of `ORDERS`.
        elements: Elements in file order.
        comments: Text of the comments.
        size: Bytes, including the line end_header.
    """

    encoding: str
    elements: tuple[Element, ...]
    comments: tuple[str, ...]
    size: int

    def element(self, name: str) -> Element | None:
        """Return the element of this name, or None."""
        return next((element for element in self.elements if element.name == name), None)


def read_header(data: bytes) -> Header:
    """Parse the header at the start of a PLY file. Raises ValueError if the header is damaged."""
    end = END.search(data[:MOST_HEADER])
    if end is None:
        raise ValueError("it has no line end_header")
    lines = data[: end.start()].splitlines(keepends=True)
    if not lines or lines[0].split() != [b"ply"]:
        raise ValueError("it does not begin with ply")
    encoding, comments, elements, position = "", [], [], len(lines[0])
    for line in lines[1:]:
        position += len(line)
        word, _, rest = line.decode("utf-8", "replace").strip().partition(" ")
        if word == "format":
            encoding = rest.split()[0]
        elif word == "comment":
            comments.append(rest)
        elif word == "element":
            name, count = rest.split()
            elements.append((name, _count(count), [], [position]))
        elif word == "property":
            *_, fields, ends = elements[-1]
            fields.append(rest.split())
            ends.append(position)
    order = ORDERS[encoding]
    parsed = (Element(name, count, _dtype(fields, order), ends[-1]) for name, count, fields, ends in elements)
    return Header(encoding, tuple(parsed), tuple(comments), end.end())


def _count(word: str) -> int:
    if not re.fullmatch("[0-9]{1,19}", word):
        raise ValueError(f"an element has {word[:20]} rows")
    return int(word)


def _dtype(fields: list[list[str]], order: str) -> np.dtype | None:
    if any(kind == "list" for kind, *_ in fields):
        return None
    return np.dtype([(name, order + TYPES[kind]) for kind, name in fields])


def read_rows(data: bytes, header: Header, name: str) -> np.ndarray:
    """Return the rows [count] of one element; neither it nor those before it may have lists.

    Binary data are not copied. Raises ValueError if the file is cut off, or its text is not numeric.
    """
    element, start = find_element(header, name)
    dtype = element.dtype
    assert dtype is not None
    if header.encoding == "ascii":
        return _text_rows(data, header.size, element.count, dtype, start)
    body = len(data) - header.size
    if body < start + element.count * dtype.itemsize:
        raise ValueError(f"it is cut off: {element.count} rows do not fit into its {body} bytes")
    return np.frombuffer(data, dtype, element.count, header.size + start)


def find_element(header: Header, name: str) -> tuple[Element, int]:
    """Return an element without lists, and its offset behind the header: bytes, or numbers in a text file.

    Raises:
        ValueError: There is no such element, or elements before it have lists.
    """
    start = 0
    for element in header.elements:
        if element.dtype is None:
            break
        if element.name == name:
            return element, start
        size = len(element.dtype.names or ()) if header.encoding == "ascii" else element.dtype.itemsize
        start += element.count * size
    raise ValueError(f"it has no element {name} without lists")


def _text_rows(data: bytes, offset: int, count: int, dtype: np.dtype, start: int) -> np.ndarray:
    """Return rows that follow `start` numbers in the text at `offset`."""
    names = dtype.names or ()
    end, n_words, parts = start + count * len(names), 0, []
    for words in _words(data, offset):
        if n_words >= end:
            break
        parts.append(_numbers(words[max(0, start - n_words) : end - n_words]))
        n_words += len(words)
    if n_words < end:
        raise ValueError(f"it is cut off: {count} rows do not fit into its {n_words} numbers")
    numbers = np.concatenate([*parts, np.empty(0)]).reshape(count, len(names))
    table = np.empty(count, dtype)
    with np.errstate(invalid="ignore", over="ignore"):  # nan or out of range in integer columns
        for name, column in zip(names, numbers.T, strict=True):
            table[name] = column
    return table


def _words(data: bytes, offset: int) -> Iterator[list[bytes]]:
    """Split text from an offset on into words, block by block."""
    while offset < len(data):
        space = SPACE.search(data, offset + BLOCK)
        end = space.start() if space else len(data)
        yield data[offset:end].split()
        offset = end


def _numbers(words: list[bytes]) -> np.ndarray:
    try:
        return np.array(words, np.float64)
    except ValueError as error:
        raise ValueError("its rows are not numbers") from error


def property_lines(dtype: np.dtype) -> list[str]:
    """Return the property lines of a dtype's fields.

    Raises:
        ValueError: A field's type is not a PLY type.

    Examples:
        >>> property_lines(np.dtype([("x", "<f4"), ("red", "u1")]))
        ['property float x', 'property uchar red']
    """
    kinds = {name: dtype[name].str[1:] for name in dtype.names or ()}
    unknown = sorted(set(kinds.values()) - set(WORDS))
    if unknown:
        raise ValueError(f"PLY has no type {' '.join(unknown)}")
    return [f"property {WORDS[kind]} {name}" for name, kind in kinds.items()]


def encode_vertices(table: np.ndarray, comments: tuple[str, ...] = ()) -> bytes:
    """Encode a binary little-endian PLY file of vertices, [n] of a little-endian dtype with PLY types."""
    notes = [f"comment {comment}" for comment in comments]
    start = ["ply", "format binary_little_endian 1.0", *notes, f"element vertex {len(table)}"]
    return "\n".join([*start, *property_lines(table.dtype), "end_header", ""]).encode() + table.tobytes()
