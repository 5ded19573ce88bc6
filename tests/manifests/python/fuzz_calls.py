#!/usr/bin/python3
"""Calls eventgan.Generator with what nobody should pass, and with what is just right: python3 fuzz_calls.py [CALLS]
[SEED].

A call ends with a sound volume or with one of the documented errors; under the address sanitizer it also touches no
memory that is not its own.
"""

import collections
import sys
import warnings

import numpy as np

import eventgan

DOCUMENTED = (ValueError, FileNotFoundError, MemoryError)
SETTINGS = {
    "weights": ["untrained:1", "untrained:2", "shipped:8", "untrained:0", "shipped:3", "nowhere", "", "a\0b", __file__,
                5],
    "kind": ["network", "esim", "difference", "events", "", None],
    "precision": ["float32", "bfloat16", "int8", "double", 8],
    "size": [None, (16, 16), (17, 40), (64, 33), (15, 16), (16,), "16", (16, 1e9), (-16, 16),
             (np.int64(20), np.int64(30))],
    "fit": ["stretch", "letterbox", "crop", "wide", 0],
    "preset": [None, "demo", "kitti", "mpii", "x"],
    "grey": [None, None, "before_resize", "after_resize", "x"],
    "blur": [None, None, 0, 3, 31, 4, -1, 2**40],
    "scope": ["whole", "motion", "labels", "labels_only", "x"],
    "normalize": ["none", "eta98", "x"],
    "seed": [0, 1, 2**63 - 1, 2**63, -1, 0.5, None],
    "bins": [9, 1, 2, 64, 65, 0],
    "tile_px": [16, 8, 128, 7],
    "motion_margin_px": [4, 0, 64, 65],
    "label_margin_px": [0, 1024, -1],
    "motion_threshold": [8, 0, 255, np.nan, "8"],
    "sensor": [{}, {"positive_threshold": 0.01}, {"shot_noise_rate_hz": 50},
               {"hot_pixel_fraction": 1, "hot_pixel_rate_hz": 20}, {"x": 1}, []],
    "duration_s": [0.1, 1e-4, 0, np.inf],
    "nothing": [1],
}
SIDES = [0] + [1, 2, 3, 5, 16, 17, 31, 64] * 3
DTYPES = [np.uint8] * 24 + [np.float32] * 9 + [np.float64, np.float16, ">f8", np.longdouble, np.int8, np.uint16,
                                               np.int64, bool, complex, object, "U3", "M8[s]"]


