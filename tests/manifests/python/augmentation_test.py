"""eventgan.augmentation: events that stay a camera's, and labels that stay with them."""

import h5py
import numpy as np
import pytest
from conftest import NAME

torch = pytest.importorskip("torch")

from eventgan import Shards
from eventgan.augmentation import EventAugmentation, inverse, move_boxes, move_flow, move_points, warp
from eventgan.torch import DetectionDataset, KeypointDataset


def dot(x, y, height=24, width=32):
    """[2, height, width] with an event at (x, y), spread over four pixels."""
    volume = torch.zeros(2, height, width)
    left, top = int(x), int(y)
    for column, row in ((0, 0), (0, 1), (1, 0), (1, 1)):
        volume[:, top + row, left + column] = (1 - abs(x - left - column)) * (1 - abs(y - top - row))
    return volume


def middle_of(volume):
    """x, y of the mean of its values."""
    weights = volume[0] / volume[0].sum()
    return np.array([float((weights.sum(0) * torch.arange(weights.shape[1])).sum()),
                     float((weights.sum(1) * torch.arange(weights.shape[0])).sum())])


@pytest.mark.parametrize("affine", [
    [[1, 0, 0], [0, 1, 0]], [[1, 0, 3.25], [0, 1, -2.5]], [[-1, 0, 31], [0, 1, 0]], [[2, 0, -9.5], [0, 2, -7]],
    [[0.8, 0.6, -2], [-0.6, 0.8, 9]]])
def test_events_move_as_points_do(affine):
    affine, point = np.array(affine, float), np.array([12.5, 10.25])
    np.testing.assert_allclose(middle_of(warp(dot(*point), affine, 30, 40)), move_points(point, affine), atol=0.05)
    np.testing.assert_allclose(move_points(move_points(point, affine), inverse(affine)), point, atol=1e-12)


def test_whole_pixels_move_exactly_and_nothing_comes_from_outside():
    volume = torch.rand(2, 5, 7)
    moved = warp(volume, np.array([[1, 0, 2], [0, 1, -1.0]]), 6, 8)
    assert torch.equal(moved[:, 0:4, 2:8], volume[:, 1:5, 0:6])
    assert moved[:, 4:].sum() == moved[:, :, :2].sum() == 0
    assert torch.equal(warp(volume, np.array([[-1, 0, 6], [0, 1, 0.0]]), 5, 7), volume.flip(2))


def test_boxes_are_of_edges_points_of_centres():
    mirror = np.array([[-1, 0, 31], [0, 1, 0.0]])  # of 32 columns
    assert move_boxes([[0, 0, 32, 24], [1, 2, 4, 6]], mirror).tolist() == [[0, 0, 32, 24], [28, 2, 31, 6]]
    double = np.array([[2, 0, 0.5], [0, 2, 0.5]])  # (x + 1/2) 2 - 1/2
    assert move_boxes([[1, 2, 4, 6]], double).tolist() == [[2, 4, 8, 12]]


def test_a_turn_moves_volume_boxes_and_flow_around_the_middle():
    torch.manual_seed(2)
    maps = [EventAugmentation(flip=0, turn=30).affine(24, 32) for _ in range(50)]
    angles = [np.rad2deg(np.arctan2(affine[1, 0], affine[0, 0])) for affine in maps]
    assert -30 <= min(angles) < -25 and 25 < max(angles) <= 30
    np.testing.assert_allclose([affine @ [15.5, 11.5, 1] for affine in maps], [[15.5, 11.5]] * 50)
    np.testing.assert_allclose([np.linalg.det(affine[:, :2]) for affine in maps], 1)
    quarter = np.array([[0, -1, 27.0], [1, 0, -4.0]])  # of 24 x 32
    assert move_boxes([[10, 8, 20, 12]], quarter).tolist() == [[16, 6, 20, 16]]
    volume = torch.zeros(1, 24, 32)
    volume[:, 8:12, 10:20] = 1
    turned = warp(volume, quarter, 24, 32)[0] > 0.5
    rows, columns = (np.flatnonzero(turned.any(axis)) for axis in (1, 0))
    assert [columns[0], rows[0], columns[-1] + 1, rows[-1] + 1] == [16, 6, 20, 16]
    half = np.sqrt(0.5)
    np.testing.assert_allclose(move_boxes([[0, 0, 2, 2]], np.array([[half, -half, 0.5], [half, half, 0.5]])),
                               [[1 - 2 * half, 1 - half, 1 + 2 * half, 1 + 3 * half]])
    flow, valid = move_flow(np.tile(np.float32([[[2]], [[1]]]), (1, 24, 32)), np.ones((24, 32), bool), quarter, 24, 32,
                            1)
    assert (flow[:, valid] == [[-1], [2]]).all()
    expected = np.zeros((24, 32), bool)
    expected[2:, 4:28] = True  # the image's 24 rows are columns now; the flow leads back by two rows
    assert (valid == expected).all()


