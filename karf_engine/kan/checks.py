"""Check the inputs of layers and encodings: widths, dtypes and devices of tensors. A check takes a microsecond."""

from typing import Any

import torch
from torch import Tensor

from ..errors import BadRequest
from ..io.arguments import check_number, check_type


def check_vectors(name: str, x: Any) -> None:
    """Refuse anything but a floating-point tensor [..., C].

    Examples:
        >>> check_vectors("x", torch.arange(3))
        Traceback (most recent call last):
        karf_engine.errors.BadRequest: x is int64 of shape (3,) on cpu. Give floating numbers, [..., C].
    """
    if isinstance(x, Tensor) and x.is_floating_point() and x.ndim:
        return
    check_type("This layer", name, x, Tensor)
    raise BadRequest(f"{name} is {_described(x)}.", "Give floating numbers, [..., C].")


def check_rows(name: str, x: Any, width: int, like: Tensor) -> None:
    """Refuse anything but a tensor [..., width] with the dtype (or under autocast) and device of a parameter `like`.

    Examples:
        >>> check_rows("x", torch.zeros(5, 4), 3, torch.zeros(3))
        Traceback (most recent call last):
        karf_engine.errors.BadRequest: x is float32 of shape (5, 4) on cpu. Give [..., 3] float32 on cpu.
    """
    if isinstance(x, Tensor) and x.shape[-1:] == (width,) and x.device == like.device:
        if x.dtype == like.dtype or (x.is_floating_point() and torch.is_autocast_enabled()):
            return
    check_type("This layer", name, x, Tensor)
    raise BadRequest(f"{name} is {_described(x)}.", f"Give [..., {width}] {_short(like.dtype)} on {like.device}.")


def check_encodings(
    position_encoding: Tensor,
    features: Tensor,
    direction_encoding: Tensor | None,
    widths: tuple[int, int, int],
    like: Tensor,
) -> None:
    """Refuse inputs that a head cannot read.

    Args:
        position_encoding: [..., P].
        features: [..., F].
        direction_encoding: [..., D]; None where D = 0.
        widths: P, D and F.
        like: a parameter of the head.

    Examples:
        >>> check_encodings(torch.zeros(5, 9), torch.zeros(5, 2), None, (9, 0, 3), torch.zeros(1))
        Traceback (most recent call last):
        karf_engine.errors.BadRequest: features is float32 of shape (5, 2) on cpu. Give [..., 3] float32 on cpu.
    """
    check_rows("position_encoding", position_encoding, widths[0], like)
    check_rows("features", features, widths[2], like)
    if widths[1] or direction_encoding is not None:
        check_rows("direction_encoding", direction_encoding, widths[1], like)


def check_alike(name: str, x: Tensor, first: Tensor) -> None:
    """Raise BadRequest for a tensor whose leading axes or device differ from those of the first.

    Examples:
        >>> check_alike("u", torch.zeros(4, 3), torch.zeros(5, 3))
        Traceback (most recent call last):
        karf_engine.errors.BadRequest: u is float32 of shape (4, 3) on cpu, what it joins float32 of shape (5, 3) on cpu. Give as many of both.
    """
    if x.shape[:-1] != first.shape[:-1] or x.device != first.device:
        raise BadRequest(f"{name} is {_described(x)}, what it joins {_described(first)}.", "Give as many of both.")


def head_widths(n_position: int, n_direction: int, n_features: int, n_out: int, width: int) -> tuple[int, int, int]:
    """Check the widths of a head and return P, D and F. Raises BadRequest for D or F below 0, or others below 1.

    Examples:
        >>> head_widths(n_position=33, n_direction=0, n_features=12, n_out=4, width=16)
        (33, 0, 12)
    """
    for name, value in (("n_position", n_position), ("n_out", n_out), ("width", width)):
        check_number(name, value, 1)
    check_number("n_direction", n_direction, 0)
    check_number("n_features", n_features, 0)
    return n_position, n_direction, n_features


def _described(x: Tensor) -> str:
    return f"{_short(x.dtype)} of shape {tuple(x.shape)} on {x.device}"


def _short(dtype: torch.dtype) -> str:
    return str(dtype).removeprefix("torch.")
