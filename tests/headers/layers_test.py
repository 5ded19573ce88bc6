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
    ["manifests/files"],
    ["manifests/documents"],
    ["stages/base/charts", "stages/base/processor", "stages/base/processor_clones.h"],
    ["stages/base/hdf5", "stages/base/images"],
    ["stages/base/archives", "stages/base/videos"],
    ["stages/recordings/order"],
    ["stages/recordings/readers"],
    ["stages/recordings/writers"],
    ["stages/frames/dataset"],
    ["stages/frames/listing", "stages/frames/decoding"],
    ["stages/frames/naming", "stages/frames/kitti", "stages/frames/mpii", "stages/frames/human36m"],
    ["stages/frames/own_labels"],
    ["stages/frames/sequences"],
    ["stages/frames/events"],
    ["stages/frames/sources", "stages/labels", "stages/events", "stages/generator", "stages/training",
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
# Headers of a heavy library that rooms share: sources and headers in detail/ may include them, public headers not.
HEAVY_HEADERS = {
    "manifests/documents/json_text.h", "manifests/documents/report.h", "manifests/documents/strict_json.h",
    "pipeline/command_line/usage.h",
    "stages/base/archives/array_json.h", "stages/base/archives/mat_json.h", "stages/base/hdf5/hdf5.h",
    "stages/base/hdf5/hdf5_output_file.h",
}
HEAVY_LIBRARIES = re.compile(r"(?:nlohmann|opencv2|oneapi|tbb|fmt|CLI|libav\w+|flatbuffers|torch|c10)/|"
                             r"hdf5\.h|matio\.h|pugixml\.hpp|zip\.h|yaml-cpp/|jpeglib\.h|png\.h|tiff\w*\.h|H5public\.h|"
                             r"utf8proc\.h")
FLOOR = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}


def room_of(file):
    rooms = [room for room in FLOOR if file == room or file.startswith(room + "/")]
    assert len(rooms) == 1, f"expected a room of the list for {file}, got {rooms}"
    return rooms[0]


def includes():
    """(file, what it includes) of all sources and headers, of this project's files and of libraries' in <>."""
    for top in ("manifests", "stages", "pipeline"):
        for path in sorted((SOURCE / top).rglob("*")):
            if path.suffix in (".h", ".cc"):
                file = path.relative_to(SOURCE).as_posix()
                for included in re.findall(r'^#include ("[^"]+"|<[^>]+>)', path.read_text(), re.MULTILINE):
                    yield file, included.strip('"')


def is_public(file):
    return file.endswith(".h") and "/detail/" not in file


class Layers(unittest.TestCase):
    def test_every_include_points_downward(self):
        upward, count = [], 0
        for file, included in includes():
            if included.startswith("<") or "/" not in included:
                continue
            count += 1
            here, there = room_of(file), room_of(included)
            if here != there and FLOOR[there] >= FLOOR[here]:
                upward.append(f"{file} includes {included}")
        self.assertGreater(count, 1000)
        self.assertEqual(upward, [])

    def test_detail_is_private_to_its_room(self):
        self.assertEqual([f"{file} includes {included}" for file, included in includes()
                          if "/detail/" in included and included[0] != "<"
                          and room_of(file) != room_of(included)], [])

    def test_public_headers_bring_no_heavy_library(self):
        self.assertEqual([f"{file} includes {included}" for file, included in includes()
                          if is_public(file) and file not in HEAVY_HEADERS
                          and (HEAVY_LIBRARIES.match(included.strip("<>")) or included in HEAVY_HEADERS)], [])
        self.assertEqual([header for header in HEAVY_HEADERS if not (SOURCE / header).is_file()], [])

    def test_each_room_is_one_library(self):
        for room in FLOOR:
            if (SOURCE / room).is_dir():
                text = (SOURCE / room / "CMakeLists.txt").read_text()
                libraries = re.findall(r"^(?:eventgan_library\(|add_library\(\w+ SHARED)", text, re.MULTILINE)
                self.assertEqual(len(libraries), 1, room)


if __name__ == "__main__":
    unittest.main()
