"""`eventgan tradeoff` from outside: its table, files and lines for the manifest."""

import json
import signal
import subprocess
from xml.etree import ElementTree

import h5py
import numpy as np
import PIL.Image

import camera_files
import program
import small_job
from program import PROGRAM, run

AXES = {"widths": "untrained:2,8", "precisions": "float32,int8", "methods": "network,difference", "sizes": "1,0.75",
        "scopes": "whole,motion,labels", "dtypes": "float32,uint8", "pairs": "4", "rounds": "2"}


class Tradeoff(program.InFolder):
    def setUp(self):
        super().setUp()
        self.manifest = small_job.small_job(self.folder)  # 24x32 pixels, boxes and persons
        self.out = self.folder / "compared"

    def command(self, **changes):
        options = {**AXES, "out": self.out, "progress": "none", **changes}
        return ["tradeoff", self.manifest,
                *[part for name, value in options.items() for part in (f"--{name.replace('_', '-')}", value)]]

    def tradeoff(self, expect=0, **changes):
        return run(*self.command(**changes), expect=expect)

    def report(self):
        return json.loads((self.out / "tradeoff.json").read_text())

    def test_every_configuration_is_measured_or_has_a_reason(self):
        text, _ = self.tradeoff()
        report = self.report()
        self.assertEqual(report["reference"], "shipped:8 float32 x1")
        names = [configuration["name"] for configuration in report["configurations"]]
        left_out = {refused["name"]: refused["reason"] for refused in report["not_run"]}
        self.assertEqual(len(names), len(set(names)))
        # Untrained weights have no calibration; the shipped ones run in int8 where the processor does.
        self.assertIn("untrained:2 int8 x0.75", left_out)
        # Stored types x sizes x (weights x precisions x scopes, and a simulator).
        self.assertEqual(len(names) + 2 * len(left_out), 2 * 2 * (2 * 2 * 3 + 1))
        for name in names:
            self.assertIn(name, text)
        for reason in left_out.values():
            self.assertIn(reason, text)
        by_name = {configuration["name"]: configuration for configuration in report["configurations"]}
        itself = by_name["shipped:8 float32 x1 float32"]
        self.assertEqual((itself["relative_l2"], itself["largest_error"], itself["f1_raw"], itself["lost_in_labels"]),
                         (0, 0, 1, 0))
        self.assertGreater(itself["labelled_events"], 0)
        front = [by_name[name] for name in report["front"]]
        for slower, faster in zip(front, front[1:]):
            self.assertLess(slower["times_reference"]["median"], faster["times_reference"]["median"])
            self.assertLess(slower["relative_l2"], faster["relative_l2"])
        for configuration in report["configurations"]:
            self.assertEqual(configuration["pairs"], 4)
            self.assertGreater(configuration["pairs_per_s"]["median"], 0)
            self.assertGreater(configuration["stored_bytes"], 0)
        self.assertGreater(by_name["shipped:8 float32 x0.75 float32"]["relative_l2"], 0)
        self.assertIn("by area: each pixel is the mean", " ".join(report["notes"]))
        self.assertEqual(ElementTree.parse(self.out / "tradeoff.svg").getroot().tag, "{http://www.w3.org/2000/svg}svg")
        self.assertIn("| configuration |", (self.out / "tradeoff.md").read_text())

    def test_the_lines_are_the_manifest_that_was_measured(self):
        text, _ = self.tradeoff(at_most_error="1e9", methods="network", precisions="float32", sizes="0.75")
        chosen_text = text[text.index("The fastest with an error"):]
        lines = [line.strip() for line in chosen_text.splitlines() if line.startswith("        \"")]
        self.assertEqual(len(lines), 3)
        keys = json.loads("{" + "".join(lines) + "}")
        self.assertEqual((keys["image"]["width"], keys["image"]["height"]), (24, 18))
        whole = json.loads(self.manifest.read_text())
        self.manifest.write_text(json.dumps({**whole, **keys}))
        run("convert", self.manifest, "--progress", "none")
        chosen = self.report()["answer"]["name"]
        self.assertIn(keys["generator"]["weights"], chosen)
        self.assertTrue(chosen.endswith(keys["output"]["dtype"]))

    def test_by_default_it_is_a_few_and_ends_with_a_recommendation(self):
        text, told = run("tradeoff", self.manifest, "--out", self.out, "--progress", "lines", "--pairs", "2",
                         "--rounds", "1")
        report = self.report()
        self.assertLessEqual(len(report["configurations"]), 10)
        self.assertIn(f"{len(report['configurations'])} configurations, 2 pairs, 1 round: about ", told.splitlines()[0])
        self.assertEqual({configuration["dtype"] for configuration in report["configurations"]}, {"float16"})
        own, *others = (recommended["reason"] for recommended in report["recommended"])
        self.assertEqual(own, "The manifest's own")
        self.assertGreaterEqual(len(others), 2)
        for recommended in report["recommended"]:
            self.assertIn(f"    {recommended['name']}\n", text)
            self.assertIn(f"        {recommended['manifest'][0]},\n", text)
        table = text[:text.index("* Pareto front")]
        self.assertLessEqual(max(map(len, table.splitlines())), 80)

    def test_a_camera_in_any_layout(self):
        events = camera_files.random_events(3000, 0, 1, seed=1)
        frames = np.random.default_rng(2).integers(0, 256, (3, camera_files.HEIGHT, camera_files.WIDTH), dtype=np.uint8)
        with h5py.File(self.folder / "authors.hdf5", "w") as file:
            file["davis/events/data"] = events
            file["davis/image_raw/data"] = frames
            file["davis/image_raw/timestamps"] = np.array([0.1, 0.5, 0.9])
        camera_files.write_mvsec(self.folder / "mvsec.hdf5", events, [0.1, 0.5, 0.9])
        folder = self.folder / "ecd"
        (folder / "images").mkdir(parents=True)
        (folder / "events.txt").write_text("".join(f"{t:.6f} {x:.0f} {y:.0f} {int(p > 0)}\n" for x, y, t, p in events))
        for index, frame in enumerate(frames):
            PIL.Image.fromarray(frame).save(folder / "images" / f"{index}.png")
        (folder / "images.txt").write_text("".join(f"{time} images/{index}.png\n"
                                                   for index, time in enumerate([0.1, 0.5, 0.9])))
        recordings = [str(self.folder / name) for name in ("authors.hdf5", "mvsec.hdf5", "ecd")]
        real = [part for recording in recordings for part in ("--real", recording)]
        run(*self.command(methods="network", precisions="float32", sizes="1"), *real)
        for configuration in self.report()["configurations"]:
            self.assertEqual(set(configuration["real"]), {*recordings, "mean"})

    def test_a_signal_stops_it_and_nothing_is_left(self):
        command = [PROGRAM, *map(str, self.command(rounds="1000", progress="lines"))]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        with process.stderr as told:
            self.assertIn(" 1000 rounds: about ", told.readline())
            process.send_signal(signal.SIGTERM)
            self.assertIn("stopped on request", told.read())
        self.assertEqual(process.wait(), 75)
        self.assertEqual(list(self.out.iterdir()), [])

    def test_what_cannot_be_is_refused(self):
        for option, value, word in [("methods", "magic", "expected one of network"),
                                    ("sizes", "1,0.5,1", "expected different"),
                                    ("reference", "8,float32,9", "expected WEIGHTS"), ("out", "", "expected a value"),
                                    ("reference", "untrained:2,int8", "expected a configuration that can be run")]:
            with self.subTest(option=option, value=value):
                _, error = self.tradeoff(**{option: value}, expect=64)
                self.assertIn(f"--{option}: {word}", error)
        self.tradeoff(widths="none.safetensors", expect=66)
        self.tradeoff(real=self.folder / "none.hdf5", expect=66)


if __name__ == "__main__":
    program.main()
