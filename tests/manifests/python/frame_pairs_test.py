"""eventgan.torch.FramePairs: volumes of pairs of images, which depend on nothing but seed, epoch and index."""

import collections
import json
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest

torch = pytest.importorskip("torch")
from torch.utils.data import DataLoader, Subset

from eventgan.torch import (EventAugmentation, FrameAugmentation, FramePairs, collate_torchvision, collate_yolo)


class StandIn:
    """In place of a Generator: one bin, what became brighter, then what became darker, in grey levels; laid with a
    border of (left, top) into zeros of `size`, or as large as the images. Counts its calls."""

    bins, draws = 1, False

    def __init__(self, size=None, border=(0, 0), factor=1.0):
        self.size, self.border, self.factor, self.calls, self.gaps = size, border, factor, 0, []

    def __call__(self, previous, following, *, draw=0):
        assert draw == 0
        self.calls += 1
        images = [np.asarray(image) for image in (previous, following)]
        if images[0].shape != images[1].shape:
            raise ValueError(f"expected images of one size, got {images[0].shape} and {images[1].shape}")
        images = [(image * (1 if image.dtype == np.uint8 else 255.0)).astype(np.float32) for image in images]
        before, after = (image if image.ndim == 2 else image @ np.array([1, 0.5, 0.25], np.float32) for image in images)
        made = self.factor * np.stack([np.maximum(after - before, 0), np.maximum(before - after, 0)])
        volume = np.zeros((2, *(self.size or made.shape[1:])), np.float32)
        left, top = self.border
        volume[:, top:top + made.shape[1], left:left + made.shape[2]] = made
        return volume

    def sample(self, previous, following, *, boxes, gap, draw=0):
        self.gaps.append(gap)
        volume = self(previous, following)
        unclipped = np.asarray(boxes, float) + np.tile(self.border, 2)
        limits = [volume.shape[2], volume.shape[1]] * 2
        return {"volume": volume, "boxes": {"xyxy": np.clip(unclipped, 0, limits), "xyxy_unclipped": unclipped}}


def image(*values, height=4, width=6):
    """[H, W] uint8, black but for some pixels (x, y, value)."""
    made = np.zeros((height, width), np.uint8)
    for x, y, value in values:
        made[y, x] = value
    return made


def clips(count, frames=8):
    """Frame t of clip i has the value 10 t + i % 8, the target is i: the difference tells which frames were taken."""
    return [(np.stack([np.full((2, 3), 10 * t + i % 8, np.uint8) for t in range(frames)]), "sound", i)
            for i in range(count)]


VARIED = FrameAugmentation(reverse=0.5, gain=(0.5, 2), gamma=(0.7, 1.4))


def varied(**more):
    """Pairs of which everything is drawn."""
    settings = {"gap": (1, 3), "frame_augmentation": VARIED, "augmentation": EventAugmentation(drop=0.5, shift=0.5),
                "seed": 5}
    return FramePairs([StandIn(), StandIn(factor=0.5)], clips(12), **{**settings, **more})


def volumes(pairs, **loader):
    """{target: volume} as a DataLoader gives them."""
    found = {}
    for batch, targets in DataLoader(pairs, 3, **loader):
        found.update(zip(targets.tolist(), batch))
    return found


def same(one, other):
    return one.keys() == other.keys() and all(torch.equal(one[key], other[key]) for key in one)


def test_pairs_and_their_targets():
    first, second = image((1, 2, 10)), image((4, 2, 30))
    colour = np.stack([first, 2 * first, first], -1)
    pairs = FramePairs(StandIn(), [(first, second, 7), (first / np.float32(255), second / np.float32(255), "b"),
                                   (colour, 0 * colour, None)])
    assert len(pairs) == 3
    volume, target = pairs[0]
    assert target == 7 and volume.dtype == torch.float32 and volume.shape == (2, 4, 6)
    assert volume[0].nonzero().tolist() == [[2, 4]] and volume[1].nonzero().tolist() == [[2, 1]]
    assert volume[0, 2, 4] == 30 and volume[1, 2, 1] == 10
    torch.testing.assert_close(pairs[1][0], volume)
    assert pairs[2][0][1, 2, 1] == 10 * (1 + 2 * 0.5 + 0.25) and pairs[-1][1] is None
    with pytest.raises(IndexError, match="expected an item of 3, got number 3"):
        pairs[3]


