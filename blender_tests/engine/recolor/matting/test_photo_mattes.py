"""Mattes of a photo, from the field's rough masks and the photo's own edges."""

from itertools import pairwise

import cv2
import numpy as np
import pytest

from blender_tests.engine.reference.cut_outs import canvas, paint
from karf_engine.io.color import linear_to_srgb, srgb_to_linear, to_bytes
from karf_engine.metrics.masks import iou
from karf_engine.recolor.matting.matte import dense_coverage
from karf_engine.recolor.matting.photo_mattes import TILE, cover, field_mattes, make_mattes, sharp_size, steps
from karf_engine.recolor.matting.thin_parts import Marks

SIZE, SMALL = 192, 48
COLUMNS, ROWS = canvas(SIZE)
GRAY, RED, GREEN = (188, 192, 196), (190, 40, 35), (20, 100, 30)


def disk(x, y, radius):
    return np.hypot(COLUMNS - x, ROWS - y) < radius


def winding(width):
    """A winding cable above the ball of the lamp."""
    return (np.abs(COLUMNS - 96 - 4 * np.sin(ROWS / 9)) < width) & (ROWS < 60)


def wall(shape=None, color=GREEN):
    """A gray wall with a colored shape on it."""
    picture = np.full((SIZE, SIZE, 3), GRAY, np.uint8)
    if shape is not None:
        picture[cv2.resize(shape.astype(np.float32), (SIZE, SIZE), interpolation=cv2.INTER_AREA) > 0.5] = color
    return picture


def find_mattes(scene):
    return make_mattes("photo", scene.photo, scene.probabilities, scene.rendered)


def find_coverage(scene):
    return dense_coverage(find_mattes(scene), scene.photo.shape[:2])


def error(coverage, truth):
    return np.abs(coverage - truth).sum() / truth.sum()


BALL, LAMP, EVERYWHERE, LEFT = disk(96, 96, 50), disk(96, 100, 42), COLUMNS > 0, COLUMNS < 96.5
TOO_LARGE = [BALL], [RED], wall(), [disk(96, 96, 54)]
WHOLE, TIP = np.s_[:], np.s_[:, 24:50]
SCENES = {  # (shapes, colors, background, shapes as learned by the field), where to compare, and the largest error
    "learned too large": (TOO_LARGE, WHOLE, 0.01),
    "touching": (([BALL & LEFT, BALL & ~LEFT], [RED, GREEN], wall(), [BALL & (COLUMNS < 99), BALL & (COLUMNS >= 99)]),
                 WHOLE, 0.02),
    "beside its color": (([disk(60, 96, 40)], [RED], wall(disk(140, 96, 40), RED), [disk(60, 96, 40)]), WHOLE, 0.01),
    "a thin part is lost": (([LAMP | winding(1.8) & (ROWS > 20)], [GREEN], wall(), [LAMP]), TIP, 0.3),
    "fills the photo": (([EVERYWHERE], [RED], wall(), [EVERYWHERE]), WHOLE, 1e-6),
}  # fmt: skip


@pytest.mark.parametrize(("painted", "part", "most"), SCENES.values(), ids=SCENES)
def test_edges_follow_the_photo_or_else_the_field(painted, part, most):
    scene = paint(*painted, SMALL)
    coverage = find_coverage(scene)
    assert error(coverage[part], scene.coverage[part]) < most
    assert coverage.sum(0).max() <= 1.001


@pytest.fixture(scope="module")
def ball():
    """A red ball on gray that the field has learned too large by one of its pixels."""
    scene = paint(*TOO_LARGE, SMALL)
    assert error(dense_coverage(field_mattes((SIZE, SIZE), scene.probabilities), (SIZE, SIZE)), scene.coverage) > 0.1
    return scene


def test_mixed_pixels_hold_the_color_of_the_object(ball):
    matte = find_mattes(ball)[0]
    mostly = matte.coverage.ravel()[matte.mixed] > 0.5
    assert mostly.sum() > 30
    photo = ball.photo[slice(*matte.rows), slice(*matte.columns)].reshape(-1, 3)[matte.mixed]
    off, as_seen = (np.abs(colors[mostly].astype(int) - RED).mean() for colors in (matte.mixed_colors, photo))
    assert off < as_seen / 2


