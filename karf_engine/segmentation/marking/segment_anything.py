"""Propose masks with a model of the Segment Anything family that the user has downloaded.

Its folder is in the format of Hugging Face `transformers`: config.json, processor settings and model.safetensors.
Nothing is downloaded, and no code from the folder is run.
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
from ...io.images import alpha_composite
from .prompts import Prompts

HINT = "Give the folder of a Segment Anything model as saved by transformers, with config.json and model.safetensors."


class SegmentAnything:
    """Mark one photo, float sRGB [H, W, 3 or 4] in [0, 1]; its image embedding is computed once.

    Raises MissingDependency without the extra `marks`, DataError where the folder has no such model, or a damaged one.
    """

    def __init__(self, photo: np.ndarray, folder: Path | str) -> None:
        self._folder = Path(folder)
        self._model, self._processor = _load(self._folder)
        self._colors = to_bytes(alpha_composite(photo[..., :3], photo[..., 3] if photo.shape[-1] == 4 else None))
        with _naming(self._folder), torch.no_grad():
            inputs = self._processor(images=self._colors, return_tensors="pt")
            self._embeddings = self._model.get_image_embeddings(inputs["pixel_values"])

    def propose(self, prompts: Prompts) -> np.ndarray:
        """Return the likeliest mask, bool [H, W]; a lasso counts as its bounding box.

        Raises BadRequest where the prompts are empty or outside the photo.
        """
        height, width = self._colors.shape[:2]
        prompts.check(width, height)
        with _naming(self._folder), torch.no_grad():
            inputs = self._processor(images=self._colors, return_tensors="pt", **_inputs(prompts))
            sizes = [inputs.pop(name) for name in ("original_sizes", "reshaped_input_sizes") if name in inputs]
            del inputs["pixel_values"]
            output = self._model(**inputs, image_embeddings=self._embeddings, multimask_output=len(prompts.points) < 2)
            masks = self._processor.post_process_masks(output.pred_masks, *sizes)[0][0]
            mask = masks[output.iou_scores[0, 0].argmax()].bool().cpu().numpy()
        for x, y, is_object in prompts.points:
            mask[int(y), int(x)] = is_object
        return mask


def _inputs(prompts: Prompts) -> dict[str, Any]:
    """Return the prompts in the format of transformers: nested by photo and object."""
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
    try:
        from transformers import AutoModelForMaskGeneration, AutoProcessor  # pyright: ignore[reportMissingImports]
    except ModuleNotFoundError as error:
        raise MissingDependency(
            "Weights of the Segment Anything family need the package transformers.",
            'Install the extra: pip install "karf[marks]". Without weights, leave them out.',
        ) from error
    if not (folder / "config.json").is_file():
        raise BadRequest(f"{folder} has no config.json.", HINT)
    local = {"local_files_only": True, "trust_remote_code": False}
    with _naming(folder):
        model = AutoModelForMaskGeneration.from_pretrained(folder, use_safetensors=True, **local).eval()
        return model, AutoProcessor.from_pretrained(folder, **local)


@contextmanager
def _naming(folder: Path):
    """Turn errors of transformers into a DataError that names the folder."""
    try:
        yield
    except Exception as error:  # a foreign file may cause any of them
        if isinstance(error, KarfError) or is_out_of_memory(error):
            raise
        raise DataError(f"{folder} cannot be used as a Segment Anything model ({error!s:.300}).", HINT) from error