@pytest.mark.parametrize("of", [torch.from_numpy, np.asarray])
def test_images_with_channels_first_or_last(of):
    colour = np.arange(4 * 5 * 3, dtype=np.uint8).reshape(4, 5, 3)
    expected = FramePairs(StandIn(), [(colour, 0 * colour, 0)])[0][0]
    other = colour.transpose(2, 0, 1)
    assert torch.equal(FramePairs(StandIn(), [(of(other), of(0 * other), 0)])[0][0], expected)
    grey = colour[..., 0]
    for one in (grey[None], grey[..., None]):
        assert torch.equal(FramePairs(StandIn(), [(of(one), of(0 * one), 0)])[0][0],
                           FramePairs(StandIn(), [(grey, 0 * grey, 0)])[0][0])


@pytest.mark.parametrize("reader", ["cv2", "PIL"])
def test_files(tmp_path, monkeypatch, reader):
    pytest.importorskip("PIL")
    from PIL import Image

    if reader == "cv2":
        pytest.importorskip("cv2")
    else:
        monkeypatch.setitem(sys.modules, "cv2", None)
    colour = np.zeros((4, 5, 3), np.uint8)
    colour[1, 2] = 40, 20, 8  # red, green, blue: 40 + 10 + 2
    Image.fromarray(colour).save(tmp_path / "colour.png")
    Image.fromarray(0 * colour).save(tmp_path / "black.png")
    Image.fromarray(colour[..., 0]).save(tmp_path / "grey.png")
    turned = Image.Exif()
    turned[0x112] = 6  # its right side is the top: shown turned by 90 degrees clockwise
    Image.new("L", (8, 16)).save(tmp_path / "turned.jpg", exif=turned)
    (tmp_path / "broken.png").write_bytes((tmp_path / "colour.png").read_bytes()[:50])
    (tmp_path / "none.png").write_text("none")
    at = tmp_path.joinpath
    source = [(at("black.png"), str(at("colour.png")), 0), (at("grey.png"), np.zeros((4, 5), np.uint8), 0),
              (at("turned.jpg"), at("turned.jpg"), 0), (at("black.png"), at("gone.png"), 0),
              (at("none.png"), at("black.png"), 0), (at("broken.png"), at("black.png"), 0)]
    pairs = FramePairs(StandIn(), source)
    assert pairs[0][0].nonzero().tolist() == [[0, 1, 2]] and pairs[0][0][0, 1, 2] == 52
    assert pairs[1][0][1, 1, 2] == 40
    assert pairs[2][0].shape == (2, 8, 16)
    with pytest.raises(FileNotFoundError, match=r"no such file, in .*gone.png, in item 3"):
        pairs[3]
    for index in (4, 5):
        with pytest.raises(ValueError,
                           match=rf"expected an image, got none.*, in .*(none|broken).png, in item {index}"):
            pairs[index]


def test_a_callable_and_a_clip_of_files(tmp_path):
    image_module = pytest.importorskip("PIL.Image")
    paths = [tmp_path / f"{t}.png" for t in range(4)]
    for t, path in enumerate(paths):
        image_module.fromarray(np.full((2, 3), 10 * t, np.uint8)).save(path)
    pairs = FramePairs(StandIn(), lambda index: (paths, index), gap=2, length=5)
    assert len(pairs) == 5 and [target for _, target in (pairs[i] for i in range(5))] == [0, 1, 2, 3, 4]
    assert torch.equal(pairs[0][0][0], torch.full((2, 3), 20.0))
    with pytest.raises(ValueError, match="expected a source with a length, or `length`, got function alone"):
        FramePairs(StandIn(), lambda index: None)


