"""self_supervised.py: its networks and losses against the published code's numbers,
its scores, a small run."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from conftest import DATA, EXPERIMENTS, nightly

torch = pytest.importorskip("torch")
pytest.importorskip("cv2")
pytest.importorskip("matplotlib")
h5py = pytest.importorskip("h5py")

import self_supervised



@pytest.fixture
def golden():
    """A tensor of golden.h5 by its path."""
    if not (DATA / "golden").is_dir():
        pytest.skip("no ../shared/data")
    with h5py.File(DATA / "golden" / "golden.h5") as file:
        yield lambda path: torch.from_numpy(np.array(file[path])) if isinstance(file[path], h5py.Dataset) else {
            name: torch.from_numpy(np.array(value)) for name, value in file[path].items()}


@pytest.mark.parametrize("name, channels", [("flow", (18, 2)), ("recons", (2, 1))])
def test_the_networks_are_the_published_ones(golden, name, channels):
    network = self_supervised.UNet(*channels, 8).eval()
    state = golden(f"{name}/state")
    # Nothing goes through the layer `pred`, so it is not ported.
    network.load_state_dict({key: value for key, value in state.items() if not key.startswith("pred.")})
    with torch.no_grad():
        outputs = network(golden(f"{name}/input"))
    for scale, output in enumerate(outputs):
        expected = golden(f"{name}/output/{scale}")
        assert (output - expected).norm() <= 1e-5 * expected.norm()


def test_the_flow_losses_are_the_published_ones(golden):
    frames = [golden(f"losses/image/{name}").expand(2, 1, 64, 96) for name in "ab"]
    flows = [golden(f"losses/flow_scaled/flow/{scale}") for scale in range(4)]
    # The published code weights each sample with the masks of the whole batch.
    losses = self_supervised.flow_losses(*frames, flows, golden("losses/flow_scaled/mask").sum(0, keepdim=True)[None])
    for loss, name in zip(losses, ("photometric", "smoothness")):
        assert loss.item() == pytest.approx(golden(f"losses/flow_scaled/{name}").item(), rel=2e-6)


def test_the_image_loss_is_the_published_one(golden):
    first, second = (golden(f"losses/image/{name}") for name in "ab")
    assert self_supervised.ssim(first, second).mean().item() == pytest.approx(golden("losses/image/ssim").item(),
                                                                              abs=1e-5)
    expected = golden("losses/image/l1_minus_ssim").item()
    assert self_supervised.reconstruction_loss([first], second).item() == pytest.approx(expected, abs=1e-5)
    # Two scales: the coarser one, of the same pixels, counts half.
    assert self_supervised.reconstruction_loss([first, first], second).item() == pytest.approx(1.5 * expected, abs=2e-5)


def test_a_pixel_without_weight_adds_nothing_to_the_photometric_loss():
    frames = torch.zeros(2, 1, 8, 8), torch.full((2, 1, 8, 8), 0.5)
    mask = torch.zeros(2, 1, 8, 8)
    mask[0, 0, 3, 4] = 1
    photometric, smoothness = self_supervised.flow_losses(*frames, [torch.zeros(2, 2, 4, 4), torch.zeros(2, 2, 8, 8)],
                                                          mask)
    # The first sample's error is 0.5 at its only pixel, the second one has none; the coarser scale counts half.
    assert photometric.item() == pytest.approx(1.5 * (0.25 + 1e-10) ** 0.45 / 2, rel=1e-5)
    assert smoothness.item() == pytest.approx(1.5 * 1e-10**0.45, rel=1e-4)


def test_a_frame_moved_by_whole_pixels_is_the_frame_elsewhere():
    previous = torch.rand(1, 1, 9, 12, generator=torch.Generator().manual_seed(0))
    flow = torch.tensor([3.0, -2.0])[None, :, None, None].expand(1, 2, 9, 12)  # looked up 3 to the right and 2 above
    moved = self_supervised.moved(previous, flow)
    assert torch.allclose(moved[..., 2:, :9], previous[..., :7, 3:], atol=1e-5)
    # beyond the edge its outermost pixels
    assert torch.allclose(moved[..., 2:, 9:], previous[..., :7, 11:].expand(1, 1, 7, 3), atol=1e-5)
    assert torch.allclose(self_supervised.moved(previous, 0 * flow), previous, atol=1e-5)


def test_the_error_is_in_grey_levels_and_of_the_pixels_with_events():
    previous, following = np.full((16, 16), 100, np.uint8), np.full((16, 16), 100, np.uint8)
    following[4, 5], following[10, 10] = 130, 250
    volume = np.zeros((18, 16, 16), np.float16)
    volume[7, 4, 5] = volume[12, 4, 6] = 1
    pair = previous, following, volume
    scores = self_supervised.scores_of(pair, *[self_supervised.tensors([pair])[0]] * 2)
    assert scores["error"] == pytest.approx((30 + 0) / 2, abs=1e-3)
    assert scores["ssim_at_events"] < scores["ssim"] < 1


def pair_moved_by(flow, pattern):
    """A pair of which each pixel of the second frame is the first one's at its place plus `flow`, in whole pixels, with
    events where they differ; the first one's edges go on, as in `moved`."""
    (x, y), (height, width) = flow, pattern.shape
    following = np.pad(pattern, 40, "edge")[40 + y:40 + y + height, 40 + x:40 + x + width]
    volume = np.zeros((18, height, width), np.float16)
    volume[0] = pattern != following
    return pattern, following, volume


@pytest.fixture
def pattern():
    return np.random.default_rng(7).integers(0, 256, (60, 80), np.uint8)


