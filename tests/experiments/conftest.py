"""What the tests of this folder share."""

import csv
import json
import os
import pathlib

EXPERIMENTS = pathlib.Path(__file__).resolve().parent
SOURCE = EXPERIMENTS.parents[1]
DATA = pathlib.Path(os.environ.get("EVENTGAN_TEST_DATA", SOURCE.parent / "shared" / "data"))


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
