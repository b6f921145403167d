"""From prompts to a mask by a model of the Segment Anything family that the user has downloaded.

The folder is what Hugging Face `transformers` saves and its hub holds: config.json, processor settings and
model.safetensors. Nothing is downloaded and no code of it is run: weights are read as data.
"""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ...errors import BadRequest, DataError, KarfError, MissingDependency
from ...io.color import to_bytes
from ...io.failures import is_out_of_memory
from ...io.images import over
from .prompts import Prompts

HINT = "Give the folder of a Segment Anything model as saved by transformers, with config.json and model.safetensors."


class SegmentAnything:
    """One photo that is being marked. The photo is looked at once, not at each click.

    Args:
        photo: Float sRGB [H, W, 3 or 4] in [0, 1], straight alpha.
        folder: The model's.

    Raises:
        MissingDependency: The extra `marks` is not installed.
        DataError: The folder holds no such model, or a damaged one.
    """

    def __init__(self, photo: np.ndarray, folder: Path | str) -> None:
        self._folder = Path(folder)
        self._model, self._processor = _load(self._folder)
        self._colors = to_bytes(over(photo[..., :3], photo[..., 3] if photo.shape[-1] == 4 else None))
        with _using(self._folder), torch.no_grad():
            seen = self._processor(images=self._colors, return_tensors="pt")
            self._embeddings = self._model.get_image_embeddings(seen["pixel_values"])

    def propose(self, prompts: Prompts) -> np.ndarray:
        """The likeliest mask, bool [H, W]; of a lasso its frame counts.

        Raises:
            BadRequest: The prompts lie outside the photo, or are empty.
        """
        height, width = self._colors.shape[:2]
        prompts.check(width, height)
        with _using(self._folder), torch.no_grad():
            asked = self._processor(images=self._colors, return_tensors="pt", **_inputs(prompts))
            sizes = {name: asked.pop(name) for name in ("original_sizes", "reshaped_input_sizes") if name in asked}
            del asked["pixel_values"]
            found = self._model(**asked, image_embeddings=self._embeddings, multimask_output=len(prompts.points) < 2)
            masks = self._processor.post_process_masks(found.pred_masks, *sizes.values())[0][0]
            mask = masks[found.iou_scores[0, 0].argmax()].bool().cpu().numpy()
        for x, y, is_object in prompts.points:
            mask[int(y), int(x)] = is_object
        return mask


def _inputs(prompts: Prompts) -> dict[str, Any]:
    """Prompts as transformers takes them: nested by photo and object."""
    frame = prompts.box
    if frame is None and prompts.lasso is not None:
        corners = np.array(prompts.lasso)
        frame = (*corners.min(0).tolist(), *corners.max(0).tolist())
    inputs: dict[str, Any] = {} if frame is None else {"input_boxes": [[list(frame)]]}
    if prompts.points:
        inputs["input_points"] = [[[[x, y] for x, y, _ in prompts.points]]]
        inputs["input_labels"] = [[[int(is_object) for *_, is_object in prompts.points]]]
    return inputs


def _load(folder: Path) -> tuple[Any, Any]:
    """Model and processor of a folder."""
    try:
        from transformers import AutoModelForMaskGeneration, AutoProcessor
    except ModuleNotFoundError as error:
        raise MissingDependency(
            "Weights of the Segment Anything family need the package transformers.",
            'Install the extra: pip install "karf[marks]". Without weights, leave them out.',
        ) from error
    if not (folder / "config.json").is_file():
        raise BadRequest(f"{folder} has no config.json.", HINT)
    local = {"local_files_only": True, "trust_remote_code": False}
    with _using(folder):
        model = AutoModelForMaskGeneration.from_pretrained(folder, use_safetensors=True, **local).eval()
        return model, AutoProcessor.from_pretrained(folder, **local)


@contextmanager
def _using(folder: Path):
    """What transformers raises of a folder's content becomes a DataError that names it."""
    try:
        yield
    except Exception as error:  # files of others: nearly anything may be wrong
        if isinstance(error, KarfError) or is_out_of_memory(error):
            raise
        raise DataError(f"{folder} cannot be used as a Segment Anything model ({error!s:.300}).", HINT) from error
