"""Torch's Adam without the second that its first step takes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch

Method = Callable[..., Any]


def _plain(method: Method) -> Method:
    """A method of torch's optimizers as it was written: what wraps it loads torch's compiler at the first call."""
    return getattr(method, "__wrapped__", method)


class Adam(torch.optim.Adam):
    """`torch.optim.Adam`, and nothing else; it cannot be part of what torch compiles."""

    step = torch.no_grad()(_plain(torch.optim.Adam.step))
    zero_grad = _plain(torch.optim.Adam.zero_grad)
    add_param_group = _plain(torch.optim.Adam.add_param_group)
    state_dict = _plain(torch.optim.Adam.state_dict)
    load_state_dict = _plain(torch.optim.Adam.load_state_dict)
