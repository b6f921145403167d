"""Where a page's viewer may look from: around the objects, as far as the photos were taken."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from blender_tests.engine.reference.still_life import camera_at
from karf_engine.export.page.orbit import SLACK, orbit_of

AT_ORIGIN = np.zeros((9, 3))  # an object
HEIGHTS = (20, 40)  # degrees


def row(first, last, count):
    """Cameras around the origin between two azimuths at two heights, all in degrees."""
    azimuths = np.linspace(first, last, count)
    return [camera_at(*np.radians((azimuth, HEIGHTS[n % 2]))) for n, azimuth in enumerate(azimuths)]


@pytest.mark.parametrize(
    ("first", "last", "count", "slack"),
    [
        (0, 330, 12, None),  # all round
        (0, 310, 12, None),
        (0, 280, 15, SLACK),
        (-40, 40, 9, SLACK),
        (150, 260, 11, SLACK),
        (-20, 20, 5, 4.0),  # a tenth of what the photos cover
    ],
)
def test_azimuth_is_limited_where_photos_leave_a_gap(first, last, count, slack):
    found = orbit_of(row(first, last, count), AT_ORIGIN, np.ones(count))
    if slack is None:
        assert found.azimuth is None
    else:
        middle = (first + last) / 2  # where it starts
        assert_allclose(np.degrees(np.arctan2(found.position[1], found.position[0])) % 360, middle % 360)
        assert_allclose(np.degrees(found.azimuth), (first - middle - slack, last - middle + slack))


def test_polar_angles_and_distances_are_those_of_the_photos_and_little_more():
    found = orbit_of(row(0, 330, 12), AT_ORIGIN, np.ones(12))
    assert_allclose(found.center, 0, atol=1e-6)
    assert_allclose(found.up, (0, 0, 1), atol=1e-6)
    assert_allclose(np.degrees(found.polar), (90 - max(HEIGHTS) - SLACK, 90 - min(HEIGHTS) + SLACK), atol=1e-6)
    assert_allclose(found.distance, (0.9 * 3.6, 1.1 * 3.6))
    assert_allclose(found.field_of_view, np.degrees(2 * np.arctan(0.5 / 1.35)))


def test_orbit_is_around_the_objects_and_starts_where_a_photo_shows_most_of_them():
    cameras, corners = row(0, 330, 12), np.array([(x, y, 0.5) for x in (1, 2) for y in (0, 1)])
    found = orbit_of(cameras, np.repeat(corners, 50, axis=0), np.eye(12)[4])
    assert_allclose(found.center, (1.5, 0.5, 0.5))
    away = cameras[4].position - found.center
    assert_allclose(np.cross(found.position - found.center, away), 0, atol=1e-9)
    pixel, depth = found.camera(480, 360).project(found.center[None])
    assert_allclose(pixel, [(240, 180)])
    assert found.distance[0] <= depth[0] <= found.distance[1]


def test_orbit_without_objects_is_around_what_the_photos_look_at():
    found = orbit_of(row(0, 330, 12), np.zeros((0, 3)), np.ones(12))
    assert_allclose(found.center, 0, atol=0.01)


def test_orbit_does_not_start_straight_above():
    cameras = [*row(0, 330, 12), camera_at(0, np.pi / 2)]
    found = orbit_of(cameras, AT_ORIGIN, np.array([*np.ones(12), 9.0]))
    assert np.hypot(*found.position[:2]) > 1 and np.isfinite(found.camera(480, 360).camera_to_world).all()
