"""esim_definition.py: the program's events are those of ESIM's definition, on a scene whose motion is known."""

import os

import numpy as np
import pytest

pytest.importorskip("h5py")

import esim_definition


def test_the_definition_signals_each_crossing_of_a_line_at_its_time():
    grey = lambda log: np.array([[255 * (np.exp(log) - esim_definition.LOG_EPSILON)]])
    frames = np.stack([grey(log) for log in (-2, -1.5, -1.95)])
    events, tied = esim_definition.esim(frames, [0, 1, 3])
    # Up 0.2 and 0.4 of 0.5; the level stays 0.1 below, so 0.3 of 0.45 down is the first event.
    np.testing.assert_allclose(events, [[0, 0, 0.4, 1], [0, 0, 0.8, 1], [0, 0, 1 + 2 * 0.3 / 0.45, -1]], atol=1e-9)
    assert not tied.any()
    assert esim_definition.esim(np.stack([grey(log) for log in (-2, -1.9, -1.8)]), [0, 1, 2])[1].all()


def test_difference_is_the_definition_and_motion_between_frames_adds_to_it(tmp_path):
    clips = {"layers": (esim_definition.layers, 4), "slow layers": (esim_definition.layers, 0.9)}
    column = esim_definition.COLUMNS.index
    found = {(row[0].split(",")[0], row[1]): row
             for row in esim_definition.rows(os.environ["EVENTGAN_PROGRAM"], tmp_path, clips, {})}
    for name in clips:
        row = found[name, "difference"]
        assert row[column("events")] > 50_000
        assert row[column("of other count")] == 0
        assert float(row[column("largest time apart, us")]) < 1
        assert row[column("÷ the definition's")] == pytest.approx(1, abs=0.01)  # with the pixels that rounding decides
    # A pixel between two frames sees what passes: more events, the farther things move.
    assert 1.1 < found["layers", "stills"][column("÷ the definition's")] < 1.5
    assert found["slow layers", "stills"][column("÷ the definition's")] == pytest.approx(1, abs=0.03)