def test_an_augmentation_s_events():
    volume = torch.arange(1.0, 7).reshape(6, 1, 1)
    assert EventAugmentation(reverse=1).events(volume).flatten().tolist() == [6, 5, 4, 3, 2, 1]
    torch.manual_seed(1)
    seen = {tuple(EventAugmentation(drop=1).events(volume).flatten().tolist()) for _ in range(20)}
    assert seen == {(1, 2, 3, 0, 0, 0), (0, 0, 0, 4, 5, 6)}
    assert volume.flatten().tolist() == [1, 2, 3, 4, 5, 6]


def test_time_runs_backwards_only_where_labels_stay_in_place(shards, folder):
    volume = torch.arange(1.0, 7).reshape(6, 1, 1)
    assert torch.equal(EventAugmentation(reverse=1).events(volume, 1.0), volume)
    assert torch.equal(EventAugmentation(reverse=1, reverse_all=True).events(volume, 1.0), volume.flip(0))
    plain = DetectionDataset(shards)[0]["volume"]
    shards.close()
    backwards = EventAugmentation(flip=0, reverse=1)
    for position, expected in ((1.0, plain), (0.5, plain.flip(0))):
        with h5py.File(folder / NAME, "r+") as file:
            file["pairs/label_position"][...] = position
        with Shards(folder) as again:
            assert torch.equal(DetectionDataset(again, augmentation=backwards)[0]["volume"], expected)
            assert torch.equal(KeypointDataset(again, augmentation=backwards)[0]["volume"], expected)
            item = DetectionDataset(again)[0]
            assert item["label_position"] == position and torch.equal(backwards(item)["volume"], expected)
    del item["label_position"]  # nobody knows where the boxes lie
    assert torch.equal(backwards(item)["volume"], plain)


@pytest.mark.parametrize("wrong", [{"flip": 1.5}, {"drop": -0.1}, {"reverse": 2}, {"scale": (0, 1)},
                                   {"scale": (1.2, 0.8)}, {"shift": -1}, {"invert": 2}, {"threshold": (0.2, 0.1)},
                                   {"turn": -1}, {"turn": 181}, {"turn": float("nan")}, {"lost": (0, 1.1)},
                                   {"isolated": (-0.1, 0)}, {"lost": (float("nan"), 1)}])
def test_augmentations_that_cannot_be(wrong):
    with pytest.raises(ValueError, match="expected "):
        EventAugmentation(**wrong)


def test_events_in_one_signed_channel():
    signed = torch.tensor([[[0.5, -1.0, 0.0]]])
    assert (EventAugmentation(reverse=1).events(signed).tolist() == EventAugmentation(invert=1).events(signed).tolist()
            == [[[-0.5, 1, 0]]])
    torch.manual_seed(0)
    assert {tuple(EventAugmentation(drop=1).events(signed).flatten().tolist())
            for _ in range(20)} == {(0.5, 0, 0), (0, -1, 0)}
    volume = torch.arange(1.0, 7).reshape(6, 1, 1)  # three bins: positive 1, 2, 3, negative 4, 5, 6
    assert EventAugmentation(invert=1).events(volume).flatten().tolist() == [4, 5, 6, 1, 2, 3]


def test_another_sensor_s_threshold():
    """98 of 100 pixels with events have 1 to 98 of them, in two channels, and two have 200:
    the 98th percentile is 98 + 0.02 (200 - 98) of them."""
    counts = torch.tensor([*range(1, 99), 200, 200, *[0] * 28]).float().reshape(1, 8, 16)
    for volume in (torch.cat([0.25 * counts, 0.75 * counts]), counts, -counts):
        left = EventAugmentation(threshold=(0.5, 0.5)).sensor(volume)
        strongest = 98 + 0.02 * (200 - 98)
        assert torch.equal(left, torch.where(counts >= 0.5 * strongest, volume, torch.zeros(())))
    alike = torch.ones(2, 4, 4)
    assert torch.equal(EventAugmentation(threshold=(1, 1)).sensor(alike), alike)  # none has fewer than the strongest
    torch.manual_seed(3)
    least = [EventAugmentation(threshold=(0.1, 0.3)).sensor(counts)[counts > 0] for _ in range(200)]
    least = torch.stack([each[each > 0].min() for each in least])  # each draw has a threshold of its own
    assert 0.1 * strongest <= least.min() < 0.11 * strongest and 0.29 * strongest < least.max() <= 0.3 * strongest + 1


