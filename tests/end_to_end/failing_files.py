"""The program with a layer below it that lets a chosen change of its output folder fail, or kills it there.

The layer is interposer/failing_files.cc, which says what a rule is: "kill-before rename 2", "ENOSPC write 7+".
"""

import collections
import concurrent.futures
import os
import pathlib
import subprocess
import tempfile

import program

LAYER = pathlib.Path(os.environ["EVENTGAN_FAILING_FILES"])

Call = collections.namedtuple("Call", "kind path")
Outcome = collections.namedtuple("Outcome", "code out err calls struck")


def run(folder, rule, *arguments):
    """Runs the program, watched as it changes `folder`: exit code (-9: killed), what it printed, the calls in their
    order, and whether the rule came to strike."""
    with tempfile.NamedTemporaryFile(prefix="eventgan-calls-") as log:
        # By its name alone: LD_PRELOAD takes no path with a space.
        folders = ":".join([str(LAYER.parent), *filter(None, [os.environ.get("LD_LIBRARY_PATH")])])
        environment = {**os.environ, "LD_PRELOAD": LAYER.name, "LD_LIBRARY_PATH": folders,
                       "EVENTGAN_FAILING_RULE": rule, "EVENTGAN_FAILING_LOG": log.name,
                       "EVENTGAN_FAILING_FOLDER": str(pathlib.Path(folder).resolve())}
        done = subprocess.run([program.PROGRAM, *map(str, arguments)], capture_output=True, text=True, env=environment)
        lines = [line.split("\t") for line in pathlib.Path(log.name).read_text().splitlines()]
    calls = [Call(line[0], pathlib.Path(line[1])) for line in lines]
    return Outcome(done.returncode, done.stdout, done.stderr, calls, any(len(line) > 2 for line in lines))


def changes(calls):
    """Those that a rule for "any" counts: all but reading."""
    return [call for call in calls if call.kind not in ("open", "shut")]


def for_each(work, items):
    """work(item) for each, as many at a time as there are cores; the first exception comes out."""
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(work, items))


def thinned(calls, step=8):
    """Numbers (from 1) of the calls to try: of the many small writes by which HDF5 makes a file every `step`-th, the
    last one of each file, and every other call. A file under its temporary name is as unfinished after one such write
    as after the next."""
    last = {call.path: n for n, call in enumerate(calls, 1) if call.kind == "write"}
    return [n for n, call in enumerate(calls, 1)
            if call.kind != "write" or ".h5" not in call.path.name or n % step == 0 or last[call.path] == n]
