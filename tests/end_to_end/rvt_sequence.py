"""A preprocessed sequence as RVT's dataset classes read it (github.com/uzh-rpg/RVT, commit 515034c), and as its
preprocessing makes it, with numpy and h5py; their assertions stay."""

import contextlib
import importlib
import sys
import types
import unittest.mock

import h5py
import numpy as np


GEN1, GEN4 = (240, 304), (720, 1280)


def kept_boxes(boxes, size, split):
    """What scripts/genx/preprocess_dataset.py keeps of boxes, cut to where its frame ends."""
    boxes = boxes[["t", "x", "y", "w", "h", "class_id", "track_id", "class_confidence"]].astype(
        [(name, boxes.dtype[name]) for name in boxes.dtype.names])
    if size == GEN4:
        boxes = boxes[boxes["class_id"] <= 2]
    for begin, extent, side in (("x", "w", size[1]), ("y", "h", size[0])):
        end = np.clip(boxes[begin] + boxes[extent], 0, side - 1)
        boxes[begin] = np.clip(boxes[begin], 0, side - 1)
        boxes[extent] = end - boxes[begin]
    w, h = boxes["w"], boxes["h"]
    least, diagonal = (10, 30) if size == GEN1 else (5, 0)
    kept = (w >= least) & (h >= least) & (w ** 2 + h ** 2 >= diagonal ** 2)
    if split == "train":
        kept &= w <= 9 * size[1] // 10
    return boxes[kept]


def frame_times(label_times, size):
    """The times of object frames and the ends of representations, as the same script chooses them; of labels whose
    interval it does not know, every so many that 98 ms lie between."""
    step, between = 250000, 2
    if size != GEN1 and len(label_times) > 1:
        median = np.median(np.diff(label_times))
        step = int(np.ceil(98000 / median) * median)
        between = max(round(step / 50000), 1)
    label_times = [int(time) for time in label_times if time >= 100000]
    if not label_times:
        return [], []
    frames, ends = label_times[:1], list(reversed(range(label_times[0], 0, -50000)))[1:-1]
    for time in label_times[1:]:
        count = round((time - frames[-1]) / step)
        if count and abs(time - frames[-1] - count * step) <= 2000:
            ends += np.linspace(frames[-1], time, count * between + 1).astype(int)[:-1].tolist()
            frames.append(time)
    return frames, [*ends, frames[-1]]


def stacked_histogram(t, x, y, p, size, bins=10):
    """[2 T, H, W] of data/utils/representations.py, counts up to 10."""
    histogram = np.zeros((2, bins, *size), int)
    if len(t):
        share = (t - t[0]).astype("float32") / np.float32(max(t[-1] - t[0], 1))
        np.add.at(histogram, (p, np.minimum((share * np.float32(bins)).astype(int), bins - 1), y, x), 1)
    return np.minimum(histogram, 10).reshape(-1, *size)


class RvtSequence:
    """What SequenceBase and ObjectLabelFactory make of a sequence."""

    def __init__(self, path, representation, size):
        folder = path / "event_representations_v2" / representation
        with np.load(path / "labels_v2" / "labels.npz") as data:
            self.labels, self.label_idx = data["labels"], data["objframe_idx_2_label_idx"]
        self.repr_idx = np.load(folder / "objframe_idx_2_repr_idx.npy")
        self.repr_times = np.load(folder / "timestamps_us.npy")
        self.frame_times = np.load(path / "labels_v2" / "timestamps_us.npy")
        with h5py.File(*folder.glob("event_representations*.h5")) as file:
            assert file["data"].chunks == (1, *file["data"].shape[1:])
            self.data = file["data"][:]
        assert len(self.label_idx) == len(np.unique(self.labels["t"])) == len(self.repr_idx) == len(self.frame_times)
        x, y, w, h = (self.labels[name].astype("float32") for name in "xywh")
        for begin, extent, side in ((x, w, size[1]), (y, h, size[0])):
            assert (np.clip(begin + extent, 0, side - 1) - np.clip(begin, 0, side - 1) > 0).all()

    def frame(self, k):
        """Boxes, and the representation they are of."""
        end = self.label_idx[k + 1] if k + 1 < len(self.label_idx) else len(self.labels)
        assert end > self.label_idx[k]
        return self.labels[self.label_idx[k]:end], self.repr_idx[k]

    def labels_of(self, representation):
        """Boxes, or None, as _get_labels_from_repr_idx has them."""
        found = np.flatnonzero(self.repr_idx == representation)
        return self.frame(found[-1])[0] if len(found) else None

    def window(self, begin, end):
        """Representations and their labels."""
        assert 0 <= begin < end <= len(self.data)
        return self.data[begin:end].astype("float32"), [self.labels_of(i) for i in range(begin, end)]

    def random_access(self, length):
        """The samples of SequenceForRandomAccess: what ends with a labelled representation and is long enough."""
        first = next((k for k, place in enumerate(self.repr_idx) if place - length + 1 >= 0), len(self.repr_idx))
        return [self.window(place + 1 - length, place + 1) for place in self.repr_idx[first:]]

    def streams(self, length):
        """The samples of SequenceForIter with guaranteed labels: runs whose labels are no farther than that apart."""
        samples, stops = [], np.flatnonzero(np.diff(self.repr_idx) > length)
        for first, last in zip([0, *(stops + 1)], [*stops, len(self.repr_idx) - 1]):
            begin, end = max(self.repr_idx[first] - length + 1, 0), self.repr_idx[last] + 1
            for start in range(begin, end, length):
                samples.append(self.window(start, min(start + length, end)))
                assert any(labels is not None for labels in samples[-1][1])
        return samples


