"""reconstruction.py, and what gives it recordings: recordings.py and judge_reconstruction.py."""

import itertools
import json
import pathlib
import sys

import h5py
import numpy as np
import pytest
from conftest import DATA, SOURCE

torch = pytest.importorskip("torch")

import recordings
from reconstruction import FireNet, load_firenet, reconstruct, robust_normalized, signed_grid, ssim, ssim_map

from eventgan import program

JUDGE = SOURCE.parent / "shared" / "judges" / "firenet_plus" / "model.pth"
WINDOWS = 4  # of the recording that is made here


def random_events(count, size=(7, 9)):
    """[count, 4] t, x, y, polarity, in order of time from 0 to 1."""
    random = np.random.default_rng(0)
    t = np.sort(np.concatenate([[0, 1], random.random(count - 2)]))
    return np.stack([t, random.integers(0, size[1], count), random.integers(0, size[0], count),
                     random.choice([-1, 1], count)], 1)


def hats(events, bins, size):
    """[2 bins, H, W] by the definition, event by event."""
    volume = np.zeros((2, bins, *size))
    for t, x, y, polarity in events:
        for b in range(bins):
            volume[int(polarity < 0), b, int(y), int(x)] += max(0, 1 - abs((bins - 1) * t - b))
    return volume.reshape(2 * bins, *size)


def test_a_grid_of_nine_bins_is_that_of_the_events():
    events = random_events(60)
    grid = signed_grid(hats(events, 9, (7, 9)))
    positive, negative = hats(events, 5, (7, 9)).reshape(2, 5, 7, 9)
    assert grid.dtype == np.float32 and grid.shape == (5, 7, 9)
    np.testing.assert_allclose(grid, positive - negative, atol=1e-5)


def test_a_grid_keeps_the_sum_of_polarities_whatever_the_bins():
    volume = np.random.default_rng(1).random((3, 2 * 4, 2, 5))  # bins at 0, 4/3, 8/3, 4 of the new ones
    grid = signed_grid(volume)
    assert grid.shape == (3, 5, 2, 5)
    np.testing.assert_allclose(grid.sum(1), volume[:, :4].sum(1) - volume[:, 4:].sum(1), rtol=1e-4)
    np.testing.assert_allclose(grid[:, 1], 2 / 3 * (volume[:, 1] - volume[:, 5]), rtol=1e-4)


@pytest.mark.parametrize("shape", [(7, 2, 2), (2, 2, 2), (2, 2)])
def test_a_volume_of_other_channels_is_refused(shape):
    with pytest.raises(ValueError, match=r"expected a volume \[\.\.\., 2B, H, W\]"):
        signed_grid(np.zeros(shape))


def test_ssim_of_one_window_is_that_of_the_equation():
    x, y = np.random.default_rng(2).random((2, 11, 11))  # as large as the window, so that there is one
    taps = np.exp(-0.5 * ((np.arange(11) - 5) / 1.5) ** 2)
    weights = np.outer(taps, taps) / taps.sum() ** 2
    mean_x, mean_y = (weights * x).sum(), (weights * y).sum()
    variance_x, variance_y = (weights * (x - mean_x) ** 2).sum(), (weights * (y - mean_y) ** 2).sum()
    covariance = (weights * (x - mean_x) * (y - mean_y)).sum()
    expected = ((2 * mean_x * mean_y + 1e-4) * (2 * covariance + 9e-4)
                / ((mean_x**2 + mean_y**2 + 1e-4) * (variance_x + variance_y + 9e-4)))
    assert ssim(x, y) == pytest.approx(expected, abs=1e-12)


def test_ssim_of_flat_images_is_of_their_means_and_of_the_inside_alone():
    image = np.full((20, 30), 0.5)
    assert ssim(image, image) == pytest.approx(1)
    assert ssim(image, image / 2) == pytest.approx((2 * 0.5 * 0.25 + 1e-4) / (0.5**2 + 0.25**2 + 1e-4))
    with pytest.raises(ValueError, match="expected two images of one size"):
        ssim(image, image[:, 1:])
    with pytest.raises(ValueError, match="both sides at least 11"):
        ssim(image[:10], image[:10])


def test_the_map_of_ssim_is_of_the_pixels_from_the_sixth_on():
    image, changed = np.full((24, 30), 0.5), np.full((24, 30), 0.5)
    changed[12, 14] = 1  # in the windows around the pixels up to five away
    rows, columns = np.nonzero(ssim_map(image, changed) < 1 - 1e-9)
    assert ssim_map(image, changed).shape == (14, 20)
    assert (rows.min() + 5, rows.max() + 5, columns.min() + 5, columns.max() + 5) == (7, 17, 9, 19)