def test_gaps_are_drawn_from_all_of_the_range():
    pairs = FramePairs(StandIn(), clips(300), gap=(1, 6))
    seen = collections.Counter()
    for i in range(300):
        gap = pairs.drawn(i).gap
        assert torch.equal(pairs[i][0][0], torch.full((2, 3), 10.0 * gap))  # frames 7 - gap and 7
        seen[gap] += 1
    # 50 of each are expected, with a deviation of sqrt(300 x 1/6 x 5/6) = 6.5: four of them
    assert set(seen) == {1, 2, 3, 4, 5, 6} and all(24 <= count <= 76 for count in seen.values())
    assert {FramePairs(StandIn(), clips(9), gap=2).drawn(i).gap for i in range(9)} == {2}


def test_video_layouts():
    colour = np.arange(3 * 4 * 5 * 3, dtype=np.uint8).reshape(3, 4, 5, 3)
    expected = StandIn()(colour[1], colour[2])
    for clip in (colour, torch.from_numpy(colour), torch.from_numpy(colour.transpose(0, 3, 1, 2)), list(colour)):
        assert torch.equal(FramePairs(StandIn(), [(clip, 0)], gap=1)[0][0], torch.from_numpy(expected))
    assert torch.equal(FramePairs(StandIn(), [(colour[..., 0], 0)], gap=2)[0][0],
                       torch.from_numpy(StandIn()(colour[0, ..., 0], colour[2, ..., 0])))


def test_reversed_time():
    first, second, third = (image((x, 1, 9)) for x in (1, 2, 3))
    generator, backwards = StandIn(), {"frame_augmentation": FrameAugmentation(reverse=1)}
    boxes = {"boxes": [[1, 1, 2, 2]], "labels": [0]}
    assert torch.equal(FramePairs(generator, [(first, second, 0)], **backwards)[0][0],
                       torch.from_numpy(generator(second, first)))
    for clip, label_frame, images, position in [
            ([first, second], -1, (second, first), 0.0),  # the target's frame is the second, now at the start
            ([first, second, third], 1, (third, second), 1.0),  # of one after it to it: it stays at the end
            ([first, second, third], -1, (third, second), 0.0)]:
        pairs = FramePairs(generator, [(clip, boxes)], gap=1, label_frame=label_frame, **backwards)
        assert torch.equal(pairs[0]["volume"],
                           torch.from_numpy(generator(*images))) and pairs[0]["label_position"] == position
    assert [FramePairs(generator, [(first, second, boxes)], **settings)[0]["label_position"]
            for settings in ({}, backwards)] == [1, 0]
    half = FramePairs(generator, clips(400), gap=1, frame_augmentation=FrameAugmentation(reverse=0.5))
    drawn = [half.drawn(i).reversed for i in range(400)]
    assert 160 <= sum(drawn) <= 240  # four deviations of sqrt(400) / 2
    assert [bool(half[i][0][1].any()) for i in range(400)] == drawn  # clips grow brighter


def test_gain_and_gamma():
    black, pixels = image(), image((0, 0, 64), (1, 0, 128), (2, 0, 255))
    doubled = FramePairs(StandIn(), [(black, pixels, 0)], frame_augmentation=FrameAugmentation(gain=(2, 2)))[0][0]
    assert doubled[0, 0].tolist() == [128, 255, 255, 0, 0, 0]
    squared = {"frame_augmentation": FrameAugmentation(gain=(0.5, 0.5), gamma=(2, 2))}
    # 255/2 (v/255)^2: 64 -> 8.03, 128 -> 32.1, 255 -> 127.5, and numpy rounds halves to even
    assert FramePairs(StandIn(), [(black, pixels, 0)], **squared)[0][0][0, 0].tolist() == [8, 32, 128, 0, 0, 0]
    floats = [each / np.float32(255) for each in (black, pixels)]
    np.testing.assert_allclose(FramePairs(StandIn(), [(*floats, 0)], **squared)[0][0][0, 0],
                               [64**2 / 510, 128**2 / 510, 127.5, 0, 0, 0], rtol=1e-5)
    both = FramePairs(StandIn(), [(pixels, pixels, 0)], frame_augmentation=VARIED)
    for epoch in range(5):  # one exposure for both images: no events where nothing changes
        both.set_epoch(epoch)
        assert not both[0][0].any()
    pairs = FramePairs(StandIn(), clips(400), frame_augmentation=VARIED)
    drawn = [pairs.drawn(i) for i in range(400)]
    for values, (low, high) in (([each.gain for each in drawn], VARIED.gain),
                                ([each.gamma for each in drawn], VARIED.gamma)):
        assert low <= min(values) < max(values) <= high
        # uniform in the logarithm: a mean of zero here (0.5 x 2 = 1; 0.7 x 1.4 = 0.98), whose deviation is width /
        # sqrt(12 x 400)
        assert abs(np.mean(np.log(values)) - np.log(low * high) / 2) < 4 * np.log(high / low) / np.sqrt(12 * 400)


