"""Adam without loading torch's compiler, which takes a second at the first step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch


def _undecorated(method: Callable[..., Any]) -> Callable[..., Any]:
    return getattr(method, "__wrapped__", method)


class Adam(torch.optim.Adam):
    """`torch.optim.Adam` without the decorators that load the compiler. Cannot be compiled itself."""

    step = torch.no_grad()(_undecorated(torch.optim.Adam.step))
    zero_grad = _undecorated(torch.optim.Adam.zero_grad)
    add_param_group = _undecorated(torch.optim.Adam.add_param_group)
    state_dict = _undecorated(torch.optim.Adam.state_dict)
    load_state_dict = _undecorated(torch.optim.Adam.load_state_dict)
