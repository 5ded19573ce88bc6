"""Whatever file a job opens is in its plan's fingerprint: for each kind of dataset and of labels, every file that
`convert` was seen to open for reading is changed by itself, and the plan must not be taken on."""

import itertools
import json
import re
import shutil
import subprocess

import h5py
import numpy as np
import PIL.Image

import damage_test
import failing_files
import program
from camera_files import (BBOX, random_events, whole_microseconds, write_columns, write_dat, write_dhp19,
                          write_event_utils, write_evt3, write_mvsec, write_v2e)
from moving_texture import write_video
from program import SHARED, text
from small_job import LENIENT, save_image, small_job

DOCUMENTS = {"manifest.json", "camera.json"}  # whose values are fields of the fingerprint
# Of frames and recordings a fingerprint has the path and the size: to read them all for it would be to read them twice.
IMAGES = {".png", ".jpg"}
RECORDINGS = {"drive.hdf5", "drive_td.h5", "events.h5", "mov1.h5", "events.txt", "a.raw", "a.dat", "a.aedat4", "a.npy",
              "a.npz", "v2e.h5", "hqf.h5", "m3ed.h5", "clip.mp4"}
STILL = {"from": "stills", "motion": {"translation_px": [1, 2], "objects": {"translation_px": [1, 2]}}}
BOX = "car,4,5,14,15"
VOC = ("<annotation><filename>{}.png</filename><size><width>32</width><height>24</height><depth>3</depth></size>"
       "<object><name>car</name><difficult>0</difficult><bndbox><xmin>5</xmin><ymin>6</ymin><xmax>14</xmax>"
       "<ymax>15</ymax></bndbox></object></annotation>")

TRACKLET = """<?xml version="1.0" encoding="UTF-8" standalone="yes" ?>
<!DOCTYPE boost_serialization>
<boost_serialization version="9"><tracklets><count>1</count><item_version>1</item_version><item>
<objectType>Car</objectType><h>2.0</h><w>1</w><l>4</l><first_frame>1</first_frame>
<poses><count>1</count><item_version>2</item_version>
<item><tx>12</tx><ty>0</ty><tz>-1</tz><rx>0</rx><ry>0</ry><rz>0</rz>
<state>2</state><occlusion>1</occlusion><occlusion_kf>0</occlusion_kf><truncation>0</truncation>
<amt_occlusion>-1</amt_occlusion></item></poses><finished>1</finished></item></tracklets></boost_serialization>
"""


