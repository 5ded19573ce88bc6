"""What a pair of a photograph whose objects move on their own takes, by stage: with objects that are cut out of their
boxes meanwhile, with outlines that `eventgan outline` has made before, of clips, and of what a
telephone takes."""

import csv
import dataclasses
import json
import subprocess

import PIL.Image

from measuring.bench import DATA
from measuring.calibration import NotCalibrated, calibrated
from measuring.conversion import ConversionRefused, Job, convert
from measuring.frames import link_frames, original_frames
from measuring.report import Part, Table
from measuring.spread import rotated, spread

STAGES = ["read", "generate", "finish"]
SIZE = (192, 320)


@dataclasses.dataclass(frozen=True)
class Settings:
    rounds: int
    most: int        # photographs
    large: int       # of these, made large
    weights: str


SETTINGS = {
    "full": Settings(5, 100, 10, "shipped:8"),
    "quick": Settings(3, 100, 10, "shipped:8"),
    "trial": Settings(1, 2, 1, "untrained:2"),
}


@dataclasses.dataclass(frozen=True)
class Photographs(Job):
    """As `eventgan init` writes them, of a folder that has boxes.csv and `images`."""
    outlines: str | None = None
    frames_of_clip: int | None = None

    def manifest(self):
        motion = {"translation_px": [2, 8], "rotation_deg": 2, "scale": 0.03, "rests": 0.5,
                  "objects": {"translation_px": [0, 8], "rotation_deg": 3, "scale": 0.04}}
        source = {"dataset": "frames", "root": f"{self.frames}/images",
                  "labels": {"format": "csv", "path": f"{self.frames}/boxes.csv"},
                  "pairs": {"from": "stills", "motion": motion}}
        if self.outlines:
            source["outlines"] = self.outlines
        if self.frames_of_clip:
            source["pairs"]["frames"] = self.frames_of_clip
        image = {"height": self.height, "width": self.width, "fit": "letterbox"}
        return super().manifest() | {"sources": [source], "image": image}


def photographs(bench, most):
    """A folder of so many, real ones if they are at hand, else frames of which the middle is an object; and what they
    are, if they are real."""
    folder = bench.folder("photographs")
    real = DATA / "labelled_frames" / "voc100"
    header, names, rows = "image,class,x1,y1,x2,y2", [], []
    if real.exists():
        with (real / "boxes.csv").open(encoding="utf-8", newline="") as file:
            lines = [*csv.DictReader(file)]
        names = [*dict.fromkeys(line["image"] for line in lines)][:most]
        link_frames(folder / "images", [real / "images" / name for name in names], len(names))
        links = {name: f"{index:06d}{(real / name).suffix}" for index, name in enumerate(names)}
        rows = [[links[line["image"]], *(line[key] for key in header.split(",")[1:])]
                for line in lines if line["image"] in links]
    else:
        originals = original_frames(bench)[0][:most]
        link_frames(folder / "images", originals, len(originals))
        rows = [[f"{index:06d}{original.suffix}", "object", 40, 30, 120, 110]
                for index, original in enumerate(originals)]
    (folder / "boxes.csv").write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return folder, f"{len(names)} photographs of Pascal VOC, {len(rows)} boxes" if names else ""


def enlarged(bench, folder, count):
    """The first photographs with as many pixels as a telephone's: JPEGs whose longer side is 4000."""
    large = bench.folder("large")
    (large / "images").mkdir()
    with (folder / "boxes.csv").open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    lines = [header]
    for name in [*dict.fromkeys(row[0] for row in rows)][:count]:
        image = PIL.Image.open(folder / "images" / name).convert("RGB")
        width, height = (8 * round(500 * side / max(image.size)) for side in image.size)
        scale = width / image.width
        copy = f"{name.partition('.')[0]}.jpg"
        image.resize((width, height), PIL.Image.BICUBIC).save(large / "images" / copy, quality=90)
        lines += [[copy, kind, *(scale * float(edge) for edge in edges)] for own, kind, *edges in rows if own == name]
    (large / "boxes.csv").write_text("".join(",".join(map(str, line)) + "\n" for line in lines))
    return large


def measure(bench):
    settings = SETTINGS[bench.effort]
    folder, frames = photographs(bench, settings.most)
    table = Table("photographs", ["generator", "photographs", *(f"{stage} ms" for stage in STAGES)])
    part = Part([table], frames=frames)
    generators = {"esim": {"kind": "esim"}, "difference": {"kind": "difference"},
                  f"{settings.weights}, float32": {"weights": settings.weights}}
    try:
        weights = calibrated(bench, settings.weights, SIZE)
        generators[f"{settings.weights}, int8"] = {"weights": weights, "precision": "int8"}
    except NotCalibrated as error:
        part.missing[f"{settings.weights}, int8"] = str(error)
    masks = bench.scratch / "masks"
    manifest = bench.scratch / "outline.json"
    manifest.write_text(json.dumps(Photographs(str(folder), *SIZE, generator={"kind": "esim"}).manifest()))
    subprocess.run([bench.program, "outline", manifest, "--out", masks, "--progress", "none"], check=True,
                   capture_output=True)
    kinds = {"cut out meanwhile": {}, "outlines made before": {"outlines": str(masks)},
             "clips of 5 frames": {"frames_of_clip": 5},
             "12 megapixels": {"frames": str(enlarged(bench, folder, settings.large))}}
    jobs = {(name, kind): Photographs(**{"frames": str(folder), **options}, height=SIZE[0], width=SIZE[1],
                                      generator=generator)
            for name, generator in generators.items() for kind, options in kinds.items()}
    times = {key: [] for key in jobs}
    for turn in range(settings.rounds):
        for key in rotated([*jobs], turn):
            try:
                done = convert(bench.program, jobs[key])
            except ConversionRefused as error:
                part.missing[key[0]] = str(error)
                continue
            part.libraries.add(done.libraries)
            times[key].append([1000 * done.stage_s[stage] / done.pairs for stage in STAGES])
    for (name, kind), rounds in times.items():
        if rounds:
            table.add(name, kind, *map(spread, zip(*rounds)))
    return part
