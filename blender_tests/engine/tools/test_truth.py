"""What judges compare with: true recolors, as renderings show them."""

import imageio.v3 as iio
import numpy as np

from karf_engine.files import write_json
from tools.judging.truth import Truth


def test_recolors_of_a_matte_capture_lie_over_white_as_renderings_do(tmp_path):
    picture = np.zeros((1, 3, 4), np.uint8)
    picture[0] = [(255, 0, 0, 255), (255, 0, 0, 51), (0, 0, 0, 0)]
    folder = tmp_path / "recolor" / "red" / "test"
    folder.mkdir(parents=True)
    iio.imwrite(folder / "r_000.png", picture)
    write_json(tmp_path / "edits.json", {"edits": {"red": {}}})
    (tmp_path / "labels").mkdir()
    write_json(tmp_path / "labels" / "names.json", {})

    (recolored,) = Truth(tmp_path).recolored("red")

    np.testing.assert_allclose(recolored[0], [(1, 0, 0), (1, 0.8, 0.8), (1, 1, 1)])
