#!/usr/bin/python3
"""eventgan.Generator as a server for python_call.py, which alternates it with the engine alone: it reads requests from
stdin, a line each, and answers with a line of JSON. The package must be on PYTHONPATH.

    input HEIGHT WIDTH FILE   the images as the engine gets them: [2, y, x], float32 in [-1, 1], raw; warms up
    run                       one call: {"wall_ms": ..., "cpu_ms": ...}
    many PAIRS THREADS        one call of many(), the same pair so many times: as above, and {"caller_ms": 0}
    epoch PAIRS WORKERS METHOD   of a DataLoader whose workers, started by "fork" or "spawn", run already and give
                              batches of four volumes: {"wall_ms": ..., "cpu_ms": ..., "caller_ms": ...}, processor
                              time of the workers and of this process
"""

import argparse
import gc
import json
import os
import pathlib
import sys
import time

for name in ("OMP_NUM_THREADS", "OMP_WAIT_POLICY"):  # as users have it, whatever the Contender says
    os.environ.pop(name, None)

import numpy as np
from eventgan import Generator

WARM_UP_CALLS = 3
BATCH = 4


def images_of(height, width, path):
    values = np.fromfile(path, np.float32).reshape(2, int(height), int(width))
    return list(np.round((values + 1) * 127.5).astype(np.uint8))


def timed(call):
    wall, cpu = time.perf_counter(), time.process_time()
    call()
    return {"wall_ms": 1e3 * (time.perf_counter() - wall), "cpu_ms": 1e3 * (time.process_time() - cpu)}


class Volumes:
    """For a DataLoader."""

    def __init__(self, generator, images, pairs):
        self._generator, self._images, self._pairs = generator, images, pairs

    def __len__(self):
        return self._pairs

    def __getitem__(self, index):
        return self._generator(*self._images)


def processor_ms(process):
    """Of all threads that a process has now."""
    return sum(int(path.read_text().split()[0])
               for path in pathlib.Path(f"/proc/{process}/task").glob("*/schedstat")) / 1e6


def epoch(volumes, workers, method):
    from torch.utils.data import DataLoader  # late: it is no part of a call
    loader = DataLoader(volumes, BATCH, num_workers=workers, multiprocessing_context=method, persistent_workers=True)

    def run():
        for _ in loader:
            pass

    run()  # starts them
    processes = [worker.pid for worker in loader._iterator._workers]
    before = [processor_ms(process) for process in processes]
    answer = timed(run)
    answer |= {"caller_ms": answer["cpu_ms"],
               "cpu_ms": sum(processor_ms(process) for process in processes) - sum(before)}
    loader = None
    gc.collect()  # ends them
    return answer


def answers(generator, requests):
    images = None
    for request in requests:
        word, *rest = request.split()
        if word == "input":
            images = images_of(*rest)
            for _ in range(WARM_UP_CALLS):
                volume = generator(*images)
            yield {"size": list(volume.shape[1:])}
        elif word == "run":
            yield timed(lambda: generator(*images))
        elif word == "many":
            pairs, threads = map(int, rest)
            batches = [np.stack([image] * pairs) for image in images]
            yield timed(lambda: generator.many(*batches, threads=threads)) | {"caller_ms": 0}
        elif word == "epoch":
            pairs, workers, method = rest
            yield epoch(Volumes(generator, images, int(pairs)), int(workers), method)
        else:
            raise SystemExit(f"expected input, run, many or epoch, got {request!r}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--weights", default="shipped")
    parser.add_argument("--precision", default="float32")
    arguments = parser.parse_args()
    generator = Generator(arguments.weights, precision=arguments.precision)
    print(json.dumps({"description": generator.description, "native": True}), flush=True)
    for answer in answers(generator, sys.stdin):
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
