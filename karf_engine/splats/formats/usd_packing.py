"""Packed numbers in binary USD files, checked before usd-core unpacks them: it believes their counts and indices.

Format: OpenUSD, pxr/base/tf/fastCompression.cpp: LZ4 (lz4_Block_format.md of lz4/lz4) in one block or, of much, in several.
pxr/usd/sdf/integerCoding.cpp: whole numbers as differences: the commonest of them, two bits for each number that say how
many bytes its own has, these bytes; all packed by LZ4. pxr/usd/sdf/crateFile.cpp: an array of at least 16 floats is packed
as whole numbers, or as indices of a table.
"""

from __future__ import annotations

import struct

import numpy as np

NUMBER, SHORT_NUMBER, BLOCK_SIZE = struct.Struct("<Q"), struct.Struct("<I"), struct.Struct("<i")
SAME, SHORTEST = 15, 4  # LZ4: a length that goes on in further bytes; what a repetition has at least
FEWEST = 16  # numbers; fewer are not packed
INTS, LONG_INTS = (3, 4), (5, 6)  # crateDataTypes.h: signed and unsigned
FLOATS = {7: 2, 8: 4, 9: 8}  # their bytes
WHOLE, TABLE = b"i", b"t"
WIDTHS = 0, 1, 2, 4  # bytes of a difference by its two bits; the last, of the commonest one
LONG_WIDTHS = 0, 2, 4, 8
INDEX = (1 << 32) - 1  # of a table: without a sign
CHUNK = 1 << 20  # numbers that are looked at together, a multiple of 4


def check_array(data: bytes, at: int, count: int, kind: int) -> None:
    """Refuse a packed array that has fewer numbers than it says, or an index outside its table.

    Args:
        data: The file.
        at: Where the array goes on behind its count.
        count: Of its numbers.
        kind: USD's number of their type.

    Raises:
        ValueError: It is refused.
        IndexError: It is cut off, as struct.error.
    """
    if count < FEWEST:
        return
    n_table = None
    if kind in FLOATS:
        coding, at = data[at : at + 1], at + 1
        if coding == TABLE:
            (n_table,) = SHORT_NUMBER.unpack_from(data, at)
            at += SHORT_NUMBER.size + FLOATS[kind] * n_table
        elif coding != WHOLE:
            raise ValueError("it has floats that are packed in an unknown way")
    elif kind not in (*INTS, *LONG_INTS):
        raise ValueError("it has packed values that are no numbers")
    widths = LONG_WIDTHS if kind in LONG_INTS else WIDTHS
    (size,) = NUMBER.unpack_from(data, at)
    at += NUMBER.size
    _check_numbers(unpacked(data[at : at + size], widths[-1] * (1 + count) + -(-count // 4)), count, widths, n_table)


def _check_numbers(packed: bytes, count: int, widths: tuple[int, ...], n_table: int | None) -> None:
    """Follow whole numbers that are stored as differences; n_table: what they must be less than."""
    own_bytes = np.frombuffer(packed, np.uint8)
    commonest = int.from_bytes(packed[: widths[-1]], "little", signed=True)
    at, last = widths[-1] + -(-count // 4), 0
    for start in range(0, count, CHUNK):
        n = min(CHUNK, count - start)
        bits = np.frombuffer(packed, np.uint8, -(-n // 4), widths[-1] + start // 4)
        codes = (bits[:, None] >> np.arange(0, 8, 2) & 3).ravel()[:n]
        ends = at + np.cumsum(np.array(widths)[codes])
        if ends[-1] > len(packed):
            raise ValueError("it has packed numbers that are cut off")
        at = int(ends[-1])
        if n_table is None:
            continue
        differences = np.full(n, commonest, np.int64)
        for code, width in enumerate(widths[1:], 1):
            rows = np.flatnonzero(codes == code)
            places = (ends[rows] - width)[:, None] + np.arange(width)
            differences[rows] = own_bytes[places].view(f"<i{width}")[:, 0]
        numbers = last + np.cumsum(differences)
        if ((numbers & INDEX) >= n_table).any():
            raise ValueError("it has packed numbers that are not in their table")
        last = int(numbers[-1])


def unpacked(packed: bytes, most: int) -> bytes:
    """What fastCompression.cpp has packed into one or several blocks.

    Raises:
        ValueError: It is packed wrongly, or is of more bytes than `most`.
        IndexError: It is cut off, as struct.error.
    """
    n_blocks, result = packed[0], bytearray()
    if n_blocks == 0:
        _unpack_block(packed[1:], result, most)
    at = 1
    for _ in range(n_blocks):
        (length,) = BLOCK_SIZE.unpack_from(packed, at)
        at += BLOCK_SIZE.size
        _unpack_block(packed[at : at + length], result, most)
        at += length
    if len(result) > most:
        raise ValueError("it has more packed bytes than it says")
    return bytes(result)


def _unpack_block(packed: bytes, result: bytearray, most: int) -> None:
    """Append what an LZ4 block holds: sequences of literal bytes and a repetition, the last one without the latter."""
    at, start = 0, len(result)
    while at < len(packed) and len(result) <= most:
        lengths = packed[at]
        n_literal, at = _length(packed, at + 1, lengths >> 4)
        result += packed[at : at + n_literal]
        at += n_literal
        if at >= len(packed):
            return
        back = packed[at] | packed[at + 1] << 8
        n_repeated, at = _length(packed, at + 2, lengths & SAME)
        n_repeated = min(n_repeated + SHORTEST, most + 1 - len(result))
        if n_repeated < 0 or not 0 < back <= len(result) - start:
            raise ValueError("its values are packed wrongly")
        repeated = bytes(result[-back:])
        result += (repeated * (n_repeated // back + 1))[:n_repeated]


def _length(packed: bytes, at: int, length: int) -> tuple[int, int]:
    """A length of 4 bits with the bytes that go on with it, and where these end."""
    if length < SAME:
        return length, at
    while packed[at] == 255:
        length, at = length + 255, at + 1
    return length + packed[at], at + 1