def test_robust_normalisation_is_by_the_first_and_the_99th_percentile():
    image = np.arange(101, dtype=np.float64).reshape(1, 101)  # the percentiles are 1 and 99
    np.testing.assert_allclose(robust_normalized(-3 * image + 7), np.clip((99 - image) / 98, 0, 1), atol=1e-6)
    assert not robust_normalized(np.full((3, 3), 5)).any()


def remembering():
    """FireNet of which every state goes half the way to 1 at each step, whatever the events,
    and the image is their mean."""
    state = {name: torch.zeros_like(tensor) for name, tensor in FireNet().state_dict().items()}
    state["G2.out_gate.bias"] += 20  # its tanh is 1; update gates are sigmoid(0)
    state["pred.conv2d.weight"] += 1 / 16
    return state


def test_the_state_goes_from_step_to_step_and_not_from_sequence_to_sequence():
    network = FireNet()
    network.load_state_dict(remembering())
    for _ in range(2):
        images = reconstruct(network, np.ones((3, 18, 5, 7), np.float32))
        np.testing.assert_allclose(images, np.broadcast_to([[[0.5]], [[0.75]], [[0.875]]], (3, 5, 7)), atol=1e-6)
    assert images.dtype == np.float32
    with pytest.raises(ValueError, match="expected volumes, got none"):
        reconstruct(network, [])


class Harmful:
    """What must not be run when a checkpoint that holds it is read."""

    def __reduce__(self):
        return pathlib.Path.touch, (pathlib.Path("ran"),)


@pytest.mark.parametrize("zipped", [False, True])
@pytest.mark.parametrize("whole", [False, True])
def test_a_checkpoint_is_read_and_nothing_of_it_is_run(tmp_path, monkeypatch, zipped, whole):
    monkeypatch.chdir(tmp_path)
    torch.manual_seed(0)
    state = FireNet().state_dict()
    torch.save({"epoch": 3, "config": Harmful(), "state_dict": state} if whole else state, "model.pth",
               _use_new_zipfile_serialization=zipped)
    network = load_firenet("model.pth")
    assert not pathlib.Path("ran").exists()
    assert not network.training and not any(parameter.requires_grad for parameter in network.parameters())
    assert all(torch.equal(tensor, state[name]) for name, tensor in network.state_dict().items())


def test_what_is_no_checkpoint_of_firenet_is_named(tmp_path):
    path = tmp_path / "model.pth"
    with pytest.raises(FileNotFoundError, match="model.pth"):
        load_firenet(path)
    for content in (b"", b"no checkpoint", b"PK\x05\x06" + bytes(18)):
        path.write_bytes(content)
        with pytest.raises(ValueError,
                           match="expected a checkpoint of PyTorch with tensors of float32, got .*, in .*model.pth"):
            load_firenet(path)
    state = FireNet().state_dict()
    for changed, message in (({"head.conv2d.weight": torch.zeros(16, 9, 3, 3)},
                              r"head.conv2d.weight \[16, 5, 3, 3\] of FireNet, got \[16, 9, "),
                             ({"more": torch.zeros(2)}, r"more not at all of FireNet, got \[2\]"),
                             ({"pred.conv2d.bias": 1}, "pred.conv2d.bias.*got none")):
        torch.save({**state, **changed}, path)
        with pytest.raises(ValueError, match=message + ".*, in .*model.pth"):
            load_firenet(path)
    torch.save(state, path, _use_new_zipfile_serialization=False)
    path.write_bytes(path.read_bytes()[:-10])
    with pytest.raises(ValueError, match="expected a checkpoint"):
        load_firenet(path)


def test_firenet_plus_sees_the_scene_in_a_cameras_events():
    slider = DATA / "davis" / "slider_depth_mvsec_layout.hdf5"
    if not slider.exists() or not JUDGE.exists():
        pytest.skip("no ../shared/data, or no ../shared/judges")
    network = load_firenet(JUDGE)
    assert sum(parameter.numel() for parameter in network.parameters()) == 37_777
    frames, times_s = recordings.frames_of(slider)
    with h5py.File(slider) as file:
        events = file["davis/left/events"][:][:, [2, 0, 1, 3]]
    windows = [events[(events[:, 0] > start) & (events[:, 0] <= end)] for start, end in itertools.pairwise(times_s)]
    images = reconstruct(network, [recordings.volume_of(window, frames.shape[1:]) for window in windows])
    scores = [ssim(robust_normalized(images[-1]), robust_normalized(frame))
              for frame in (frames[-1], frames[-1, :, ::-1], 255 - frames[-1])]
    assert scores[0] > 0.25 > 0.1 > max(scores[1:])