def test_several_generators():
    pairs = FramePairs([StandIn(), StandIn(factor=3)], clips(200), gap=1)
    drawn = [pairs.drawn(i).generator for i in range(200)]
    assert 72 <= sum(drawn) <= 128  # four deviations of sqrt(200) / 2
    assert [float(pairs[i][0].max()) for i in range(200)] == [30.0 if each else 10.0 for each in drawn]
    other = StandIn()
    other.bins = 2
    with pytest.raises(ValueError, match=r"expected generators with one number of bins, got \[1, 2\]"):
        FramePairs([StandIn(), other], clips(1))


def test_what_is_drawn_depends_on_seed_epoch_and_index_alone():
    pairs = varied()
    before = torch.random.get_rng_state()
    first = [pairs.drawn(i) for i in range(12)]
    items = {i: pairs[i][0] for i in range(12)}
    assert torch.equal(torch.random.get_rng_state(), before)  # nobody else's numbers are used
    torch.manual_seed(99)
    assert all(torch.equal(pairs[i][0], items[i]) for i in reversed(range(12))) and pairs.drawn(-1) == first[11]
    assert [varied().drawn(i) for i in range(12)] == first
    assert len({each.gain for each in first}) == 12
    pairs.set_epoch(1)
    second = [pairs.drawn(i) for i in range(12)]
    assert not set(first) & set(second) and [varied(seed=6).drawn(i) for i in range(12)] != first
    pairs.set_epoch(0)
    assert [pairs.drawn(i) for i in range(12)] == first
    # One more kind of augmentation moves nothing of the others.
    plain = varied(frame_augmentation=FrameAugmentation(gain=VARIED.gain), gap=(1, 2))
    assert [plain.drawn(i).gain for i in range(12)] == [each.gain for each in first]


@pytest.mark.parametrize("context", ["fork", "spawn"])
def test_workers_make_what_none_makes(context):
    pairs = varied(cache_bytes=1 << 20)
    workers = {"num_workers": 2, "multiprocessing_context": context, "persistent_workers": True}
    loader = DataLoader(pairs, 3, shuffle=True, **workers)
    for epoch in (0, 1, 0):  # in workers that go on running, too
        pairs.set_epoch(epoch)
        found = {}
        for batch, targets in loader:
            found.update(zip(targets.tolist(), batch))
        assert same(found, volumes(pairs))
    pairs.set_epoch(1)
    assert not same(found, volumes(pairs))
    assert same(volumes(Subset(pairs, [7, 2])), {i: volumes(pairs)[i] for i in (7, 2)})


def test_a_copy_goes_on_where_it_was():
    pairs = varied(cache_bytes=1000)
    pairs.set_epoch(3)
    copy = pickle.loads(pickle.dumps(pairs))
    assert same(volumes(copy), volumes(pairs)) and copy.drawn(4) == pairs.drawn(4)
    copy.set_epoch(4)
    assert pairs.drawn(4) != copy.drawn(4)


SIZED = {"size": (8, 10), "border": (2, 3)}  # into which an image of 4x6 is laid