class OpenedFiles(program.InFolder):
    def setUp(self):
        super().setUp()
        self.out = self.folder / "out"

    def write(self, name, content):
        path = self.folder / "in" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)

    def images(self, folder="images", first=0, digits=6):
        for k in range(first, first + 3):
            save_image(self.folder / "in" / folder / f"{k:0{digits}}.png", np.random.default_rng(k))

    def masks(self, folder="masks"):
        mask = np.zeros((24, 32), np.uint8)
        mask[5:15, 4:14] = 1
        (self.folder / "in" / folder).mkdir(parents=True)
        for k in range(3):
            PIL.Image.fromarray(mask).save(self.folder / "in" / folder / f"{k:06}.png")

    def of(self, *sources, kind="difference"):
        sources = [{**({} if kind == "events" else {"pairs": program.pairs([1])}), **source} for source in sources]
        image = {} if kind == "events" else {"width": 32, "height": 24, "preset": "mpii"}
        path = self.folder / "in" / "manifest.json"
        path.write_text(json.dumps(program.manifest(sources, image=image, generator={"kind": kind}, errors=LENIENT)))
        return path

    def frames(self, root="images", **source):
        return self.of({"dataset": "frames", "root": root, **source})

    def copied(self, name):
        """Of the data that real datasets' layouts are tried with."""
        if not (SHARED / name).is_dir():
            self.skipTest(f"no {SHARED / name}")
        shutil.copytree(SHARED / name, self.folder / "in" / name)

    def taken_on(self, manifest):
        """Whether the frozen plan is still the job's."""
        done = subprocess.run([program.PROGRAM, "plan", manifest, "--freeze", "--output", self.out],
                              capture_output=True, text=True, timeout=120)
        self.assertIn(done.returncode, (0, 64, 65, 66), done.stderr)
        return done.returncode == 0

    def used(self, inputs):
        """The frames of all pairs."""
        frames = set()
        for shard in (self.out).glob("*-of-*.h5"):
            with h5py.File(shard) as file:
                frames.update(inputs / text(path) for key in ("prev_path", "next_path") for path in file["pairs"][key])
        self.assertTrue(frames)
        return frames

    def check(self, manifest, *expected):
        """`expected`: parts of the names of files that must be among those opened."""
        inputs = self.folder / "in"
        done = failing_files.run(inputs, "", "convert", manifest, "--output", self.out, "--threads", 1)
        self.assertEqual(done.code, 0, done.err)
        opened = sorted({call.path for call in done.calls
                         if call.kind == "open" and call.path.is_file() and call.path.name not in DOCUMENTS})
        for name in expected:
            self.assertTrue([path for path in opened if name in str(path)], (name, opened))
        self.assertTrue(self.taken_on(manifest))
        used = self.used(inputs)
        # Two of a kind: of those of a folder whose names differ by their numbers.
        kind = lambda path: (str(path.parent), re.sub(r"\d+", "0", path.name))  # noqa: E731
        for _, alike in itertools.groupby(sorted(opened, key=kind), kind):
            for path in list(alike)[-2:]:
                is_image = path.suffix in IMAGES and "masks" not in path.parts
                if is_image and path not in used:
                    continue  # looked at for what the plan decides, which the fingerprint has
                self.check_change(manifest, path, lambda data: data + b" ")
                if not is_image and path.name not in RECORDINGS and path.stat().st_size > 0:
                    self.check_change(manifest, path, lambda data: data[:-1] + bytes([data[-1] ^ 1]))

    def check_change(self, manifest, path, change):
        before = path.read_bytes()
        path.write_bytes(change(before))
        with self.subTest(path.relative_to(self.folder)):
            self.assertFalse(self.taken_on(manifest), path)
        path.write_bytes(before)

    def test_kitti_and_a_list_of_mpii(self):
        self.write("camera.json", (program.SOURCE / "manifests" / "sensors" / "davis346.json").read_text())
        manifest = small_job(self.folder / "in", generator={"kind": "difference", "sensor": "camera.json"})
        self.check(manifest, "label_2/000001.txt", "people.json", "image_2", "images/")
        self.check_change(manifest, self.folder / "in" / "camera.json", lambda data: data.replace(b"0.229", b"0.23"))

    def test_coco(self):
        self.images()
        self.write("instances.json", json.dumps({
            "images": [{"id": k, "file_name": f"{k:06}.png", "width": 32, "height": 24} for k in range(3)],
            "annotations": [{"id": 1, "image_id": 1, "category_id": 1, "bbox": [4, 5, 10, 10], "iscrowd": 0}],
            "categories": [{"id": 1, "name": "car"}]}) + "\n")
        self.check(self.frames(labels={"format": "coco", "path": "instances.json"}), "instances.json")

    def test_yolo(self):
        self.images("drive/images")
        for k in range(3):
            self.write(f"drive/labels/{k:06}.txt", "0 0.5 0.5 0.25 0.25\n")
        labels = {"format": "yolo", "path": "drive/labels"}
        self.write("drive/data.yaml", "names: [car]\n")
        self.check(self.frames("drive/images", labels=labels), "data.yaml", "000001.txt")

    def test_yolo_with_names_a_line(self):
        self.images("drive/images")
        for k in range(3):
            self.write(f"drive/labels/{k:06}.txt", "0 0.5 0.5 0.25 0.25\n")
        self.write("drive/labels/classes.txt", "car\n")
        self.check(self.frames("drive/images", labels={"format": "yolo", "path": "drive/labels"}), "classes.txt")

    def test_voc_with_masks(self):
        self.images("voc/JPEGImages")
        self.masks()
        for k in range(3):
            self.write(f"voc/Annotations/{k:06}.xml", VOC.format(f"{k:06}"))
        self.check(self.frames("voc/JPEGImages", labels={"format": "voc", "path": "voc/Annotations"}, outlines="masks"),
                   "000001.xml", "masks/000001.png")

    def test_masks_as_labels(self):
        self.images()
        self.masks()
        self.check(self.frames(labels={"format": "masks", "path": "masks"}), "masks/000001.png")

    def test_stills_with_masks_beside_boxes(self):
        self.images()
        self.masks()
        rows = "".join(f"{k:06}.png,{BOX}\n" for k in range(3))
        self.write("boxes.csv", "image,class,left,top,right,bottom\n" + rows)
        self.check(self.frames(labels={"format": "csv", "path": "boxes.csv"}, outlines="masks", pairs=STILL),
                   "boxes.csv", "masks/000001.png")

    def test_mot(self):
        self.images("mot/a/img1", first=1)
        self.write("mot/a/gt/gt.txt", "".join(f"{k},3,5,6,10,10,1,1,1\n" for k in range(1, 4)))
        self.write("mot/a/gt/labels.txt", "car\n")
        self.write("mot/a/seqinfo.ini", "[Sequence]\nname=a\nimDir=img1\nframeRate=25\nseqLength=3\nimWidth=32\n"
                                        "imHeight=24\nimExt=.png\n")
        self.check(self.frames("mot", labels={"format": "mot", "path": "mot"}), "gt.txt", "labels.txt", "seqinfo.ini")

    def test_sidecars_and_times(self):
        self.images("clip")
        self.write("clip/000001.json", '{"a": 1}\n')
        self.check(self.frames("clip"), "000001.json")

    def recording(self, name="drive.hdf5"):
        events = random_events(3000, 10.0, 10.4, 3)
        write_mvsec(self.folder / "in" / name, events, [10 + 0.05 * k for k in range(9)])
        return events

    def test_a_recording_with_a_table(self):
        (self.folder / "in").mkdir()
        self.recording()
        self.write("drive.csv", "time_s,left,top,right,bottom,class\n10.1,2,3,12,13,car\n10.3,2,3,12,13,car\n")
        self.check(self.of({"dataset": "recording", "root": "drive.hdf5"}, kind="events"), "drive.csv", "drive.hdf5")

    def test_a_recording_with_a_table_of_boxes_and_their_names(self):
        (self.folder / "in").mkdir()
        write_columns(self.folder / "in" / "drive_td.h5", random_events(3000, 20, 20.4, 3), size=(24, 32))
        boxes = np.zeros(2, BBOX)
        boxes[:] = [(20_100_000, 2, 3, 10.5, 7, 0, 5, 1), (20_300_000, 0, 0, 32, 24, 0, 6, 1)]
        np.save(self.folder / "in" / "drive_bbox.npy", boxes)
        self.write("label_map_dictionary.json", '{"0": "car"}\n')
        self.check(self.of({"dataset": "recording", "root": "drive_td.h5", "window_s": 0.05}, kind="events"),
                   "drive_td.h5", "drive_bbox.npy", "label_map_dictionary.json")

    def test_a_recording_that_is_rectified(self):
        sequence = self.folder / "in" / "seq"
        write_columns(sequence / "events/left/events.h5", random_events(3000, 20, 20.4, 3), offset=0)
        with h5py.File(sequence / "events/left/rectify_map.h5", "w") as file:
            file["rectify_map"] = np.stack(np.meshgrid(np.arange(32), np.arange(24)), -1).astype(np.float32)
        source = {"dataset": "recording", "root": "seq", "sensor": {"width": 32, "height": 24}}
        self.check(self.of({**source, "rectify": True, "window_s": 0.05}, kind="events"), "events.h5", "rectify_map.h5")
        self.images("seq/images/left/distorted")
        self.write("seq/images/timestamps.txt", "20000000\n20100000\n20200000\n")
        self.out = self.folder / "with images"
        self.check(self.of(source, kind="events"), "timestamps.txt")

    def test_a_recording_of_texts(self):
        self.copied("davis/slider_depth")
        self.check(self.of({"dataset": "recording", "root": "davis/slider_depth"}, kind="events"), "events.txt",
                   "images.txt")

    def test_recordings_of_cameras_and_tools(self):
        folder = self.folder / "in"
        folder.mkdir()
        events, ticks = whole_microseconds(random_events(3000, 1, 1.4, 3))
        columns = {"t": ticks, "x": events[:, 0].astype(np.uint16), "y": events[:, 1].astype(np.uint16),
                   "p": (events[:, 3] > 0).astype(np.uint8)}
        write_evt3(folder / "a.raw", events)
        write_dat(folder / "a.dat", events)
        np.savez(folder / "a.npz", **columns)
        np.save(folder / "a.npy", np.stack(list(columns.values()), 1))
        write_v2e(folder / "v2e.h5", events)
        write_event_utils(folder / "hqf.h5", events)
        write_columns(folder / "m3ed.h5", events, "prophesee/left", "prophesee/left/ms_map_idx")
        self.write_aedat4(folder / "a.aedat4")
        for name in ("a.raw", "a.dat", "a.npz", "a.npy", "v2e.h5", "hqf.h5", "m3ed.h5", "a.aedat4"):
            self.out = self.folder / f"out of {name}"
            source = {"dataset": "recording", "root": name, "window_s": 0.05}
            if name != "a.aedat4":
                source["sensor"] = {"width": 32, "height": 24}
            self.check(self.of(source, kind="events"), name)

    def write_aedat4(self, path):
        """As `simulate` has it."""
        self.images("moving")
        self.write("simulation.json", json.dumps({
            "format": "eventgan-simulation", "version": 1, "name": "s", "seed": 1,
            "sources": [{"path": "moving", "method": "difference", "frames_per_second": 10, "name": "c"}],
            "output": {"directory": "simulated", "format": "aedat4"}}))
        program.run("simulate", self.folder / "in" / "simulation.json")
        shutil.move(self.folder / "in" / "simulated" / "c.aedat4", path)

    def test_windows_with_texts_and_a_table_of_labels_elsewhere(self):
        (self.folder / "in" / "windows").mkdir(parents=True)
        rows = whole_microseconds(random_events(300, 1, 1.04, 3))
        table = np.stack([rows[1], rows[0][:, 0], rows[0][:, 1], rows[0][:, 3] > 0], 1).astype(np.int64)
        np.save(self.folder / "in" / "windows" / "a.npy", table)
        self.write("yolo/train/a.txt", "0 0.5 0.5 0.25 0.25\n")
        self.write("yolo/classes.txt", "person\n")
        source = {"dataset": "recording", "root": "windows", "sensor": {"width": 32, "height": 24}}
        self.check(self.of({**source, "annotations": "yolo/train"}, kind="events"), "a.npy", "train/a.txt",
                   "classes.txt")
        self.write("labels.csv", "time_s,left,top,right,bottom,class\n1.03,2,3,12,13,car\n")
        self.out = self.folder / "labels of csv"
        self.check(self.of({**source, "root": "windows/a.npy", "annotations": "labels.csv", "window_s": 0.02},
                           kind="events"), "labels.csv")

    def test_a_video_with_its_labels(self):
        (self.folder / "in").mkdir()
        write_video(self.folder / "in" / "clip.mp4", 4)
        self.write("clip.csv", "image,class,left,top,right,bottom\n"
                   + "".join(f"clip.mp4/{k},{BOX}\n" for k in range(4)))
        self.check(self.frames("clip.mp4", labels={"format": "csv", "path": "clip.csv"}), "clip.mp4", "clip.csv")

    def test_dhp19(self):
        write_dhp19(self.folder / "in" / "dhp19", recordings=("S1_1_1",))
        self.check(self.of({"dataset": "dhp19", "root": "dhp19"}, kind="events"), "P_matrices", "Vicon_data", ".h5")

    def test_kitti_raw(self):
        drive = "raw/2011_09_26/2011_09_26_drive_0001_sync"
        self.images(f"{drive}/image_02/data", digits=10)
        self.write(f"{drive}/image_02/timestamps.txt",
                   "".join(f"2011-09-26 13:02:25.{k}00000000\n" for k in range(3)))
        self.write(f"{drive}/tracklet_labels.xml", TRACKLET)
        rotation = "1 0 0 0 1 0 0 0 1"
        self.write("raw/2011_09_26/calib_cam_to_cam.txt",
                   f"S_rect_02: 32 24\nR_rect_00: {rotation}\nP_rect_02: 30 0 16 0 0 30 12 0 0 0 1 0\n")
        self.write("raw/2011_09_26/calib_velo_to_cam.txt", "R: 0 -1 0 0 0 -1 1 0 0\nT: 0 0 0\n")
        self.check(self.of({"dataset": "kitti_raw", "root": "raw"}), "timestamps.txt", "tracklet_labels.xml",
                   "cam_to_cam", "velo_to_cam")

    def test_kitti_tracking_and_human36m_extracted(self):
        random = np.random.default_rng(7)
        damage_test.EveryColumn.write_drive(self.folder / "in" / "drive", random)
        damage_test.EveryColumn.write_walk(self.folder / "in" / "walk", random)
        self.check(self.of({"dataset": "kitti_tracking", "root": "drive"},
                           {"dataset": "human36m", "layout": "extracted", "root": "walk"}), "label_02/0000.txt", ".npz")

    def test_kitti_with_the_devkits_mapping(self):
        self.copied("kitti_object")
        self.copied("kitti_raw")
        self.check(self.of({"dataset": "kitti_object", "root": "kitti_object/training", "raw_root": "kitti_raw",
                            "devkit": "kitti_object/devkit", "pairs": program.pairs([1, 5])}), "train_mapping.txt",
                   "train_rand.txt")

    def test_mpii(self):
        self.copied("mpii")
        self.check(self.of({"dataset": "mpii", "root": "mpii"}), "u12_1.mat", "keyframes.mat")

    def test_human36m(self):
        self.copied("human36m_fetch")
        self.check(self.of({"dataset": "human36m", "layout": "fetch", "root": "human36m_fetch"}), "annot.h5")


if __name__ == "__main__":
    program.main()
