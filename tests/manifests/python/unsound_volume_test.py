"""A volume with an infinite value is an error, whoever looks for it: the engine while it stores a volume,
or the statistics behind it."""

import json
import pathlib

import numpy as np
import pytest

import eventgan

WEIGHTS = pathlib.Path(__file__).resolve().parents[3] / "manifests" / "weights"
FRAMES = np.random.default_rng(5).integers(0, 256, (2, 64, 95), np.uint8)


def overflowing(width, folder):
    """The shipped weights with a prediction 3e38 times as large."""
    data = bytearray((WEIGHTS / f"eventgan-{width}.safetensors").read_bytes())
    behind_header = 8 + int.from_bytes(data[:8], "little")
    first, last = json.loads(data[8:behind_header])["pred.weight"]["data_offsets"]
    numbers = np.frombuffer(data, np.float32, (last - first) // 4, behind_header + first)
    np.clip(numbers * 3e38, -3e38, 3e38, out=numbers)
    path = folder / "overflowing.safetensors"
    path.write_bytes(data)
    return path


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("settings",
                         [{}, {"normalize": "eta98"}, {"scope": "motion"}, {"size": (80, 100), "fit": "letterbox"}],
                         ids=str)
@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
@pytest.mark.parametrize("width", [8, 16])
def test_infinity_is_an_error_of_every_call(width, precision, settings, tmp_path):
    try:
        generator = eventgan.Generator(overflowing(width, tmp_path), precision=precision, **settings)
    except ValueError as error:
        pytest.skip(str(error))  # bfloat16 without AVX-512
    previous, following = FRAMES
    for call in (lambda: generator(previous, following), lambda: generator.many(FRAMES[:1], FRAMES[1:]),
                 lambda: generator.sample(previous, following)):
        with pytest.raises(RuntimeError, match="expected finite values >= 0, got (inf|-?nan) in the generated volume"):
            call()