def columns_of(boxes, size, scale):
    """t, x, y, w, h, class_id of ObjectLabels, as scale_ leaves them."""
    x, y = scale * boxes["x"], scale * boxes["y"]
    right, bottom = (np.minimum(scale * (boxes[begin] + boxes[extent]), scale * side - 1)
                     for begin, extent, side in (("x", "w", size[1]), ("y", "h", size[0])))
    return np.stack([boxes["t"], x, y, right - x, bottom - y, boxes["class_id"]], 1)


@contextlib.contextmanager
def own_code(checkout):
    """Two functions that call RVT's own code in a checkout: one makes of a sequence's folder the samples of
    SequenceForRandomAccess and of SequenceForIter, each its representations and boxes; the other of a recording and its
    boxes a sequence's folder, as its preprocessing does of Gen1's. What it imports and does not need here are stubs."""
    names = {"torchdata.datapipes.map": {"MapDataPipe": object}, "torchdata.datapipes.iter": {"IterDataPipe": object},
             "omegaconf": {"DictConfig": dict, "OmegaConf": None, "MISSING": None},
             "numba": {"jit": lambda **_: lambda function: function},
             "einops": {"rearrange": lambda columns, _: np.stack(columns, 1)},
             "utils.preprocessing": {"_blosc_opts": lambda **_: {}},
             "utils.timers": {"TimerDummy": lambda timer_name: contextlib.nullcontext()},
             "utils.helpers": {"torch_uniform_sample_scalar": None},
             "data.utils.augmentor": {"RandomSpatialAugmentorGenX": None}}
    stubs = {name: types.ModuleType(name) for name in ("torchdata", "torchdata.datapipes", "utils", *names)}
    for name, members in names.items():
        vars(stubs[name]).update(members)
    importlib.import_module("torch")  # which can be imported once only: it stays
    with unittest.mock.patch.dict(sys.modules, stubs), unittest.mock.patch.object(sys, "path", [checkout, *sys.path]):
        random, streaming = (importlib.import_module(f"data.genx_utils.sequence_{name}")
                             for name in ("rnd", "for_streaming"))
        of_types = importlib.import_module("data.utils.types")
        kinds, keys = of_types.DatasetType, of_types.DataType

        def samples(path, representation, length, size):
            given = path, representation, length, kinds.GEN4 if size == GEN4 else kinds.GEN1, size == GEN4
            iterated = streaming.SequenceForIter.get_sequences_with_guaranteed_labels(*given)
            for sequences in ([random.SequenceForRandomAccess(*given, False)], iterated):
                yield [parts(each[i]) for each in sequences for i in range(len(each))]

        def parts(sample):
            count = len(sample[keys.EV_REPR]) - sum(sample[keys.IS_PADDED_MASK])
            labels = [sample[keys.OBJLABELS_SEQ][i] for i in range(count)]
            return (np.stack([each.numpy() for each in sample[keys.EV_REPR][:count]]),
                    [each and np.stack([each.get(name).numpy() for name in ("t", "x", "y", "w", "h", "class_id")], 1)
                     for each in labels])

        def preprocess(boxes, events, folder, bins):
            genx = importlib.import_module("scripts.genx.preprocess_dataset")
            keys, name = genx.DataKeys, f"stacked_histogram_dt=50_nbins={bins}"
            given = {keys.InNPY: boxes, keys.InH5: events, keys.OutLabelDir: folder / "labels_v2",
                     keys.OutEvReprDir: folder / "event_representations_v2" / name,
                     keys.SplitType: genx.split_name_2_type[boxes.parent.name]}
            for key in (keys.OutLabelDir, keys.OutEvReprDir):
                given[key].mkdir(parents=True)
            filters = types.SimpleNamespace(apply_psee_bbox_filter=True, apply_faulty_bbox_filter=True)
            genx.process_sequence("gen1", filters, genx.StackedHistogram(bins, *GEN1, 10), None, 50, 50, False, given)

        yield samples, preprocess
