"""A recording as DSEC-Det's and DAGr's dataset classes read it (github.com/uzh-rpg/dsec-det, commit db941c2;
github.com/uzh-rpg/dagr), with numpy and h5py, and half the size as DAGr's script makes it: rewritten from what they
do."""

import h5py
import numpy as np


class DsecSequence:
    """The images of a recording, and what lies from one to the next."""

    def __init__(self, path):
        self.times = np.genfromtxt(path / "images" / "timestamps.txt", dtype="int64")
        self.images = sorted((path / "images" / "left" / "distorted").glob("*.png"))
        self.tracks = np.load(path / "object_detections" / "left" / "tracks.npy")
        self.folder = path / "events" / "left"
        # Rows are counted off, image for image: they are in order, and each has the time of an image.
        self.counts = [np.count_nonzero(self.tracks["t"] == time) for time in self.times]

    def boxes(self, i):
        first = sum(self.counts[:i])
        return self.tracks[first:first + self.counts[i]]

    def events(self, i, name="events.h5"):
        """t, x, y, p from image i to the next: both are cut to the millisecond."""
        with h5py.File(self.folder / name) as file:
            offset, index = int(file["t_offset"][()]), file["ms_to_idx"][:].astype(int)
            first, last = (self.times[i:i + 2] - offset) // 1000
            assert 0 <= first < len(index)  # a negative one counts from the index's end
            rows = slice(index[first], index[min(last, len(index) - 1)])
            return [file[f"events/{name}"][rows].astype(int) + (offset if name == "t" else 0) for name in "txyp"]


def half_size(columns, size):
    """Of events t, x, y, p those with which the polarities of 2 x 2 pixels, since the last such event, sum up to four
    of one sign; in pixels of half the size (height, width), which the last row or column of an odd one has not."""
    sums, passed = np.zeros((size[0] // 2, size[1] // 2), int), []
    for i, (x, y, p) in enumerate(zip(*columns[1:])):
        if x // 2 < sums.shape[1] and y // 2 < sums.shape[0]:
            sums[y // 2, x // 2] += 1 if p else -1
            if abs(sums[y // 2, x // 2]) == 4:
                sums[y // 2, x // 2] = 0
                passed.append(i)
    t, x, y, p = (column[passed] for column in columns)
    return t, x // 2, y // 2, p
