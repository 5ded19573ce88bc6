"""eventgan.signed_channel: one scale for events of any source."""

import numpy as np
import pytest

from eventgan import signed_channel


def test_of_a_volume():
    """Positive minus negative; of 100 pixels 97 have 0 to 96 events more of one kind and three 400,
    so that the 99th percentile of the magnitude is 400."""
    counts = np.array([*range(97), 400, 400, 400], np.float32).reshape(10, 10)
    volume = np.zeros((6, 10, 10), np.float32)
    volume[1], volume[2] = 0.25 * counts, 0.75 * counts
    np.testing.assert_allclose(signed_channel(volume), counts[None] / 400, rtol=1e-6)
    np.testing.assert_allclose(signed_channel(volume[[3, 4, 5, 0, 1, 2]]), -counts[None] / 400, rtol=1e-6)
    np.testing.assert_allclose(signed_channel(7 * volume), signed_channel(volume), rtol=1e-6)
    volume[4] = counts
    assert not signed_channel(volume).any()  # as many of both


def test_the_strongest_are_clipped():
    volume = np.zeros((2, 20, 20), np.float32)
    volume[0, 0, :10], volume[1, 1, 0] = 2, 50  # 2.75 % of the pixels have events
    channel = signed_channel(volume)
    assert channel.dtype == np.float32 and channel.shape == (1, 20, 20)
    assert (channel[0, 0, :10] == 1).all() and channel[0, 1, 0] == -1 and np.count_nonzero(channel) == 11


def test_of_a_drawing():
    """Grey values 113, no event, 200 and 10: the stretch that brought 0 to 113 does not matter."""
    image = np.full((10, 10), 113, np.uint8)
    image[0, :5], image[1, :5] = 113 + 50, 113 - 100
    np.testing.assert_array_equal(signed_channel(image)[0, :2, :5], [[0.5] * 5, [-1] * 5])
    assert not signed_channel(image)[0, 2:].any()


def test_where_few_pixels_or_none_have_events():
    volume = np.zeros((2, 20, 20), np.float32)
    assert not signed_channel(volume).any()
    volume[1, 3, 4] = 7  # 0.25 % of the pixels: the percentile is 0
    assert signed_channel(volume)[0, 3, 4] == -1
    assert signed_channel(np.zeros((2, 0, 5), np.float32)).shape == (1, 0, 5)
    assert not signed_channel(np.full((4, 4), 9, np.uint8)).any()


@pytest.mark.parametrize("shape", [(3, 4, 4), (0, 4, 4), (4,), (2, 2, 4, 4)])
def test_what_is_neither(shape):
    with pytest.raises(ValueError, match="expected a volume .* got an array of "):
        signed_channel(np.zeros(shape))
