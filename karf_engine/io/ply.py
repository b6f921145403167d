"""Read and write PLY files (G. Turk, "The PLY Polygon File Format"), text and binary, as tables.

An element with list properties is not read, nor is any element behind it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
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
VERTEX_LINE = re.compile(rb"^[ \t]*element[ \t]+vertex\b", re.MULTILINE)
END_OF_ELEMENT = re.compile(rb"^[ \t]*(element[ \t]|end_header)", re.MULTILINE)
MOST_HEADER = 1 << 20  # bytes
SPACE = re.compile(rb"\s")
BLOCK = 1 << 16  # bytes of text split at a time; the words take ten times the memory


@dataclass(frozen=True)
class Header:
    """The header of a PLY file."""

    encoding: str  # a key of ORDERS
    elements: dict[str, tuple[int, np.dtype | None]]  # rows, and the type of a row; None with list properties
    comments: tuple[str, ...]
    size: int  # bytes, including the line end_header


@dataclass(frozen=True)
class Ply:
    """A PLY file in memory. Tables of binary files are views of its data."""

    data: bytes
    header: Header
    tables: dict[str, np.ndarray]  # structured rows of the elements before the first with lists, in file order

    def table(self, name: str) -> np.ndarray:
        """Return the rows of an element. Raises ValueError if there is no such table."""
        if name not in self.tables:
            raise ValueError(f"it has no element {name} without lists")
        return self.tables[name]

    def with_vertices(self, rows: np.ndarray) -> bytes:
        """Return this binary file with other rows of `vertex`, which may have more fields at the end.

        All other bytes stay. Raises ValueError if a new field has a type unknown to PLY.
        """
        names, data, start = list(self.tables), self.data, self.header.size
        before = names[: names.index("vertex")]
        start += sum(self.tables[name].nbytes for name in before)
        old = self.tables["vertex"]
        line = VERTEX_LINE.search(data)
        assert line is not None
        end = next(END_OF_ELEMENT.finditer(data, line.end())).start()
        line_end = "\r\n" if data[:end].endswith(b"\r\n") else "\n"
        lines = "".join(line + line_end for line in _property_lines(rows.dtype)[len(_names(old.dtype)) :]).encode()
        return b"".join((data[:end], lines, data[end:start], rows.tobytes(), data[start + old.nbytes :]))


def read_header(data: bytes) -> Header:
    """Parse the header at the start of a PLY file. Raises ValueError if it is damaged."""
    try:
        return _header(data)
    except (IndexError, KeyError, ValueError) as error:
        raise ValueError(f"its header cannot be understood ({error})") from error


def _header(data: bytes) -> Header:
    end = END.search(data[:MOST_HEADER])
    if end is None:
        raise ValueError("it has no line end_header")
    lines = data[: end.start()].splitlines()
    if not lines or lines[0].split() != [b"ply"]:
        raise ValueError("it does not begin with ply")
    encoding, comments, fields = "", [], []
    counts: dict[str, tuple[int, list[list[str]]]] = {}
    for line in lines[1:]:
        word, _, rest = line.decode("utf-8", "replace").strip().partition(" ")
        if word == "format":
            encoding = rest.split()[0]
        elif word == "comment":
            comments.append(rest)
        elif word == "element":
            name, count = rest.split()
            if not re.fullmatch("[0-9]{1,19}", count):
                raise ValueError(f"an element has {count[:20]} rows")
            if name in counts:
                raise ValueError(f"it has two elements {name}")
            fields = []
            counts[name] = int(count), fields
        elif word == "property":
            fields.append(rest.split())
    order = ORDERS[encoding]
    elements = {name: (count, _dtype(own, order)) for name, (count, own) in counts.items()}
    return Header(encoding, elements, tuple(comments), end.end())


def _dtype(fields: list[list[str]], order: str) -> np.dtype | None:
    if any(kind == "list" for kind, *_ in fields):
        return None
    return np.dtype([(name, order + TYPES[kind]) for kind, name in fields])


def read_ply(data: bytes) -> Ply:
    """Parse a PLY file. Raises ValueError if it is damaged or cut off."""
    header = read_header(data)
    elements: dict[str, tuple[int, np.dtype]] = {}
    for name, (count, dtype) in header.elements.items():
        if dtype is None:
            break
        if dtype.names:
            elements[name] = count, dtype
    read = _text_tables if header.encoding == "ascii" else _binary_tables
    return Ply(data, header, dict(zip(elements, read(data, header.size, [*elements.values()]), strict=True)))


def _binary_tables(data: bytes, start: int, elements: Sequence[tuple[int, np.dtype]]) -> Iterator[np.ndarray]:
    size = len(data) - start
    for count, dtype in elements:
        end = start + count * dtype.itemsize
        if end > len(data):
            raise ValueError(f"it is cut off: {count} rows do not fit into its {size} bytes")
        yield np.frombuffer(data, dtype, count, start)
        start = end


def _text_tables(data: bytes, start: int, elements: Sequence[tuple[int, np.dtype]]) -> Iterator[np.ndarray]:
    numbers = _numbers(data, start, sum(count * len(_names(dtype)) for count, dtype in elements))
    start = 0
    for count, dtype in elements:
        end = start + count * len(_names(dtype))
        if end > len(numbers):
            raise ValueError(f"it is cut off: {count} rows do not fit into its {len(numbers)} numbers")
        table = np.empty(count, dtype)
        with np.errstate(invalid="ignore", over="ignore"):  # nan or out of range in integer columns
            for name, column in zip(_names(dtype), numbers[start:end].reshape(count, -1).T, strict=True):
                table[name] = column
        yield table
        start = end


def _numbers(data: bytes, offset: int, most: int) -> np.ndarray:
    """Return the first `most` numbers of the text at an offset, block by block."""
    found, parts = 0, [np.empty(0)]
    while offset < len(data) and found < most:
        space = SPACE.search(data, offset + BLOCK)
        end = space.start() if space else len(data)
        try:
            parts.append(np.array(data[offset:end].split()[: most - found], np.float64))
        except ValueError as error:
            raise ValueError("its rows are not numbers") from error
        found, offset = found + len(parts[-1]), end
    return np.concatenate(parts)


def _names(dtype: np.dtype) -> tuple[str, ...]:
    return dtype.names or ()


def _property_lines(dtype: np.dtype) -> list[str]:
    kinds = {name: dtype[name].str[1:] for name in _names(dtype)}
    unknown = sorted(set(kinds.values()) - set(WORDS))
    if unknown:
        raise ValueError(f"PLY has no type {' '.join(unknown)}")
    return [f"property {WORDS[kind]} {name}" for name, kind in kinds.items()]


def encode_ply(tables: Mapping[str, np.ndarray], comments: Sequence[str] = ()) -> bytes:
    """Encode a binary little-endian PLY file of elements, structured arrays of little-endian fields by name.

    Raises:
        ValueError: A field's type is not a PLY type.
    """
    lines = ["ply", "format binary_little_endian 1.0", *(f"comment {comment}" for comment in comments)]
    for name, table in tables.items():
        lines += [f"element {name} {len(table)}", *_property_lines(table.dtype)]
    return "\n".join([*lines, "end_header", ""]).encode() + b"".join(table.tobytes() for table in tables.values())