def test_zero_flow_leaves_the_whole_error_and_the_best_constant_flow_none_of_a_constant_motion(pattern):
    pairs = [pair_moved_by((5, -3), image) for image in (pattern, pattern[::-1])]
    assert self_supervised.best_constant_flow(pairs) == (5, -3)
    errors = {control: self_supervised.control_scores(control, pairs)["error"] for control in self_supervised.CONTROLS}
    plain = np.mean([np.abs(previous.astype(float) - following)[volume[0] > 0].mean()
                     for previous, following, volume in pairs])
    assert errors["previous frame as it is"] == pytest.approx(plain, rel=1e-5)
    assert errors["best constant flow of the recording"] < 1e-3 * plain


def test_the_best_constant_flow_is_that_of_all_pairs_to_an_eighth_of_a_pixel(pattern):
    # Five eighths of the image moved by 1 px and three of that moved by 2: interpolated by 1.375.
    (previous, one, volume), (_, two, _) = (pair_moved_by((x, 0), pattern // 8 * 8) for x in (1, 2))
    assert self_supervised.best_constant_flow([(previous, one // 8 * 5 + two // 8 * 3, volume)]) == (1.375, 0)
    # What suits two of three pairs is best.
    pairs = [pair_moved_by(flow, pattern) for flow in ((0, 2), (0, 2), (4, 0))]
    assert self_supervised.best_constant_flow(pairs) == (0, 2)


def test_a_pair_at_rest_has_only_the_error_of_the_control():
    """Of a lone white pixel the Gaussian leaves the share of its middle, a shift by half a pixel a half."""
    frame = np.zeros((21, 21), np.uint8)
    frame[10, 10] = 255
    volume = np.zeros((18, 21, 21), np.float16)
    volume[3, 10, 10] = 1
    errors = {control: self_supervised.control_scores(control, [(frame, frame, volume)])["error"]
              for control in self_supervised.CONTROLS}
    middle = 1 / np.exp(-np.arange(-4, 5) ** 2 / 2).sum()
    assert errors["previous frame blurred by 1 px"] == pytest.approx(255 * (1 - middle**2), rel=1e-4)
    assert errors["previous frame moved by half a pixel"] == pytest.approx(255 / 2, rel=1e-4)
    assert errors["best constant flow of the recording"] == pytest.approx(0, abs=1e-3)


def test_volumes_are_reduced_by_summing_and_divided_by_their_98th_percentile():
    volume = np.arange(18 * 5 * 7, dtype=np.float32).reshape(18, 5, 7)
    small = self_supervised.reduced(volume, 2)
    assert small.shape == (18, 2, 3)
    assert small[1, 1, 2] == volume[1, 2:4, 4:6].sum()
    # the zeros do not count: the percentile is 99
    values = np.append(np.zeros(50, np.float32), np.arange(1, 102, dtype=np.float32))
    normalized = self_supervised.normalized(values)
    assert normalized[-1] == 1 and normalized[50 + 9] == pytest.approx(10 / 99)
    assert not self_supervised.normalized(np.zeros(3, np.float32)).any()


def test_all_rows_learn_from_the_same_crops():
    random = np.random.default_rng(0)
    frames = random.integers(0, 256, (3, 120, 150), np.uint8)
    with_events = [(*pair, random.random((18, 120, 150)).astype(np.float16)) for pair in zip(frames, frames[1:])]
    without = [(previous, following, 0 * volume) for previous, following, volume in with_events]
    first, second, other = (next(self_supervised.batches(pairs, seed))
                            for pairs, seed in ((with_events, 1), (without, 1), (with_events, 2)))
    assert torch.equal(first[0], second[0]) and torch.equal(first[1], second[1]) and not torch.equal(first[0], other[0])
    assert first[0].shape == (4, 1, 96, 96) and first[2].shape == (4, 18, 96, 96)


def test_no_scene_is_learnt_from_and_tested_on(tmp_path):
    for name in ("b_1", "a_1", "b_2", "c_1"):
        (tmp_path / f"{name}.hdf5").touch()
    halves = self_supervised.halves_of([tmp_path])
    assert [[path.stem for path in half] for half in halves] == [["a_1", "c_1"], ["b_1", "b_2"]]
    with pytest.raises(SystemExit, match="expected recordings of at least 2 groups, got 1, in "):
        self_supervised.halves_of([tmp_path / "b_1.hdf5", tmp_path / "b_2.hdf5"])


@nightly
def test_a_small_run_fills_the_table_and_goes_on(recording_folder, tmp_path):
    def run(*more, expect=0):
        done = subprocess.run([sys.executable, EXPERIMENTS / "self_supervised.py", "--program",
                               os.environ["EVENTGAN_PROGRAM"], "--recordings", recording_folder, "--out",
                               tmp_path / "out", "--steps", "2", "--with", "difference", "real", *more],
                              capture_output=True, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
        assert done.returncode == expect, done.stdout + done.stderr
        return done.stdout + done.stderr

    first = run("--seeds", "1")
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert set(results["runs"]) == {f"{row} {half} 0" for row in ("difference", "real") for half in (0, 1)}
    assert set(results["runs"]["real 0 0"]) == {"other_scene"}
    assert "ssim,difference,mean," in first and (tmp_path / "out" / "one_scene.png").exists()
    second = run("--seeds", "2")
    assert "real 0 0" not in second and "real 0 1" in second
    assert (json.loads((tmp_path / "out" / "results.json").read_text())["runs"]["real 0 0"]
            == results["runs"]["real 0 0"])
    assert "expected steps 2, as when" in run("--steps", "3", expect=1)
