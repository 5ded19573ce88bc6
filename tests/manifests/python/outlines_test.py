"""eventgan.rings and eventgan.mask, against angles: a ring winds around what sees it turn by 360 degrees."""

import json
import time

import numpy as np
import pytest

import eventgan


def text(rings):
    return json.dumps([np.asarray(ring, np.float32).ravel().tolist() for ring in rings], separators=(",", ":")).encode()


def covered(rings, size):
    """bool [H, W]: whether the sum of the angles under which a pixel's centre sees the edges is not 0."""
    y, x = np.mgrid[: size[0], : size[1]] + 0.5
    angle = np.zeros(size)
    for ring in rings:
        ring = np.asarray(ring, np.float32).astype(float)
        for (ax, ay), (bx, by) in zip(ring, np.roll(ring, -1, axis=0)):
            ax, ay, bx, by = ax - x, ay - y, bx - x, by - y
            angle += np.arctan2(ax * by - ay * bx, ax * bx + ay * by)
    return np.rint(angle / (2 * np.pi)) != 0


def test_rings_are_arrays_of_corners():
    found = eventgan.rings(b"[[0,0,4.1,0,4.1,3],[1,1,1,2,2,2,2.5,-1e-3]]")
    assert [ring.shape for ring in found] == [(3, 2), (4, 2)]
    assert found[0].dtype == np.float64 and found[0][1, 0] == np.float32(4.1)
    assert eventgan.rings(b"") == []


@pytest.mark.parametrize("wrong", [b"x", b"5", b"{}x", b"[5]", b"[[1,2,3,4]]", b"[[1,2,3,4,5]]", b"[[0,0,1,0,NaN,1]]",
                                   b"[[0,0,1,0,1,1e999]]", b'[["a","b","c","d","e","f"]]', b"[[]]",
                                   b'[["1","2","3","4","5","6"]]', b"[[1%s,2,3,4,5,6]]" % (b"0" * 400),
                                   b"[" * 100_000])
def test_what_is_no_outline_is_named(wrong):
    with pytest.raises(ValueError, match="expected rings"):
        eventgan.mask(wrong, (4, 4))


def test_a_hole_and_two_parts():
    outline = text([[(0, 0), (5, 0), (5, 5), (0, 5)], [(1, 1), (1, 3), (3, 3), (3, 1)],
                    [(6, 4), (8, 4), (8, 5), (6, 5)]])
    expected = np.zeros((6, 9), bool)
    expected[:5, :5] = True
    expected[1:3, 1:3] = False
    expected[4, 6:8] = True
    np.testing.assert_array_equal(eventgan.mask(outline, (6, 9)), expected)
    np.testing.assert_array_equal(eventgan.mask(outline, (2, 3)), expected[:2, :3])


def test_neighbours_cover_each_pixel_once():
    left, right = text([[(0, 0), (2.5, 0), (2.5, 4), (0, 4)]]), text([[(2.5, 0), (6, 0), (6, 4), (2.5, 4)]])
    counts = eventgan.mask(left, (4, 6)).astype(int) + eventgan.mask(right, (4, 6))
    np.testing.assert_array_equal(counts, 1)


def test_any_rings_cover_what_they_wind_around():
    random = np.random.default_rng(5)
    for _ in range(60):
        size = tuple(random.integers(1, 24, 2))
        rings = [random.uniform(-0.5, 1.5, (random.integers(3, 12), 2)) * size[::-1]
                 for _ in range(random.integers(1, 4))]
        np.testing.assert_array_equal(eventgan.mask(text(rings), size), covered(rings, size))


def test_nothing_and_what_lies_outside():
    assert not eventgan.mask(b"", (3, 4)).any()
    assert not eventgan.mask(text([[(-9, -9), (-1, -9), (-1, 99)], [(99, 0), (200, 0), (200, 99)]]), (3, 4)).any()
    assert eventgan.mask(text([[(-1e6, -1e6), (1e6, -1e6), (1e6, 1e6), (-1e6, 1e6)]]), (3, 4)).all()
    assert not eventgan.mask(text([[(0, 0), (4, 0), (2, 0)]]), (3, 4)).any()


def test_a_hundred_thousand_corners():
    angle = np.linspace(0, 2 * np.pi, 100_000, endpoint=False)
    circle = eventgan.mask(text([np.stack([450 + 400 * np.cos(angle), 450 + 400 * np.sin(angle)], axis=1)]), (900, 900))
    y, x = np.mgrid[:900, :900] + 0.5
    radius = np.hypot(x - 450, y - 450)
    assert circle[radius < 399.9].all() and not circle[radius > 400.1].any()


def test_thousands_of_rings_take_no_time_of_the_area_each():
    """20,000 x 1 megapixel would be minutes."""
    y, x = np.mgrid[0:1000:5, 0:500:5].reshape(2, -1)
    squares = np.stack([x, y, x + 1, y, x + 1, y + 1, x, y + 1], axis=1)
    begin = time.monotonic()
    speckled = eventgan.mask(json.dumps(squares.tolist()).encode(), (1000, 1000))
    assert time.monotonic() - begin < 10
    expected = np.zeros((1000, 1000), bool)
    expected[::5, :500:5] = True
    np.testing.assert_array_equal(speckled, expected)
