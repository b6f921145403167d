"""LPIPS: the published formula on weights that the user gives, which are read as data or refused."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from karf_engine.errors import DataError
from karf_engine.lpips import CONVOLUTIONS, NUMBERS, Lpips, read_lpips


@pytest.fixture
def files(tmp_path):
    """Files as torchvision and the LPIPS package write them, with random weights."""
    random = torch.Generator().manual_seed(0)
    backbone, linear = {"classifier.1.bias": torch.zeros(3)}, {}
    for n, (number, (n_in, n_out, size, *_)) in enumerate(zip(NUMBERS, CONVOLUTIONS, strict=True)):
        backbone[f"features.{number}.weight"] = torch.randn(n_out, n_in, size, size, generator=random) * 0.05
        backbone[f"features.{number}.bias"] = torch.randn(n_out, generator=random) * 0.05
        linear[f"lin{n}.model.1.weight"] = torch.rand(1, n_out, 1, 1, generator=random)
    torch.save(backbone, tmp_path / "alexnet.pth")
    torch.save(linear, tmp_path / "alex.pth")
    return tmp_path / "alexnet.pth", tmp_path / "alex.pth"


def pictures(size=(72, 80)):
    random = np.random.default_rng(1)
    first = random.random((*size, 3)).astype(np.float32)
    return first, np.clip(first + 0.1 * random.standard_normal(first.shape), 0, 1).astype(np.float32)


def test_it_is_the_published_formula_written_out_with_torchs_own_layers(files):
    backbone, linear = (torch.load(path, weights_only=True) for path in files)
    layers = []
    for (n_in, n_out, size, stride, padding), number in zip(CONVOLUTIONS, NUMBERS, strict=True):
        layer = torch.nn.Conv2d(n_in, n_out, size, stride, padding)
        layer.load_state_dict({part: backbone[f"features.{number}.{part}"] for part in ("weight", "bias")})
        layers.append(layer)
    pool, relu = torch.nn.MaxPool2d(3, 2), torch.nn.ReLU()
    trunk = [layers[0], relu, "tap", pool, layers[1], relu, "tap", pool, layers[2], relu, "tap"]
    trunk += [layers[3], relu, "tap", layers[4], relu, "tap"]

    def taps(picture):
        x = torch.from_numpy(picture).permute(2, 0, 1)[None] * 2 - 1
        x = (x - torch.tensor([-0.030, -0.088, -0.188]).view(1, 3, 1, 1)) / torch.tensor([0.458, 0.448, 0.450]).view(
            1, 3, 1, 1
        )
        found = []
        for step in trunk:
            if step == "tap":
                found.append(torch.nn.functional.normalize(x, dim=1))
            else:
                x = step(x)
        return found

    first, second = pictures()
    expected = 0.0
    for n, (a, b) in enumerate(zip(taps(first), taps(second), strict=True)):
        expected += float(((a - b).detach() ** 2 * linear[f"lin{n}.model.1.weight"]).sum(1).mean())
    assert read_lpips(*files)(first, second) == pytest.approx(expected, rel=1e-5)
    assert expected > 0


def test_the_same_picture_is_at_distance_0_and_the_order_does_not_matter(files):
    measure, (first, second) = read_lpips(*files), pictures()
    assert measure(first, first) == 0
    assert measure(first, second) == pytest.approx(measure(second, first), rel=1e-6)


def test_pictures_that_are_too_small_are_refused():
    with pytest.raises(ValueError, match="at least 64 pixels, not 40x40"):
        Lpips()(*pictures((40, 40)))


@pytest.mark.parametrize("damage", ["missing", "no weights", "swapped", "code"])
def test_files_of_something_else_are_refused_by_name(files, damage, tmp_path):
    backbone, linear = files
    if damage == "missing":
        backbone = tmp_path / "none.pth"
    if damage == "no weights":
        backbone.write_bytes(b"nothing")
    if damage == "swapped":
        backbone, linear = linear, backbone
    if damage == "code":
        torch.save({"features.0.weight": Lpips()}, backbone)
    with pytest.raises(DataError, match=backbone.name):
        read_lpips(backbone, linear)
