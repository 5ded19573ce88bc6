"""eventgan.Generator under what a process can do to it: forks while other threads compute, an end while they do,
signals, threads of all kinds. Each in a process of its own."""

import os
import subprocess
import sys

import pytest

SANITIZED = "LD_PRELOAD" in os.environ  # and GCC's AddressSanitizer has no handler for forks (LLVM 18 got one)
TIMEOUT_S = 600  # a process that waits for a lock which its fork has copied waits for ever

SET_UP = """
import os, signal, sys, threading, time, warnings
import numpy as np
import eventgan
warnings.simplefilter("ignore")
generator = eventgan.Generator("untrained:2", kind="network")
images = np.random.default_rng(5).integers(0, 256, (9, 40, 56), np.uint8)
expected = np.stack([generator(*pair) for pair in zip(images[:-1], images[1:])])
assert expected.any()
others = [eventgan.Generator("untrained:1", size=(24, 32), scope="motion"), eventgan.Generator(kind="difference")]

def one():
    assert np.array_equal(generator(images[0], images[1]), expected[0])

def batch():
    assert np.array_equal(generator.many(images[:-1], images[1:], threads=2), expected)

def rest():
    for other in others:
        other.sample(images[0], images[1], boxes=[[1, 2, 30, 20]])
    eventgan.sample_events(expected[0])
    eventgan.Generator("untrained:1")

def on(work):
    while not done:
        work()

done = False
threads = [threading.Thread(target=on, args=(work,), daemon=True) for work in (one, batch, rest)]
for thread in threads:
    thread.start()
"""

FORKS = """
for turn in range(int(sys.argv[1])):
    child = os.fork()
    if child == 0:
        code = 1
        try:
            signal.alarm(100)
            one()
            batch()
            rest()
            code = 0
        finally:
            os._exit(code)
    assert os.waitpid(child, 0)[1] == 0, turn
done = True
for thread in threads:
    thread.join()
print("done")
"""

END = """
import atexit
atexit.register(one)  # the thread that ends the process may still call
time.sleep(float(sys.argv[1]))
print("done", flush=True)
"""

JOINED_AT_THE_END = """
import atexit, queue, sys, threading
import numpy as np

def finish():
    images.put(None)
    worker.join()
    assert len(made) == 30
    print("done", flush=True)

def work():
    while (image := images.get()) is not None:
        made.append(generator(image, image))

if sys.argv[1] == "before":
    atexit.register(finish)
import eventgan
generator = eventgan.Generator(kind="difference")
if sys.argv[1] == "after":
    atexit.register(finish)
images, made, worker = queue.Queue(), [], threading.Thread(target=work, daemon=True)
worker.start()
for _ in range(30):
    images.put(np.zeros((16, 16), np.uint8))
"""

INTERRUPT = """
done = True
for thread in threads:
    thread.join()
done = False
many = np.broadcast_to(images[:1], (2_000_000 // images[0].size, *images[0].shape))
calls = [lambda: generator.many(many, many, threads=int(sys.argv[1])), lambda: on(one)]
for call in calls:
    timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    begun = time.monotonic()
    try:
        while True:
            call()
    except KeyboardInterrupt:
        assert time.monotonic() - begun < 100
    timer.join()
    one()
    assert threading.active_count() == 1
print("done")
"""


LITTLE_MEMORY = """
import resource, sys, warnings
import numpy as np
import eventgan
warnings.simplefilter("ignore")
generator = eventgan.Generator("untrained:8")
images = np.random.default_rng(5).integers(0, 256, (9, 200, 300), np.uint8)
generator(*images[:2])
used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + int(float(sys.argv[1]) * 2**20), -1))
try:
    generator.many(images[:-1], images[1:], threads=64)
except MemoryError:
    pass
print("done")
"""


def run(script, *arguments, set_up=SET_UP):
    done = subprocess.run([sys.executable, "-c", set_up + script, *map(str, arguments)], capture_output=True, text=True,
                          timeout=TIMEOUT_S)
    if "Cannot recover from MemoryErrors while normalizing" in done.stderr:
        pytest.skip("Python itself had no memory left to raise a MemoryError")
    assert (done.returncode, done.stdout, done.stderr) == (0, "done\n", "")


@pytest.mark.skipif(SANITIZED, reason="a fork copies the locks of the sanitizer's allocator")
def test_forks_while_other_threads_compute():
    run(FORKS, 25)


@pytest.mark.parametrize("after_s", [0, 0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5])
def test_python_ends_while_daemon_threads_compute(after_s):
    run(END, after_s)


@pytest.mark.parametrize("when", ["before", "after"])
def test_a_handler_at_the_end_may_join_a_thread_that_calls(when):
    """Whether it was registered before the package was loaded or after."""
    run(JOINED_AT_THE_END, when, set_up="")


@pytest.mark.parametrize("threads", [1, 3])
def test_ctrl_c_is_heard_between_the_pairs(threads):
    run(INTERRUPT, threads)


@pytest.mark.skipif(SANITIZED, reason="sanitizers take more address space than there is")
@pytest.mark.parametrize("megabytes", [0, 8, 20, 40, 60, 80, 120, 160, 240, 400])
def test_many_threads_in_little_memory(megabytes):
    run(LITTLE_MEMORY, megabytes, set_up="")
