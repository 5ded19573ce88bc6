"""Each stage around the generator alone, in memory: time, bytes a second, pairs or frames a second."""

import json
import subprocess

from measuring.cores import pin_to
from measuring.report import Part, Table

PROGRAMS = "eventgan_*_benchmark"
OF_OTHER_PARTS = {"eventgan_engine_benchmark", "eventgan_cut_out_benchmark"}
# Google Benchmark's own arguments. Its repetitions are interleaved over all benchmarks of a program.
SETTINGS = {
    "full": ["--benchmark_min_time=0.3", "--benchmark_repetitions=5"],
    "quick": ["--benchmark_min_time=0.05", "--benchmark_repetitions=3"],
    "trial": ["--benchmark_min_time=0.001", "--benchmark_repetitions=1", "--benchmark_filter=-level:[469]"],
}
MS = {"ns": 1e-6, "us": 1e-3, "ms": 1.0, "s": 1e3}


def run_program(program, arguments):
    """Repetitions by benchmark's name."""
    done = subprocess.run([program, "--benchmark_format=json", "--benchmark_enable_random_interleaving=true",
                           *arguments],
                          stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=True,
                          preexec_fn=pin_to(1))
    runs = {}
    for run in sorted(json.loads(done.stdout)["benchmarks"], key=place_in_source):
        if run["run_type"] == "iteration":
            runs.setdefault(run["run_name"], []).append(run)
    return runs


def place_in_source(run):
    """They come as they were interleaved."""
    return run["family_index"], run["per_family_instance_index"]


def median_run(runs):
    return sorted(runs, key=lambda run: run["cpu_time"])[len(runs) // 2]


def measure(bench):
    table = Table("stages", ["stage", "benchmark", "ms", "slowest less fastest", "wall ms", "MB/s", "items/s"])
    programs = sorted(path for path in (bench.build / "tests").glob(PROGRAMS) if path.name not in OF_OTHER_PARTS)
    if not programs:
        raise SystemExit(f"expected programs {PROGRAMS}, got none, in {bench.build / 'tests'}")
    for program in programs:
        stage = program.name.removeprefix("eventgan_").removesuffix("_benchmark")
        for name, runs in run_program(program, SETTINGS[bench.effort]).items():
            times = [run["cpu_time"] * MS[run["time_unit"]] for run in runs]
            middle = median_run(runs)
            table.add(stage, name, sorted(times)[len(times) // 2], max(times) - min(times),
                      middle["real_time"] * MS[middle["time_unit"]],
                      middle["bytes_per_second"] / 1e6 if "bytes_per_second" in middle else "",
                      middle.get("items_per_second", ""))
    return Part([table])