class Calls:
    def __init__(self, seed):
        self.random = np.random.default_rng(seed)
        self.generators = [eventgan.Generator("untrained:1"),
                           eventgan.Generator("untrained:2", size=(24, 40), fit="letterbox", scope="motion")]

    def pick(self, values):
        return values[self.random.integers(len(values))]

    def image(self, batch=False):
        shape = [self.pick(SIDES), self.pick(SIDES)]
        if self.random.random() < 0.4:
            shape.append(self.pick([3] * 12 + [1, 2, 4]))
        if batch != (self.random.random() < 0.05):
            shape.insert(0, self.pick([0, 1, 2, 5]))
        dtype = np.dtype(self.pick(DTYPES))
        if dtype.kind == "f":
            image = self.random.random(shape).astype(dtype)
            if image.size and self.random.random() < 0.1:
                image.flat[self.random.integers(image.size)] = self.pick([np.nan, np.inf, -1, 1.01, -0.0, 1e-300])
        else:
            image = self.random.integers(0, 256, shape).astype(np.uint8).astype(dtype)
        return self.laid_out(image)

    def laid_out(self, image):
        """The same numbers, or some of them, elsewhere in memory."""
        how = self.random.integers(8)
        if how == 1:
            image = image[::-1, ::-1]
        elif how == 2:
            image = np.asfortranarray(image)
        elif how == 3:
            image = image[::2]
        elif how == 4:
            image = np.broadcast_to(image[:1], image.shape) if len(image) else image
        elif how == 5:
            image = image.swapaxes(0, 1)
        elif how == 6 and image.dtype.itemsize > 1 and not image.dtype.hasobject:
            room = np.zeros(image.nbytes + 1, np.uint8)[1:]
            moved = np.ndarray(image.shape, image.dtype, room.data)
            moved[...] = image
            image = moved
        elif how == 7 and self.random.random() < 0.2:
            image = self.pick([None, 3, "image", [], [[1, 2], [3, 4]], {}, image.tolist(), np.ma.masked_array(image),
                               b"12"])
        return image

    def partner(self, image):
        """Mostly an image of the same shape."""
        if isinstance(image, np.ndarray) and self.random.random() < 0.9:
            return image.copy()
        return self.image()

    def labels(self):
        numbers = self.random.normal(20, 20, (self.pick([0, 1, 3]), 4))
        return self.pick([None, numbers, np.sort(numbers), numbers.tolist(), numbers[:, :3], np.full((2, 4), np.nan),
                          np.full((1, 4), 1e308), "boxes", {}])

    def represent(self):
        """Events, mostly in time order and within the image."""
        count = self.pick([0, 1, 5, 300])
        events = np.zeros(count, [("t", self.pick(["f8", "i8", "f4", "u4"])), ("x", "i4"), ("y", "u2"), ("p", "i1")])
        events["t"] = np.sort(self.random.integers(0, 10**6, count))
        events["x"], events["y"] = self.random.integers(0, 20, count), self.random.integers(0, 16, count)
        events["p"] = self.pick([1, -1]) * self.random.integers(0, 2, count)
        if count and self.random.random() < 0.2:
            row = self.random.integers(count)
            name, value = self.pick([("t", -1 if events["t"].dtype.kind == "i" else 0), ("x", -1), ("x", 2**31 - 1),
                                     ("y", 65535), ("p", 127)])
            events[name][row] = value
        array = eventgan.represent(
            self.pick([events] * 8 + [events[::2], events[["x", "y"]], {name: events[name] for name in "txyp"}, None,
                                      3]),
            self.pick(["histogram:10", "voxel:5", "voxel_normalized:3", "volume:2", "count", "time_surface:0.1",
                       "eros:8", "eros:49", "histogram:0", "count:1", "", "a\0b", None]),
            size=self.pick([(16, 20)] * 6 + [(1, 1), (15, 20), (0, 20), (2**31 - 1, 2**31 - 1), (16,), "16",
                                             (16, 2.5)]),
            window_s=self.pick([None, None, (0, 1), (0, 0), (1, 0), (-1e300, 1e300), (np.nan, 1), (0, np.inf), 5]))
        assert np.isfinite(array).all()

    def settings(self):
        """Few of them wrong, so that some generators come to be."""
        keys = self.random.permutation(list(SETTINGS))[: self.random.integers(1, 5)]
        return {key: SETTINGS[key][min(int(self.random.exponential(2)), len(SETTINGS[key]) - 1)] for key in keys}

    def call(self):
        generator = self.pick(self.generators)
        kind = self.random.integers(12)
        if kind == 0:
            made = eventgan.Generator(**{"weights": "untrained:1", **self.settings()})
            self.generators = [*self.generators[:2], *self.generators[2:][-4:], made]
            return
        if kind == 1:
            volume = self.pick([self.random.random((self.pick([0, 2, 4, 3, 18]), self.pick(SIDES), self.pick(SIDES))),
                                self.image()])
            eventgan.sample_events(volume, duration_s=self.pick([1, 0.1, 0, -1, np.nan, 1e-300]),
                                   seed=self.pick([0, 1, 2**31, -1, "x"]),
                                   counts=self.pick(["poisson", "rounded", "x"]))
            return
        if kind == 2 and self.random.random() < 0.5:
            self.represent()
            return
        if kind == 2:
            generator.source_to_volume(self.pick([1, 50, 0, -1, 1.5, 2**40]), self.pick([1, 50, 0, "x"]))
            return
        if kind == 3:
            generator.prepare(self.image())
            return
        if kind == 4:
            previous = self.image(batch=True)
            volume = generator.many(previous, self.partner(previous), threads=self.pick([1, 2, 5, 0, -1, "2", 10**9]))
        elif kind in (5, 6):
            previous = self.image()
            joints = self.pick([None, self.random.normal(20, 20, (2, 3, 2)), np.full((1, 4, 2), np.nan), [[1, 2]],
                                "joints"])
            volume = generator.sample(previous, self.partner(previous), boxes=self.labels(), joints=joints,
                                      gap=self.pick([1, 6, 100, 0, 2**40, None]))["volume"]
        else:
            previous = self.image()
            volume = generator(previous, self.partner(previous))
        assert volume.dtype == np.float32 and np.isfinite(volume).all() and (volume >= 0).all()


def main(calls=10_000, seed=0):
    warnings.simplefilter("ignore")
    made, ended = Calls(seed), collections.Counter()
    for _ in range(calls):
        try:
            made.call()
            ended["done"] += 1
        except DOCUMENTED as error:
            assert "expected" in str(error) or isinstance(error, MemoryError) or "because" in str(error), repr(error)
            ended[type(error).__name__] += 1
    print(dict(ended))
    assert ended["done"] > calls / 10 and ended["ValueError"] > calls / 10


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
