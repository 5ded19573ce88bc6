"""What the tests of this folder share."""

import csv
import json
import os
import pathlib

import pytest

EXPERIMENTS = pathlib.Path(__file__).resolve().parent
SOURCE = EXPERIMENTS.parents[1]
DATA = pathlib.Path(os.environ.get("EVENTGAN_TEST_DATA", SOURCE.parent / "shared" / "data"))

# What trains networks takes minutes.
nightly = pytest.mark.skipif("EVENTGAN_NIGHTLY" not in os.environ, reason="of .ci/run nightly (EVENTGAN_NIGHTLY)")


def part_of_data(folder, count):
    """A folder as labelled_frames with the first images of each set."""
    for source in sorted(path for path in (DATA / "labelled_frames").iterdir() if path.is_dir()):
        target = folder / source.name
        target.mkdir(parents=True)
        for each in source.iterdir():
            if each.suffix not in (".csv", ".json"):
                (target / each.name).symlink_to(each)
        if (source / "person_keypoints.json").exists():
            labels = json.loads((source / "person_keypoints.json").read_text())
            labels["images"] = labels["images"][:count]
            ids = {image["id"] for image in labels["images"]}
            labels["annotations"] = [each for each in labels["annotations"] if each["image_id"] in ids]
            (target / "person_keypoints.json").write_text(json.dumps(labels))
            continue
        frames, boxes = ([*csv.reader((source / f"{name}.csv").read_text().splitlines())] for name in ("frames",
                                                                                                      "boxes"))
        frames = frames[:count + 1]
        kept = {row[0] for row in frames}
        for name, rows in (("frames", frames), ("boxes", [row for row in boxes if row[0] in kept])):
            with open(target / f"{name}.csv", "w", newline="") as file:
                csv.writer(file).writerows(rows)


@pytest.fixture
def recording_folder(tmp_path):
    """Two recordings of a pattern that moves to the right by a pixel a frame;
    at each pixel that changes there is an event of the change's sign."""
    h5py, np = pytest.importorskip("h5py"), pytest.importorskip("numpy")
    pattern = np.kron(np.random.default_rng(5).integers(20, 230, (14, 60)), np.ones((8, 8), int)).astype(np.uint8)
    (tmp_path / "recordings").mkdir()
    for name, start in (("one_scene", 100), ("other_scene", 300)):
        frames = np.stack([pattern[:, start - shift:][:, :128] for shift in range(3)])
        times = np.arange(3) * 0.04
        events = []
        for before, after, time in zip(frames, frames[1:], times[1:]):
            change = after.astype(int) - before
            y, x = np.nonzero(change)
            events.append(np.stack([x, y, time - 0.03 + 0.02 * np.arange(len(x)) / len(x), np.sign(change[y, x])], 1))
        with h5py.File(tmp_path / "recordings" / f"{name}.hdf5", "w") as file:
            camera = file.create_group("davis/left")
            camera["events"], camera["image_raw"], camera["image_raw_ts"] = np.concatenate(events), frames, times
            camera["image_raw_event_inds"] = np.searchsorted(np.concatenate(events)[:, 2], times)
    return tmp_path / "recordings"
