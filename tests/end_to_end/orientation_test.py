"""Photographs as telephones write them: stored lying, with an orientation in EXIF.
Labels are of the image as tools show it."""

import h5py
import numpy as np
import PIL.Image
import PIL.ImageOps

import program
from folders import quarantined
from program import run
from small_job import LENIENT

HEIGHT, WIDTH = 48, 32  # of the image held upright
# left, top, right, bottom of what is bright; on JPEG's blocks, so that its edges stay where they are
BOX = (8, 16, 24, 40)
# How an upright image is stored, by the tag (EXIF 2.32): 6 is shown turned by 90 degrees clockwise, and so on.
STORED = {1: lambda upright: upright, 3: lambda upright: np.rot90(upright, 2), 6: lambda upright: np.rot90(upright, 1),
          8: lambda upright: np.rot90(upright, -1), 2: np.fliplr}


class Orientation(program.InFolder):
    def write_photograph(self, name, upright, orientation):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        exif = PIL.Image.Exif()
        exif[0x0112] = orientation
        stored = np.ascontiguousarray(STORED[orientation](upright))
        PIL.Image.fromarray(stored).save(path, exif=exif, quality=95, lossless=True)
        shown = np.asarray(PIL.ImageOps.exif_transpose(PIL.Image.open(path)).convert("L"), dtype=int)
        self.assertLess(np.abs(shown - upright).max(), 3,
                        "another program must show it upright, else this tests nothing")

    def convert(self, orientations, image_format="jpg"):
        """A sequence of each orientation: an even image, then one with a bright place that has a box. The shard,
        opened."""
        dark = np.full((HEIGHT, WIDTH), 60, np.uint8)
        bright = dark.copy()
        left, top, right, bottom = BOX
        bright[top:bottom, left:right] = 200
        rows = ["image,class,left,top,right,bottom"]
        for orientation in orientations:
            for number, image in enumerate((dark, bright)):
                self.write_photograph(f"{image_format}/photos/seq{orientation}/{number}.{image_format}", image,
                                      orientation)
            rows.append(f"seq{orientation}/1.{image_format},lamp,{left},{top},{right},{bottom}")
        (self.folder / image_format / "labels.csv").write_text("\n".join(rows) + "\n")
        manifest = program.manifest(
            [{"dataset": "frames", "root": "photos", "labels": {"format": "csv", "path": "labels.csv"},
              "pairs": program.pairs([1])}],
            generator={"kind": "difference"}, errors=LENIENT)
        path = self.write_manifest(manifest, f"{image_format}/manifest.json")
        run("convert", path)
        return path.parent / "out"

    def test_a_box_lies_where_its_object_is(self):
        for image_format in ("jpg", "png", "webp"):
            with self.subTest(image_format):
                out = self.convert([1, 3, 6, 8], image_format)
                found = 0
                for file in sorted(out.glob("*-of-*.h5")):
                    with h5py.File(file) as shard:
                        for i in range(len(shard["valid"])):
                            self.assertTrue(shard["valid"][i])
                            volume = shard["events/volume"][i].astype(float).sum(axis=0)
                            self.assertEqual(volume.shape, (HEIGHT, WIDTH))
                            self.assertEqual(list(shard["pairs/source_size"][i]), [HEIGHT, WIDTH])
                            y, x = np.nonzero(volume > volume.max() / 2)
                            self.assertEqual((x.min(), y.min(), x.max() + 1, y.max() + 1), BOX)
                            first, last = shard["labels/boxes/offsets"][i:i + 2]
                            self.assertEqual(shard["labels/boxes/xyxy"][first:last].tolist(), [list(BOX)])
                            found += 1
                self.assertEqual(found, 4)
                run("verify", out, "--deep")
                run("preview", out, "--out", out.parent / "images", "--count", "4")

    def test_a_mirrored_one_is_quarantined_by_name(self):
        self.assertEqual(quarantined(self.convert([2, 6])), {
            "seq2/1": "expected an image that is not mirrored, got EXIF orientation 2, in photos/seq2/0.jpg (seq2/1)"})


if __name__ == "__main__":
    program.main()