def test_items_with_boxes():
    target = {"boxes": [[1, 0, 3, 2], [-4, 1, 1, 3], [0, 0, 6, 4], [4, 4, 5, 5.5]],
              "labels": ["car", "dog", "DontCare", "van"], "ignore": [False, False, False, True], "id": "street"}
    generator = StandIn(**SIZED)
    source = [(image(), image((1, 0, 9)), target), (image(), image(), {"boxes": [], "labels": []})]
    pairs = FramePairs(generator, source, classes={"car": 0, "van": 0})
    item = pairs[0]
    assert item["volume"].shape == (2, 8, 10) and item["volume"].nonzero().tolist() == [[0, 3, 3]]
    assert item["boxes"].tolist() == [[3, 3, 5, 5], [2, 3, 8, 7], [6, 7, 7, 8]] and item["boxes"].dtype == torch.float32
    assert item["labels"].tolist() == [0, -1, 0] and item["ignore"].tolist() == [False, True, True]
    assert (item["id"], item["index"],
            item["label_position"]) == ("street", 0, 1.0) and pairs.classes == {"car": 0, "van": 0}
    empty = pairs[1]
    assert (empty["boxes"].shape == (0, 4) and empty["labels"].dtype == torch.int64
            and empty["ignore"].dtype == torch.bool and empty["id"] == "1")
    imgs, targets, ids = collate_yolo([item, empty])
    assert imgs.shape == (2, 2, 8, 10) and ids == ["street", "1"]
    np.testing.assert_allclose(targets, [[0, 0, 4 / 10, 4 / 8, 2 / 10, 2 / 8]])
    images, targets = collate_torchvision([item, empty])
    assert len(images) == 2 and targets[0]["labels"].tolist() == [1] and targets[0]["boxes"].tolist() == [[3, 3, 5, 5]]
    assert generator.gaps == [1, 1]
    numbered = {"boxes": torch.tensor([[0.0, 0, 1, 1], [1, 1, 2, 2]]), "labels": torch.tensor([3, -1])}
    clip = FramePairs(generator, [([image(), image(), image()], numbered)], gap=2)
    assert (clip[0]["labels"].tolist() == [3, -1] and clip[0]["ignore"].tolist() == [False, True]
            and generator.gaps[-1] == 2)


def test_boxes_that_the_volume_cuts_are_ignored_by_what_is_left():
    boxes = {"boxes": [[-3.9, 0, 1, 2], [-2.9, 0, 1, 2]], "labels": [0, 0]}  # 20 % and 26 % are left
    assert FramePairs(StandIn(), [(image(), image(), boxes)])[0]["ignore"].tolist() == [True, False]


def test_boxes_move_with_the_volume():
    """A bright block: its box is around its events, mirrored, moved by parts of pixels and cut, whatever was drawn."""
    block = np.zeros((4, 6), np.uint8)
    block[1:3, 2:5] = 200
    source = [(0 * block, block, {"boxes": [[2, 1, 5, 3]], "labels": [0]})]
    for flip in (0, 1):
        item = FramePairs(StandIn(**SIZED), source, augmentation=EventAugmentation(flip=flip))[0]
        columns = (3, 4, 5) if flip else (4, 5, 6)  # 2 + 2 and on; of 10 columns mirrored
        assert item["boxes"].tolist() == [[columns[0], 4, columns[-1] + 1, 6]]
        assert item["volume"][0].nonzero().tolist() == [[y, x] for y in (4, 5) for x in columns]
    pairs = FramePairs(StandIn(**SIZED), source, augmentation=EventAugmentation(shift=0.6))
    whole = cut = 0
    for epoch in range(60):
        pairs.set_epoch(epoch)
        item = pairs[0]
        events = item["volume"][0]
        for left, top, right, bottom in item["boxes"].tolist():
            rows, columns = (events.sum(axis).nonzero().flatten().tolist() for axis in (1, 0))
            # whose pixels the box touches
            assert left - 1 < columns[0] and columns[-1] < right and top - 1 < rows[0] and rows[-1] < bottom
            if ((right - left, bottom - top) == pytest.approx((3, 2), abs=1e-5) and 0.5 < left and right < 9.5
                and 0.5 < top and bottom < 7.5):
                whole += 1
                middle = [float((events.sum(axis) * torch.arange(events.shape[1 - axis])).sum() / events.sum()) + 0.5
                          for axis in (0, 1)]
                assert middle == pytest.approx([(left + right) / 2, (top + bottom) / 2], abs=1e-4)
            else:
                cut += 1
    assert whole > 10 and cut > 10


