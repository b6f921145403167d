"""What layers and encodings are given: tensors of the right width, numbers and device. A check costs a microsecond."""

import torch
from torch import Tensor

from ..errors import BadRequest
from ..io.arguments import check_number, check_type


def check_vectors(name: str, x: Tensor) -> None:
    """Refuse what is no floating tensor [..., C].

    Raises:
        TypeError: It is no tensor.
        BadRequest: Its numbers are whole, or it has no axis.

    Examples:
        >>> check_vectors("x", torch.arange(3))
        Traceback (most recent call last):
        karf_engine.errors.BadRequest: x is int64 of shape (3,) on cpu. Give floating numbers, [..., C].
    """
    if isinstance(x, Tensor) and x.is_floating_point() and x.ndim:
        return
    check_type("This layer", name, x, Tensor)
    raise BadRequest(f"{name} is {_described(x)}.", "Give floating numbers, [..., C].")


def check_rows(name: str, x: Tensor, width: int, like: Tensor) -> None:
    """Refuse what a layer cannot compute with.

    Args:
        name: The argument's name, for the message.
        x: What was given.
        width: The last axis that is wanted.
        like: A parameter of the layer: its type of numbers and device are wanted.

    Raises:
        TypeError: It is no tensor.
        BadRequest: Its width, numbers or device are others.

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
    """Refuse what a head cannot read.

    Args:
        position_encoding: [..., P].
        features: [..., F].
        direction_encoding: [..., D]; None where D = 0.
        widths: P, D and F.
        like: A parameter of the head.

    Raises:
        TypeError: One is no tensor.
        BadRequest: Its shape, numbers or device are others.

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
    """Refuse a tensor whose axes before the last, or whose device, are not those of the first. Raises BadRequest.

    Examples:
        >>> check_alike("u", torch.zeros(4, 3), torch.zeros(5, 3))
        Traceback (most recent call last):
        karf_engine.errors.BadRequest: u is float32 of shape (4, 3) on cpu, what it joins float32 of shape (5, 3) on cpu. Give as many of both.
    """
    if x.shape[:-1] != first.shape[:-1] or x.device != first.device:
        raise BadRequest(f"{name} is {_described(x)}, what it joins {_described(first)}.", "Give as many of both.")


def check_widths(**widths: int) -> None:
    """Refuse widths below 1, by name. Raises BadRequest.

    Examples:
        >>> check_widths(n_in=3, n_out=0)
        Traceback (most recent call last):
        karf_engine.errors.BadRequest: n_out = 0 is out of range. Allowed: from 1.
    """
    for name, width in widths.items():
        check_number(name, width, 1)


def head_widths(n_position: int, n_direction: int, n_features: int, n_out: int, width: int) -> tuple[int, int, int]:
    """P, D and F of a head, once found possible. Raises BadRequest for a width below 1, or below 0 of D and F.

    Examples:
        >>> head_widths(n_position=33, n_direction=0, n_features=12, n_out=4, width=16)
        (33, 0, 12)
    """
    check_widths(n_position=n_position, n_out=n_out, width=width)
    check_number("n_direction", n_direction, 0)
    check_number("n_features", n_features, 0)
    return n_position, n_direction, n_features


def _described(x: Tensor) -> str:
    return f"{_short(x.dtype)} of shape {tuple(x.shape)} on {x.device}"


def _short(dtype: torch.dtype) -> str:
    return str(dtype).removeprefix("torch.")
