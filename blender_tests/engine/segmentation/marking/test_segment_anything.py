"""Masks by a tiny Segment Anything model of random weights in a folder."""

import numpy as np
import pytest
import torch

from karf_engine.errors import BadRequest, DataError, MissingDependency
from karf_engine.segmentation.marking.prompts import Prompts
from karf_engine.segmentation.marking.segment_anything import SegmentAnything

SIDE = 64
PHOTO = np.random.default_rng(0).random((40, 60, 3)).astype(np.float32)
CLICKED = Prompts(points=((10.5, 10.5, True), (20.5, 30.5, False)))


@pytest.fixture(scope="module")
def model_folder(tmp_path_factory):
    transformers = pytest.importorskip("transformers")
    path, half = tmp_path_factory.mktemp("tiny"), {"num_hidden_layers": 1, "num_attention_heads": 2, "mlp_dim": 16}
    seen = {"hidden_size": 16, "image_size": SIDE, "patch_size": 16}
    config = transformers.SamConfig(
        vision_config=seen | half | {"output_channels": 16, "num_pos_feats": 8, "global_attn_indexes": [0]},
        prompt_encoder_config=seen | {"mask_input_channels": 4},
        mask_decoder_config=half | {"hidden_size": 16, "iou_head_hidden_dim": 8},
    )
    torch.manual_seed(0)
    transformers.SamModel(config).save_pretrained(path)
    sizes = {f"{name}pad_size": {"height": side, "width": side} for name, side in (("", SIDE), ("mask_", SIDE // 4))}
    sizes |= {f"{name}size": {"longest_edge": side} for name, side in (("", SIDE), ("mask_", SIDE // 4))}
    transformers.SamProcessor(transformers.SamImageProcessor(**sizes)).save_pretrained(path)
    return path


@pytest.mark.parametrize(
    "prompts", [CLICKED, Prompts(box=(5.0, 5.0, 30.0, 30.0)), Prompts(lasso=((1, 1), (9, 1), (9, 9)))]
)
def test_every_prompt_gets_a_mask_of_the_photo_size(model_folder, prompts):
    mask = SegmentAnything(PHOTO, model_folder).propose(prompts)
    assert mask.shape == PHOTO.shape[:2] and mask.dtype == bool
    assert all(mask[int(y), int(x)] == is_object for x, y, is_object in prompts.points)


@pytest.mark.parametrize("weights", ["pytorch_model.bin", "model.safetensors"], ids=["pickled", "damaged"])
def test_pickled_or_damaged_weights_are_rejected(model_folder, tmp_path, weights):
    for path in model_folder.iterdir():
        if path.suffix == ".json":
            (tmp_path / path.name).write_bytes(path.read_bytes())
    (tmp_path / weights).write_bytes(b"0" * 100)
    with pytest.raises(DataError, match="cannot be used"):
        SegmentAnything(PHOTO, tmp_path)


def test_folder_without_a_model_is_rejected(tmp_path):
    pytest.importorskip("transformers")
    with pytest.raises(BadRequest, match=r"no config\.json"):
        SegmentAnything(PHOTO, tmp_path)


def test_missing_transformers_name_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "transformers", None)
    with pytest.raises(MissingDependency, match="transformers") as raised:
        SegmentAnything(PHOTO, tmp_path)
    assert "karf[marks]" in raised.value.hint
