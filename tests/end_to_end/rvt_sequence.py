"""A preprocessed sequence as RVT's dataset classes read it (github.com/uzh-rpg/RVT, commit 515034c), with numpy and
h5py; their assertions stay."""

import h5py
import numpy as np


class RvtSequence:
    """What SequenceBase and ObjectLabelFactory make of a sequence."""

    def __init__(self, path, representation, size):
        folder = path / "event_representations_v2" / representation
        with np.load(path / "labels_v2" / "labels.npz") as data:
            self.labels, self.label_idx = data["labels"], data["objframe_idx_2_label_idx"]
        self.repr_idx = np.load(folder / "objframe_idx_2_repr_idx.npy")
        self.repr_times = np.load(folder / "timestamps_us.npy")
        self.frame_times = np.load(path / "labels_v2" / "timestamps_us.npy")
        with h5py.File(folder / "event_representations.h5") as file:
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