def test_another_sensor_s_lost_and_isolated_events():
    torch.manual_seed(5)
    volume = torch.ones(4, 100, 100)
    assert not EventAugmentation(lost=(1, 1)).sensor(volume).any()
    kept = EventAugmentation(lost=(0.4, 0.4)).sensor(volume)
    assert torch.equal(kept[0], kept[3])  # a pixel loses all of its events
    assert abs(float(kept.mean()) - 0.6) < 4 * (0.24 / 10_000) ** 0.5
    volume = torch.zeros(4, 100, 100)
    volume[0, 0, :50] = 2.0
    added = EventAugmentation(isolated=(0.02, 0.02)).sensor(volume) - volume
    places = added[:, 1:].nonzero()
    # 200 of 10,000, some at one place or in the first line
    assert 180 < len(places) <= 200 and set(places[:, 0].tolist()) == {0, 1, 2, 3}
    assert 0.6 <= added[:, 1:][added[:, 1:] != 0].min() and added.max() <= 2.0
    signed = EventAugmentation(isolated=(0.02, 0.02)).sensor(volume[:1])[:, 1:]
    assert 60 < (signed > 0).sum() < 140 and 60 < (signed < 0).sum() < 140
    everything = EventAugmentation(threshold=(0, 0.3), lost=(0, 0.4), isolated=(0.01, 0.03))
    assert not everything.sensor(torch.zeros(2, 8, 8)).any()  # nothing is as strong as nothing
    assert everything.sensor(torch.zeros(2, 0, 8)).shape == (2, 0, 8)


def test_another_sensor_of_a_volume_whatever_its_layout():
    # whole numbers, whose sums are exact in any order
    volume = torch.randint(4, (6, 8, 4)).float()
    sensor = EventAugmentation(threshold=(0.3, 0.3), isolated=(0.2, 0.2)).sensor
    torch.manual_seed(1)
    expected = sensor(volume)
    torch.manual_seed(1)
    assert torch.equal(sensor(volume.permute(1, 2, 0).contiguous().permute(2, 0, 1)), expected)


def test_a_sensor_that_is_left_alone_draws_nothing():
    """What is drawn without these settings is what was drawn before there were any."""
    volume, state = torch.rand(2, 4, 4), torch.get_rng_state()
    assert EventAugmentation().sensor(volume) is volume and torch.equal(torch.get_rng_state(), state)


def test_an_item_in_memory_is_changed_as_one_that_is_read(shards):
    augmentation = EventAugmentation(flip=0.5, scale=(0.5, 2), shift=0.2, threshold=(0, 0.3), lost=(0, 0.4),
                                     isolated=(0, 0.1))
    plain, changed = DetectionDataset(shards), DetectionDataset(shards, augmentation=augmentation)
    for i in range(len(shards)):
        item = plain[i]
        torch.manual_seed(i)
        once = augmentation(item)
        torch.manual_seed(i)
        again = changed[i]
        assert once.keys() == again.keys() and once["id"] == again["id"]
        for name in ("volume", "boxes", "labels", "ignore"):
            torch.testing.assert_close(once[name], again[name], atol=1e-5, rtol=0)
        assert torch.equal(item["volume"], plain[i]["volume"])


def test_an_augmentation_s_map():
    torch.manual_seed(1)
    only_flip = EventAugmentation(flip=1).affine(24, 32)
    np.testing.assert_allclose(only_flip, [[-1, 0, 31], [0, 1, 0]], atol=1e-12)
    maps = np.stack([EventAugmentation(flip=0.5, scale=(0.5, 2), shift=0.1).affine(24, 32) for _ in range(200)])
    assert 0.35 < np.mean(maps[:, 0, 0] < 0) < 0.65
    assert np.all((0.5 <= maps[:, 1, 1]) & (maps[:, 1, 1] <= 2)) and 0.9 < np.median(maps[:, 1, 1]) < 1.1
    middles = np.stack([move_points(np.array([15.5, 11.5]), each) for each in maps])
    assert np.all(np.abs(middles - [15.5, 11.5]) <= [3.2 + 1e-9, 2.4 + 1e-9])