def test_the_cache_counts_its_hits_and_keeps_within_its_bytes():
    generator = StandIn()
    nbytes = 2 * 2 * 3 * 4  # of a volume of clips(): [2, 2, 3] float32
    pairs = FramePairs(generator, clips(3), gap=1, cache_bytes=3 * nbytes - 1)
    first = pairs[0][0].clone()
    assert pairs.cache_info() == (0, 1, nbytes)
    pairs[0][0].zero_()  # what was handed out is the caller's own
    assert torch.equal(pairs[0][0], first)
    assert pairs.cache_info() == (2, 1, nbytes) and generator.calls == 1
    pairs[1], pairs[0], pairs[2]  # 1 was used longest ago and goes
    assert pairs.cache_info() == (3, 3, 2 * nbytes) and generator.calls == 3
    pairs[0], pairs[2]
    assert pairs.cache_info() == (5, 3, 2 * nbytes)
    pairs[1]
    assert pairs.cache_info() == (5, 4, 2 * nbytes) and generator.calls == 4
    pairs.set_epoch(1)  # nothing is drawn: the same volumes
    pairs[1]
    assert pairs.cache_info() == (6, 4, 2 * nbytes)


def test_the_cache_knows_what_was_drawn_but_for_the_augmentation_of_volumes():
    generator = StandIn()
    moved = FramePairs(generator, clips(1), gap=1, augmentation=EventAugmentation(shift=1), cache_bytes=1 << 20)
    kinds = set()
    for epoch in range(10):
        moved.set_epoch(epoch)
        kinds.add(tuple(moved[0][0].flatten().tolist()))
    assert moved.cache_info().hits == 9 and generator.calls == 1 and len(kinds) == 10
    exposed = varied(cache_bytes=1 << 20, augmentation=None)
    gaps = FramePairs(StandIn(), clips(1), gap=(1, 3), cache_bytes=1 << 20)
    for epoch in range(30):
        for pairs in (exposed, gaps):
            pairs.set_epoch(epoch)
        assert torch.equal(gaps[0][0][0], torch.full((2, 3), 10.0 * gaps.drawn(0).gap))
        exposed[0]
    assert exposed.cache_info().hits == 0 and gaps.cache_info()[:2] == (27, 3)


def test_a_cache_without_room_keeps_nothing():
    for cache_bytes in (0, 47):
        generator = StandIn()
        pairs = FramePairs(generator, clips(1), gap=1, cache_bytes=cache_bytes)
        assert torch.equal(pairs[0][0], pairs[0][0]) and generator.calls == 2 and pairs.cache_info() == (0, 2, 0)


BOX = [[0, 0, 1, 1]]


@pytest.mark.parametrize(("item", "settings", "expected"), [
    ((1, 2), {}, r"expected \(previous, following, target\), got a tuple of 2 \(`gap` is for clips\)"),
    (np.zeros((3, 4, 5)), {}, r"expected \(previous, following, target\), got float64 \[3, 4, 5\]"),
    ((None, image(), 0), {}, r"expected an image \[H, W\], .* or a file, got object \[\]"),
    ((np.zeros((4, 5, 2), np.uint8), image(), 0), {}, r"expected an image .*, got uint8 \[4, 5, 2\]"),
    ((np.zeros(4, np.uint8), image(), 0), {}, r"expected an image .*, got uint8 \[4\]"),
    ((image(width=5), image(), 0), {}, r"expected images of one size, got \(4, 5\) and \(4, 6\)"),
    ((np.full((4, 6), np.nan), image(), 0), {"frame_augmentation": VARIED},
     r"numbers from 0 to 1, got float64 \[4, 6\]"),
    ((image().astype(int), image(), 0), {"frame_augmentation": VARIED},
     r"expected an image of uint8 or of numbers from 0 to 1, got int64 \[4, 6\]"),
    ((image(), image(), {"boxes": [[0, 0, 1]], "labels": [0]}), {}, r"expected boxes \[n, 4\].*got \(1, 3\)"),
    ((image(), image(), {"boxes": BOX, "labels": [0, 1]}), {},
     r"expected boxes \[n, 4\].*, got \(1, 4\), \(2,\), \(1,\)"),
    ((image(), image(), {"boxes": BOX}), {}, r"expected boxes \[n, 4\].*, got \(1, 4\), \(0,\)"),
    ((image(), image(), {"boxes": [[0, 0, np.inf, 1]], "labels": [0]}), {},
     r"expected boxes \[n, 4\] of finite numbers"),
    ((image(), image(), {"boxes": BOX, "labels": ["car"]}), {},
     r"expected whole numbers as labels, got <U3 \(names need `classes`\)"),
    ((image(), image(), {"boxes": BOX, "labels": [1]}), {"classes": ["car"]},
     r"expected names of classes as labels, got \[1\]"),
    ((image(), 0), {"gap": 6}, r"expected a clip whose frame -1 is at least 6 behind the first, got 4 frames"),
    (([image()] * 4, 0), {"gap": 1, "label_frame": 4},
     r"expected a clip whose frame 4 is at least 1 behind the first, got 4 frames"),
    (("clip.mp4", 0), {"gap": 1}, r"expected \(frames, ..., target\), got a tuple of 2"),
])
def test_wrong_items_are_named(item, settings, expected):
    good = {"boxes": BOX, "labels": ["car"]} if "classes" in settings else 0
    pairs = FramePairs(StandIn(), [([image()] * 9, good) if "gap" in settings else (image(), image(), good), item],
                       **settings)
    pairs[0]
    with pytest.raises(ValueError, match=expected + ".*, in item 1$"):
        pairs[1]


