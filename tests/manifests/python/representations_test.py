"""eventgan.signed_channel: one scale for events of any source; eventgan.represent: arrays of events."""

import numpy as np
import pytest

import eventgan
from eventgan import signed_channel

try:
    from eventgan import represent
except ImportError:  # no libeventgan, or one with sanitizers
    represent = None
needs_library = pytest.mark.skipif(represent is None, reason="no libeventgan")


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
    for strength in (7, 0.25):
        volume[1, 3, 4] = strength  # 0.25 % of the pixels: the percentile is 0
        assert signed_channel(volume)[0, 3, 4] == -1
    assert signed_channel(np.zeros((2, 0, 5), np.float32)).shape == (1, 0, 5)
    assert not signed_channel(np.full((4, 4), 9, np.uint8)).any()


@pytest.mark.parametrize("shape", [(3, 4, 4), (0, 4, 4), (4,), (2, 2, 4, 4)])
def test_what_is_neither(shape):
    with pytest.raises(ValueError, match="expected a volume .* got an array of "):
        signed_channel(np.zeros(shape))


def real_events(count, seed=1, clock_us=1_600_000_000_000_000):
    """As a camera's file has them: microseconds of the day, uint16 places, on 40x30 pixels."""
    random = np.random.default_rng(seed)
    events = np.empty(count, [("t", "<i8"), ("x", "<u2"), ("y", "<u2"), ("p", "i1")])
    events["t"] = clock_us + np.sort(random.integers(0, 50_000, count))
    events["x"], events["y"], events["p"] = (random.integers(0, most, count) for most in (40, 30, 2))
    return events


def columns_of(events):
    return {name: events[name] for name in "txyp"}


def histogram_of(events, bins, shape):
    """RVT's, github.com/uzh-rpg/RVT, data/utils/representations.py."""
    histogram, t = np.zeros((2, bins, *shape), int), events["t"] - events["t"][0]
    share = t.astype("f4") / np.float32(max(t[-1], 1))
    np.add.at(histogram, (events["p"], np.minimum((share * np.float32(bins)).astype(int), bins - 1), events["y"],
                          events["x"]), 1)
    return np.minimum(histogram, 10).reshape(2 * bins, *shape)


@needs_library
def test_histograms_are_rvts():
    for seed in range(20):
        events = real_events(3000, seed)
        found = represent(events, "histogram:10", size=(30, 40))
        assert found.dtype == np.uint8
        np.testing.assert_array_equal(found, histogram_of(events, 10, (30, 40)))


@needs_library
def test_a_window_has_both_its_ends():
    events = real_events(500)
    begin, end = events["t"][100], events["t"][200]
    found = represent(events, "count", size=(30, 40), window_s=(begin * 1e-6, end * 1e-6))
    chosen = events[(events["t"] >= begin) & (events["t"] <= end)]
    assert found.sum() == len(chosen)
    small = events.copy()
    small["t"] -= small["t"][0]
    begin, end = small["t"][[100, 200]]
    within = small[(small["t"] >= begin) & (small["t"] <= end)]
    found = represent(small, "count", size=(30, 40), window_s=(begin * 1e-6, end * 1e-6))
    assert found.sum() == len(within) and found[0].sum() == within["p"].sum()
    each = np.zeros(2000, events.dtype)
    each["t"] = 1000 * np.arange(2000)
    for ms in range(1999):
        assert represent(each, "count", size=(30, 40), window_s=(ms / 1000, (ms + 1) / 1000)).sum() == 2, ms


@needs_library
@pytest.mark.parametrize("names", [("t", "x", "y", "p"), ("ts", "x", "y", "pol"), ("timestamp", "x", "y", "polarity")])
def test_columns_may_have_any_type(names):
    events = real_events(200, clock_us=0)
    expected = represent(events, "voxel:5", size=(30, 40))
    columns = dict(zip(names, (events["t"] * 1e-6, events["x"].astype("f4"), events["y"].astype("i8"),
                               events["p"].astype(bool))))
    np.testing.assert_allclose(represent(columns, "voxel:5", size=(30, 40)), expected, atol=1e-5)


@needs_library
@pytest.mark.parametrize("p", [[1, 0], [True, False], [1, -1], [1.0, -1.0],
                               *(np.array([1, -1]).astype(dtype) for dtype in ("u1", "u2", "u4"))])
def test_polarities_are_as_convert_reads_them(p):
    events = {"t": [0, 1], "x": [0, 1], "y": [0, 0], "p": p}
    np.testing.assert_array_equal(represent(events, "count", size=(1, 2)), [[[1, 0]], [[0, 1]]])


