"""A forward pass on request: a process that has its network loaded and waits, so that engines can take turns."""

import contextlib
import json
import os
import subprocess
import tempfile

from measuring.cores import pin_to

# Helpers that spin while they wait would take the core from the next contender.
ENVIRONMENT = {"OMP_NUM_THREADS": "1", "OMP_WAIT_POLICY": "passive"}


class ContenderFailed(Exception):
    """Why a contender does not take part: the last line it wrote to stderr."""


class Contender(contextlib.AbstractContextManager):
    """See eager_baseline.py, python_caller.py and engines/engine_benchmark.cc for the requests."""

    def __init__(self, command, cores=1, environment=None):
        self._errors = tempfile.TemporaryFile("w+")
        self._process = subprocess.Popen([str(part) for part in command], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                         stderr=self._errors, text=True, preexec_fn=pin_to(cores),
                                         env={**os.environ, **ENVIRONMENT, **(environment or {})})
        try:
            greeting = self._answer()
        except ContenderFailed:
            self.__exit__()
            raise
        self.description = greeting["description"]
        self.native = greeting["native"]

    def __exit__(self, *_):
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait()
        self._errors.close()

    def set_input(self, size, path):
        """`path`: as write_input writes it."""
        self._ask(f"input {size[0]} {size[1]} {path}")

    def run(self):
        """{"wall_ms", "cpu_ms"} of one forward pass of each instance."""
        return self._ask("run")

    def error(self):
        """{"relative_l2", "relative_largest"} against LibTorch in float32."""
        return self._ask("error")

    def saturation(self):
        """{"share"} of the 8-bit activations that are clipped."""
        return self._ask("saturation")

    def amplification(self, change, tries):
        """{"l2", "largest", "relative_l2"}, the largest of so many changes of one "level" of one pixel,
        or of "noise" of 1e-6 everywhere."""
        return self._ask(f"{change} {tries}")

    def many(self, pairs, threads):
        """{"wall_ms", "cpu_ms", "caller_ms"} of one call of many(); python_caller.py alone, as the next."""
        return self._ask(f"many {pairs} {threads}")

    def epoch(self, pairs, workers, method):
        """{"wall_ms", "cpu_ms", "caller_ms"} of a DataLoader whose workers run already,
        processor time of these and of their caller."""
        return self._ask(f"epoch {pairs} {workers} {method}")

    def _ask(self, request):
        print(request, file=self._process.stdin, flush=True)
        return self._answer()

    def _answer(self):
        line = self._process.stdout.readline()
        if line:
            return json.loads(line)
        self._errors.seek(0)
        said = self._errors.read().strip().splitlines() or ["no word"]
        raise ContenderFailed(said[-1].removeprefix("error: "))