@pytest.mark.parametrize("settings", [{"gap": 0}, {"gap": (2, 1)}, {"seed": -1}, {"seed": 2**64}])
def test_settings_that_cannot_be(settings):
    with pytest.raises(ValueError, match="expected "):
        FramePairs(StandIn(), clips(1), **settings)
    with pytest.raises(ValueError, match="expected an epoch of at least 0, got -1"):
        FramePairs(StandIn(), clips(1)).set_epoch(-1)


@pytest.mark.parametrize("settings",
                         [{"reverse": 1.5}, {"reverse": -1}, {"gain": (0, 1)}, {"gain": (2, 1)}, {"gamma": (1, np.inf)},
                          {"gamma": (np.nan, 1)}])
def test_augmentations_that_cannot_be(settings):
    with pytest.raises(ValueError, match="expected "):
        FrameAugmentation(**settings)


def test_errors_of_the_source_are_its_own():
    def source(index):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        FramePairs(StandIn(), source, length=1)[0]


@pytest.mark.parametrize(("fit", "size", "scale", "border"),
                         [("letterbox", (24, 40), 1, (4, 0)), ("crop", (40, 64), 2, (0, -4))])
def test_boxes_of_the_generator_are_exact(fit, size, scale, border):
    """A bright block in an image of 24x32: into 24x40 letterboxed it stays as it is, 4 columns to the right; cropped to
    40x64 it is doubled, and 4 rows are lost at the top."""
    pytest.importorskip("eventgan._engine")
    from eventgan import Generator

    block = np.zeros((24, 32), np.uint8)
    block[8:14, 10:18] = 255
    box = [10, 8, 18, 14]
    source = [(0 * block, block, {"boxes": [box], "labels": [0]})]
    generator = Generator(kind="difference", size=size, fit=fit, preset="mpii", sensor={"threshold_spread": 0})
    for flip in (0, 1):
        item = FramePairs(generator, source, augmentation=EventAugmentation(flip=flip))[0]
        left, top, right, bottom = (scale * edge + border[number % 2] for number, edge in enumerate(box))
        if flip:
            left, right = size[1] - right, size[1] - left
        assert item["boxes"].tolist() == [[left, top, right, bottom]]
        rows, columns = np.nonzero(item["volume"].sum(0).numpy())
        # Doubled by bilinear interpolation, the block's edge is blurred over one pixel to the outside.
        blurred = scale - 1
        assert (columns.min(), rows.min(),
                columns.max() + 1, rows.max() + 1) == (left - blurred, top - blurred, right + blurred, bottom + blurred)