@needs_library
@pytest.mark.parametrize("times", [np.array([2**63 - 3, 2**63 + 5, 2**64 - 1], "u8"), np.array([-100, -92, 100], "i1"),
                                   np.array([-2**63, 0, 2**63 - 1])])
def test_whole_times_may_lie_as_far_apart_as_their_type_allows(times):
    events = {"t": times, "x": [0, 0, 0], "y": [0, 0, 0], "p": [1, 1, 1]}
    share = float((int(times[1]) - int(times[0])) / (int(times[2]) - int(times[0])))
    found = represent(events, "voxel:2", size=(1, 1))  # an event's share of a bin falls with its distance in time
    np.testing.assert_allclose(found.ravel(), [1 + 1 - share, 1 + share], rtol=1e-6)


@needs_library
def test_no_events_are_zeros():
    empty = real_events(0)
    for word, shape in [("volume:9", (18, 30, 40)), ("time_surface:0.1", (2, 30, 40)), ("eros:8", (30, 40))]:
        found = represent(empty, word, size=(30, 40), window_s=(0, 1))
        assert found.shape == shape and not found.any()


@needs_library
@pytest.mark.parametrize("change, message", [
    (lambda events: events[::-1], "expected events in time order"),
    (lambda events: {name: events[name] for name in "xyp"}, "expected events with t or ts or timestamp, got x, y, p"),
    (lambda events: [1, 2], "expected events with t or ts or timestamp, got list"),
    (lambda events: {name: column.astype("S9") for name, column in columns_of(events).items()}, "expected numbers"),
    (lambda events: {**columns_of(events), "t": np.arange(9, 0, -1, "u4")}, "expected events in time order"),
    (lambda events: {**columns_of(events), "t": np.array([*range(8), np.nan])}, "expected events in time order"),
    (lambda events: {**columns_of(events), "x": events["x"] + 0.5}, r"expected whole pixels .* got \d+\.5 for x"),
    (lambda events: {**columns_of(events), "y": np.full(9, np.nan)}, "expected whole pixels .* got nan for y"),
    (lambda events: {**columns_of(events), "y": np.full(9, 2**32)},
     "expected whole pixels inside 40x30, got 4294967296 for"),
    (lambda events: {**columns_of(events), "p": events["p"] + 1}, "expected polarities -1 and 1 or 0 and 1, got 2"),
    (lambda events: {**columns_of(events), "p": np.arange(9) % 3 - 1}, "got 0 after -1"),
    (lambda events: {**columns_of(events), "p": np.full(9, np.nan)}, "polarities .* got nan"),
    (lambda events: {**columns_of(events), "p": np.full(9, 254, "u1")}, "polarities .* got 254"),
])
def test_what_is_none_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        represent(change(real_events(9)), "count", size=(30, 40))


@needs_library
def test_a_window_takes_no_events_in_another_order():
    events = real_events(9)
    with pytest.raises(ValueError, match="expected events in time order"):
        represent(events[::-1], "count", size=(30, 40), window_s=(0, 1))


@needs_library
def test_events_outside_and_other_words_are_refused():
    with pytest.raises(ValueError, match="inside 40x20 pixels"):
        represent(real_events(500), "count", size=(20, 40))
    with pytest.raises(ValueError, match="expected a representation of volume:B, voxel:B"):
        represent(real_events(9), "stack:9", size=(30, 40))
    with pytest.raises(ValueError, match="expected histogram:T, T from 1 to 64"):
        represent(real_events(9), "histogram", size=(30, 40))
    assert "histogram:T : uint8 [2 T, H, W]" in represent.__doc__


@needs_library
def test_shards_as_representations(example):
    shards = eventgan.Shards(example.path("float32-0"))
    counts = shards.represent("count", counts="rounded")
    volume, found = shards[0]["volume"], counts[0]["volume"]
    assert found.dtype == np.float32
    half = len(volume) // 2
    # Each value becomes the nearest number of events.
    rounded = np.floor(volume + 0.5)
    np.testing.assert_array_equal(found, np.stack([rounded[:half].sum(0), rounded[half:].sum(0)]))
    np.testing.assert_array_equal(shards.represent("voxel:3", seed=4)[0]["volume"],
                                  shards.represent("voxel:3", seed=4)[0]["volume"])
    assert shards.represent("histogram:4")[0]["volume"].shape == (8, *volume.shape[1:])
    # Events are spread over the pair's time: 0.2 s, and of the last sample, whose times are not known, 1 s.
    surfaces = shards.represent("time_surface:1", counts="rounded")
    oldest = [surfaces[i]["volume"][surfaces[i]["volume"] > 0].min() for i in (0, -1)]
    assert np.exp(-0.2) - 1e-6 <= oldest[0] and np.exp(-1.0) - 1e-6 <= oldest[1] < np.exp(-0.2)
