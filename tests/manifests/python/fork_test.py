"""eventgan.Generator in workers that are forked from a process in which every pool of threads has been at work:
PyTorch's, OpenCV's, the engine's."""

import subprocess
import sys

import pytest

pytest.importorskip("torch")
pytest.importorskip("cv2")
TIMEOUT_S = 240  # a worker that waits for a thread which the fork has not taken along waits for ever

SCRIPT = """
import os, sys, warnings
import cv2, numpy, torch
import eventgan
from torch.utils.data import DataLoader

warnings.simplefilter("ignore")
cv2.setNumThreads(2)
torch.set_num_threads(3)
random = numpy.random.default_rng(5)
images = [cv2.GaussianBlur(cv2.resize(small, (4000, 3000)), (31, 31), 0)
          for small in random.integers(0, 256, (4, 30, 40, 3), numpy.uint8)]
torch.randn(700, 700) @ torch.randn(700, 700)
torch.nn.functional.conv2d(torch.randn(1, 8, 200, 200), torch.randn(8, 8, 3, 3))

# large images are resized; made grey
generators = [eventgan.Generator("shipped:8", size=(256, 320), preset=preset) for preset in ("demo", "kitti")]
generators.append(eventgan.Generator("shipped:8", size=(256, 320), fit="letterbox", preset="mpii", scope="motion"))


class Volumes:
    def __len__(self):
        return 3 * len(generators)

    def __getitem__(self, index):
        generator, first = generators[index // 3], index % 3
        pair = images[first], images[first + 1]
        return generator(*pair), generator.many(*([image] * 2 for image in pair), threads=2)


expected = [Volumes()[index] for index in range(len(Volumes()))]
threads = len(os.listdir("/proc/self/task"))
assert threads > 2, threads  # there are pools that a fork could break
count = 0
# A DataLoader sets one thread in its workers; with more, as in a plain fork, an OpenMP loop of theirs would never end.
loader = DataLoader(Volumes(), None, num_workers=2, multiprocessing_context="fork",
                    worker_init_fn=lambda _: torch.set_num_threads(3))
for made, wanted in zip(loader, expected):
    for one, other in zip(made, wanted):
        assert numpy.array_equal(one, other)
        count += int(numpy.count_nonzero(other) > 0)
for index, wanted in enumerate(expected):
    assert numpy.array_equal(Volumes()[index][0], wanted[0])
print(count)
"""


def test_forked_workers_make_the_volumes_of_their_parent():
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=TIMEOUT_S)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "18\n"