def test_items_are_those_of_shards(tmp_path, monkeypatch):
    """What `convert` makes of the same images with the same settings, to the bit; boxes and what is to be ignored,
    too."""
    pytest.importorskip("eventgan._engine")
    program = os.environ.get("EVENTGAN_PROGRAM") or pytest.skip("no EVENTGAN_PROGRAM")
    from eventgan import Generator, Shards
    from eventgan.torch import DetectionDataset

    monkeypatch.chdir(tmp_path)
    subprocess.run([program, "make-demo", "."], check=True, capture_output=True)
    (tmp_path / "manifest.json").write_text(json.dumps({
        "format": "eventgan-manifest", "version": 1, "name": "demo", "seed": 7,
        "sources": [{"dataset": "kitti_object", "root": "kitti/training",
                     "pairs": {"gaps": [1, 2], "side": "before", "choose": "one"}}],
        "image": {"height": 50, "width": 130, "fit": "crop", "preset": "kitti"},
        "generator": {"weights": "untrained:4"}, "output": {"directory": "out", "dtype": "float32"}}))
    subprocess.run([program, "convert", "manifest.json", "--progress", "none"], check=True, capture_output=True)
    shards = Shards("out")
    expected = DetectionDataset(shards)
    source = []
    for i in range(len(shards)):
        sample, names = shards.labels(i), shards.class_names(i)
        boxes, pair = sample["boxes"], sample["pair"]
        labels = [names[each] for each in boxes["class_id"]]
        source.append((pair["prev_path"], pair["next_path"],
                       {"boxes": boxes["xyxy_source"], "labels": labels, "ignore": boxes["ignore"],
                        "id": pair["sample_id"]}))
    generator = Generator("untrained:4", precision="float32", size=(50, 130), fit="crop", preset="kitti", seed=7)
    pairs = FramePairs(generator, source, classes=expected.classes)
    assert len(pairs) == 12 and sum(len(item["boxes"]) for item in map(expected.__getitem__, range(12))) > 50
    for i in range(12):
        made, stored = pairs[i], expected[i]
        assert made["id"] == stored["id"]
        assert all(torch.equal(made[name], stored[name]) for name in ("volume", "boxes", "labels", "ignore"))


@pytest.mark.parametrize("settings", [
    {"weights": "shipped:sensor"}, {"kind": "difference", "sensor": {"threshold": [0.1, 0.9]}}, {"kind": "difference"},
    {"weights": "untrained:2", "sensor": {"noise": {"shot_hz": 20}}}, {"kind": "esim"}], ids=str)
@pytest.mark.parametrize("boxes", [False, True])
@pytest.mark.filterwarnings("ignore")
def test_each_epoch_draws_anew(settings, boxes):
    pytest.importorskip("eventgan._engine")
    from eventgan import Generator

    images = np.random.default_rng(1).integers(0, 256, (3, 24, 30), np.uint8)
    target = {"boxes": [[1, 2, 20, 20]], "labels": [0]} if boxes else 0
    generator = Generator(**settings)
    pairs = FramePairs(generator, [(*images[:2], target), (*images[1:], target), (*images[:2], target)],
                       cache_bytes=1 << 24)

    def made():
        return [(each["volume"] if boxes else each[0]).numpy() for each in pairs]

    first = made()
    pairs.set_epoch(1)
    second = made()
    assert all((one != other).any() for one, other in zip(first, second))
    assert (first[0] != first[2]).any()  # another item of the same images
    pairs.set_epoch(0)
    assert all((one == other).all() for one, other in zip(first, made()))
    assert pairs.cache_info().hits == 3  # the last epoch's
    assert all((generator(*images[:2]) == generator(*images[:2], draw=0)).all() for _ in range(2))
    plain = Generator("untrained:2")
    assert not plain.draws and (plain(*images[:2]) == plain(*images[:2], draw=9)).all()


def test_the_generator_s_volumes_in_workers():
    pytest.importorskip("eventgan._engine")
    from eventgan import Generator

    random = np.random.default_rng(1)
    source = [(random.integers(0, 256, (2, 24, 30), np.uint8), i) for i in range(6)]
    generator = Generator("untrained:4", seed=3)
    pairs = FramePairs(generator, source, gap=1, frame_augmentation=FrameAugmentation(reverse=0.5))
    for i in range(6):
        clip = source[i][0][::-1] if pairs.drawn(i).reversed else source[i][0]
        np.testing.assert_array_equal(pairs[i][0], generator(*clip))
    for context in ("fork", "spawn"):
        assert same(volumes(pairs, num_workers=2, multiprocessing_context=context), volumes(pairs))