def test_a_volume_of_events_is_by_the_definition():
    events = random_events(50)
    np.testing.assert_allclose(recordings.volume_of(events, (7, 9)), hats(events, 9, (7, 9)), atol=1e-5)
    at_once = np.array([[3.0, 1, 2, -1]] * 2)
    volume = recordings.volume_of(at_once, (7, 9))
    assert volume[9, 2, 1] == 2 == volume.sum()
    assert not recordings.volume_of(events[:0], (7, 9)).any()


def test_a_threshold_is_fitted_to_the_cameras_events_of_some_pairs():
    asked = set()

    def model(threshold):
        def method(previous, following):
            asked.add(int(previous[0, 0]))
            return np.full((2, 1, 1), 40 / threshold)
        return method

    frames = np.arange(41, dtype=np.uint8).reshape(-1, 1, 1)
    assert recordings.fitted(model, frames, np.full(40, 100.0)) == pytest.approx(0.8, rel=0.005)
    assert len(asked) == 16 and {0, 39} < asked


def make_recording(path):
    """Bright squares that move, with one event where a pixel changes: frames and events in MVSEC's layout."""
    rows, columns = np.mgrid[:24, :32]
    frames = np.stack([np.where((columns - 2 * t) // 6 % 2 == rows // 6 % 2, 200, 50)
                       for t in range(WINDOWS + 1)]).astype(np.uint8)
    events = []
    for t, (previous, following) in enumerate(itertools.pairwise(frames.astype(int))):
        y, x = np.nonzero(previous != following)
        events.append(np.stack([x, y, np.linspace(t + 0.1, t + 1, len(x)), np.sign(following - previous)[y, x]], 1))
    with h5py.File(path, "w") as file:
        camera = file.create_group("davis/left")
        camera["image_raw"], camera["image_raw_ts"], camera["events"] = (frames, np.arange(WINDOWS + 1.0),
                                                                         np.concatenate(events))


def test_frames_are_refused_where_there_are_none(tmp_path):
    with h5py.File(tmp_path / "none.hdf5", "w") as file:
        file["davis/left/image_raw"] = np.zeros((2, 3, 3), np.uint8)
    with pytest.raises(ValueError, match="expected davis/left/image_raw_ts, got none, in .*none.hdf5"):
        recordings.frames_of(tmp_path / "none.hdf5")


def test_the_judge_compares_methods_and_resumes(tmp_path, monkeypatch, capsys):
    pytest.importorskip("cv2")
    pytest.importorskip("eventgan._engine")
    try:
        found = program.find_program()
    except FileNotFoundError:
        pytest.skip("no program")
    import judge_reconstruction

    make_recording(tmp_path / "squares.hdf5")
    torch.manual_seed(0)
    torch.save(FireNet().state_dict(), tmp_path / "model.pth")
    out = tmp_path / "out"

    def judge(*methods):
        arguments = ["--program", found, "--recordings", tmp_path, "--judge", tmp_path / "model.pth", "--out", out,
                     "--with", *methods]
        monkeypatch.setattr(sys, "argv", ["judge_reconstruction.py", *map(str, arguments)])
        judge_reconstruction.main()
        return capsys.readouterr().out

    def rows():
        return json.loads((out / "results.json").read_text())["recordings"]["squares"]["rows"]

    assert "squares: 1 of 4 windows count" in judge("difference")
    first = rows()
    assert (first["camera"]["camera"] == pytest.approx([1] * WINDOWS) and first["camera"]["events"] == 1
            and first["flat grey"]["events"] == 0)
    assert all(len(row[key]) == WINDOWS for row in first.values() for key in ("frame", "moving", "camera"))
    # ln((200 + 5.1) / (50 + 5.1)) = 6.6 thresholds of 0.2, of which six are passed, where the camera has one event.
    assert 5 < first["difference"]["events"] < 7
    image = out / "squares" / "difference.png"
    written = image.stat().st_mtime_ns
    assert "esim" in judge("difference", "esim")
    assert {name: row for name, row in rows().items()
            if name != "esim"} == first and image.stat().st_mtime_ns == written
    assert ",esim," in (out / "judge.csv").read_text() and (out / "squares.png").exists()
    with pytest.raises(SystemExit, match="2"):
        judge("v2e")
    assert "expected --peers for v2e" in capsys.readouterr().err
    torch.save(FireNet().state_dict(), tmp_path / "model.pth")
    with pytest.raises(SystemExit, match="expected judge .* as when this folder was begun"):
        judge("difference")
