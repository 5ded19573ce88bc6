"""What the numbers were measured on."""

import os
import platform
import subprocess

from measuring.cores import usable

# Of the hundred and more that /proc/cpuinfo lists, those that engines choose their kernels by.
TELLING_FLAGS = ["avx2", "fma", "avx512f", "avx512_vnni", "avx_vnni", "avx512_bf16", "avx512_fp16", "amx_tile",
                 "amx_bf16", "amx_int8"]
NATIVE_FLAGS = {"float32": None, "bfloat16": {"avx512_bf16", "amx_bf16"},
                "int8": {"avx512_vnni", "avx_vnni", "amx_int8"}}


def _processor():
    """The first processor's fields in /proc/cpuinfo."""
    with open("/proc/cpuinfo") as file:
        lines = file.read().split("\n\n")[0].splitlines()
    return {key.strip(): value.strip() for key, _, value in (line.partition(":") for line in lines)}


def processor_name():
    fields = _processor()
    numbers = [f"{key} {fields[key]}" for key in ("cpu family", "model", "stepping") if key in fields]
    return f"{fields.get('model name', platform.machine())} ({', '.join(numbers)})"


def flags():
    return set(_processor().get("flags", "").split())


def native_precisions():
    """Those that the processor has instructions for."""
    here = flags()
    return [precision for precision, needed in NATIVE_FLAGS.items() if needed is None or needed & here]


def _memory_gb():
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9


def description(bench, libraries):
    """By heading; `libraries` are the engines' own words."""
    here = flags()
    version = subprocess.run([bench.program, "--version"], capture_output=True, text=True, check=True).stdout
    return {"processor": f"{processor_name()}, {len(usable())} of {os.cpu_count()} cores, {_memory_gb():.0f} GB",
            "instructions": " ".join(flag for flag in TELLING_FLAGS if flag in here),
            "program": "; ".join(version.splitlines()[:2]),  # its engines are in the next, as they were used
            "engines": "; ".join(sorted(text for text in libraries if text not in version))}
