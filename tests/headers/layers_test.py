"""Which room may include which: every arrow points downward, and no stage knows another but for recordings, on which
datasets of events rest."""

import os
import pathlib
import re
import unittest

SOURCE = pathlib.Path(os.environ["EVENTGAN_SOURCE_DIR"])
# From the lowest up. A room may include itself and what lies below; rooms of one floor do not know each other.
FLOORS = [
    ["manifests/values"],
    ["stages/base/files"],
    ["manifests/documents"],
    ["stages/base/charts", "stages/base/processor", "stages/base/processor_clones.h"],
    ["stages/base/hdf5", "stages/base/images"],
    ["stages/base/archives", "stages/base/videos"],
    ["stages/recordings"],
    ["stages/frames", "stages/labels", "stages/events", "stages/generator", "stages/training",
     "stages/shards", "stages/synthetic", "stages/exports"],
    ["pipeline/runtime"],
    ["pipeline/planning"],
    ["pipeline/folder"],
    ["pipeline/conversion", "pipeline/dataset"],
    ["pipeline/preview"],
    ["pipeline/generators"],
    ["pipeline/simulation", "pipeline/training", "pipeline/realism", "pipeline/exports", "pipeline/report"],
    ["pipeline/tradeoff"],
    ["pipeline/command_line"],
    ["pipeline/commands", "pipeline/library"],
    ["pipeline/main.cc", "pipeline/without_torch.cc", "pipeline/without_videos.cc"],
]
FLOOR = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}


def room_of(file):
    rooms = [room for room in FLOOR if file == room or file.startswith(room + "/")]
    assert len(rooms) == 1, f"expected a room of the list for {file}, got {rooms}"
    return rooms[0]


class Layers(unittest.TestCase):
    def test_every_include_points_downward(self):
        upward, count = [], 0
        for top in ("manifests", "stages", "pipeline"):
            for path in sorted((SOURCE / top).rglob("*")):
                if path.suffix not in (".h", ".cc"):
                    continue
                file = path.relative_to(SOURCE).as_posix()
                for included in re.findall(r'^#include "([^"]+)"', path.read_text(), re.MULTILINE):
                    count += 1
                    here, there = room_of(file), room_of(included)
                    if here != there and FLOOR[there] >= FLOOR[here]:
                        upward.append(f"{file} includes {included}")
        self.assertGreater(count, 1000)
        self.assertEqual(upward, [])

    def test_each_room_is_one_library(self):
        for room in FLOOR:
            if (SOURCE / room).is_dir():
                text = (SOURCE / room / "CMakeLists.txt").read_text()
                libraries = re.findall(r"^(?:eventgan_library\(|add_library\(\w+ SHARED)", text, re.MULTILINE)
                self.assertEqual(len(libraries), 1, room)


if __name__ == "__main__":
    unittest.main()