@pytest.mark.parametrize("width", [40, 2 * TILE + 40], ids=["beside its object", "through another tile"])
def test_thin_line_keeps_its_labels_if_its_object_has_a_body(width):
    """No certain pixel of the object touches the line, and both sides look much like it."""
    line, body = np.zeros((2, 40, width), bool)
    line[20, 20:-10] = body[15:25, 2:10] = True
    photo = np.where(line[..., None], np.uint8(GRAY) - 3, np.uint8(GRAY))
    for label in (np.where(body, 1, 0.8 * line), 0.8 * line):
        coverage = cover(photo, np.stack([1 - label, label]).astype(np.float32))[0]
        assert (coverage[line].min() > 0.79) == (label.max() == 1)
        assert coverage[24:, 12:].max() < 0.5 and (label.max() == 1 or coverage.max() < 0.5)


@pytest.fixture(scope="module")
def lamp():
    """A green lamp with a cable; the field shows the cable's color but labels it as no object."""
    cable = winding(2.5)
    return paint([LAMP | cable], [GREEN], wall(cable), [LAMP], SMALL)


def marked_mask(scene, drawn, thin):
    """The object's mask if a rough mask is drawn on the photo, or if some rough mask shows a thin part."""
    marks = Marks(None if drawn is None else drawn[None], (thin,))
    mattes = make_mattes("photo", scene.photo, scene.probabilities, scene.rendered, marks)
    return dense_coverage(mattes, scene.photo.shape[:2])[0] > 0.5


@pytest.mark.parametrize("is_drawn", [True, False])
def test_thin_part_belongs_to_the_object_if_marked(lamp, is_drawn):
    cable, brush = lamp.coverage[0] > 0.5, np.zeros((SIZE, SIZE), bool)
    cable[60:] = False
    brush[:70, 80:112] = True
    assert find_coverage(lamp)[0][cable].mean() < 0.3
    mask = marked_mask(lamp, brush if is_drawn else None, thin=not is_drawn)
    assert mask[cable].mean() > 0.9 and iou(mask, lamp.coverage[0] > 0.5) > 0.95


def test_spilled_mask_takes_nothing_of_a_neighbor_of_the_same_color():
    neighbors = [wall((np.abs(COLUMNS - 96) < width) & (ROWS < 60)) for width in (30, 4)]
    thick, thin = (paint([LAMP], [GREEN], neighbor, [LAMP], SMALL) for neighbor in neighbors)
    expected = find_coverage(thick)[0] > 0.5
    for spilled in (disk(96, 100, 48), disk(96, 90, 60)):
        assert np.array_equal(marked_mask(thick, spilled, thin=True), expected)
    assert find_coverage(thin)[0, :30].max() < 0.05


def test_stray_patches_and_unseen_objects_cover_nothing(ball):
    probabilities = ball.probabilities.copy()
    probabilities[0, 44:46, 44:46] = 0.9
    strayed = make_mattes("photo", ball.photo, probabilities, ball.rendered)
    assert dense_coverage(strayed, (SIZE, SIZE))[0, 160:, 160:].max() == 0
    assert make_mattes("photo", ball.photo, 0 * probabilities, ball.rendered)[0].coverage.size == 0


def test_disputed_matte_follows_the_field_and_says_so(ball):
    assert not find_mattes(ball)[0].disputed
    # the field claims a thin ring around the ball; in the photo the ring looks like the wall
    ring = disk(96, 96, 64) & ~disk(96, 96, 52)
    claimed = cv2.resize(ring.astype(np.float32), (SMALL, SMALL), interpolation=cv2.INTER_AREA)[None] * 0.75
    matte = make_mattes("photo", ball.photo, claimed, ball.rendered)[0]
    field = field_mattes((SIZE, SIZE), claimed)[0]
    assert matte.disputed
    assert iou(*(dense_coverage([each], (SIZE, SIZE))[0] > 0.5 for each in (matte, field))) > 0.95


def test_soft_photo_is_matted_at_its_sharp_size(ball):
    soft = to_bytes(linear_to_srgb(cv2.GaussianBlur(srgb_to_linear(ball.photo / 255), (0, 0), 2.5)))
    near = np.ones((SMALL, SMALL), bool)
    assert sharp_size(ball.photo, near) == (SIZE, SIZE)
    assert SIZE / 4 < sharp_size(soft, near)[0] < SIZE / 2
    refined = dense_coverage(make_mattes("photo", soft, ball.probabilities, ball.rendered), (SIZE, SIZE))
    assert error(refined, cv2.GaussianBlur(ball.coverage[0], (0, 0), 2.5)[None]) < 0.06


def test_steps_grow_at_most_twofold():
    sizes = steps((48, 64), (400, 530))
    assert sizes[0] == (48, 64) and sizes[-1] == (400, 530)
    assert all(b[0] / a[0] <= 2.1 for a, b in pairwise(sizes))
    assert steps((48, 64), (48, 64)) == [(48, 64)]
