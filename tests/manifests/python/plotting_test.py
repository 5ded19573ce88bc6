"""eventgan.show: the colours of `eventgan preview`, boxes by edges, joints by centres."""

import json
import os
import pathlib
import shutil
import subprocess
import sys

import numpy as np
import pytest
from conftest import SOURCE

import eventgan

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("agg")
import matplotlib.pyplot as plt

from eventgan import plotting

PROGRAM = os.environ["EVENTGAN_PROGRAM"]
BINS, HEIGHT, WIDTH = 9, 24, 32
ZOOM, GAP, TITLE = 8, 6, 24  # of a preview of so small volumes: four panels side by side (preview_image.cc)


@pytest.fixture(autouse=True)
def no_figure_is_left():
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demo") / "demo"
    subprocess.run([PROGRAM, "make-demo", folder], check=True, capture_output=True)
    return folder / "kitti" / "training"


def previewed(root, folder):
    """Shards of the streets, made in `folder`, and by slot the preview's panel of the events, [ZOOM H, ZOOM W, 3] red,
    green, blue."""
    cv2 = pytest.importorskip("cv2")
    manifest = {"format": "eventgan-manifest", "version": 1, "name": "job", "seed": 7,
                "sources": [{"dataset": "kitti_object", "root": str(root),
                             "pairs": {"gaps": [3], "side": "before", "choose": "one"}}],
                "image": {"width": WIDTH, "height": HEIGHT, "preset": "mpii"}, "generator": {"kind": "difference"},
                "output": {"directory": "out", "samples_per_shard": 64, "dtype": "float32"}}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    subprocess.run([PROGRAM, "convert", folder / "manifest.json", "--progress", "none"], check=True,
                   capture_output=True)
    subprocess.run([PROGRAM, "preview", folder / "out", "--out", folder / "images", "--count", "99"], check=True,
                   capture_output=True)
    panels, left, size = {}, GAP + 2 * (WIDTH * ZOOM + GAP), (HEIGHT * ZOOM, WIDTH * ZOOM)
    for path in (folder / "images").iterdir():
        image = cv2.imread(str(path))[..., ::-1]
        assert image.shape[1] == left + 2 * (size[1] + GAP)
        panels[int(path.stem.rpartition("_")[2])] = image[TITLE:TITLE + size[0], left:left + size[1]]
    return eventgan.Shards(folder / "out"), panels


def test_colours_are_those_of_preview(demo, tmp_path):
    bare = shutil.copytree(demo, tmp_path / "bare")  # nothing is drawn over the events
    for path in (bare / "label_2").iterdir():
        path.write_text("")
    shards, panels = previewed(bare, tmp_path)
    colours = set()
    assert len(panels) == len(shards) == 12
    for slot, panel in panels.items():
        image = eventgan.show(shards[slot]).images[0].get_array()
        assert image.shape == (HEIGHT, WIDTH, 3) and image.dtype == np.uint8
        np.testing.assert_allclose(image.repeat(ZOOM, 0).repeat(ZOOM, 1).astype(int), panel.astype(int), atol=1)
        colours.update(map(tuple, image.reshape(-1, 3).tolist()))
    assert len(colours) > 100


def test_colours_of_classes_and_of_what_is_ignored_are_those_of_preview(demo, tmp_path):
    shards, panels = previewed(demo, tmp_path)
    seen = set()
    for slot, panel in panels.items():
        sample, ax = shards[slot], eventgan.show(shards[slot])
        drawn = {tuple(colour) for colour in panel.reshape(-1, 3).tolist()}
        boxes = sample["boxes"]
        expected = [plotting.CLASSES[number] for number in boxes["class_id"][boxes["ignore"] == 0]]
        solid = [patch for patch in ax.patches if patch.get_linewidth() == 2]
        assert [tuple(np.rint(np.multiply(patch.get_edgecolor()[:3], 255)).astype(int)) for patch in solid] == expected
        assert len(ax.patches) == len(solid) + 2 * np.count_nonzero(boxes["ignore"])
        assert set(expected) <= drawn
        seen.update(expected)
    assert len(seen) >= 2
    source = (SOURCE / "stages" / "events" / "images" / "preview_image.cc").read_text()
    for red, green, blue in [*plotting.CLASSES, plotting.IGNORED, plotting.JOINT]:
        assert any(text in source
                   for text in (f"({blue}, {green}, {red})", f"{{{blue}, {green}, {red}}}")), (red, green, blue)


def one_event(value, at, bins=BINS):
    volume = np.zeros((2 * bins, 3, 5), np.float32)
    volume[at, 1, 2] = value
    return volume


@pytest.mark.parametrize(("at", "colour"), [(0, (40, 60, 255)), (BINS, (40, 60, 255)), (4, (40, 220, 60)),
                                            (2, (0, 220, 230)), (2 * BINS - 1, (255, 30, 30))])
def test_time_is_colour(at, colour):
    image = plotting.time_image(one_event(100, at))
    np.testing.assert_allclose(image[1, 2], colour, atol=1)  # e^-100 of black
    assert not image[np.arange(3) != 1].any() and not image[1, [0, 1, 3, 4]].any()


def test_brightness_is_how_many():
    for value in (0.1, 1.0, 3.0):
        np.testing.assert_allclose(plotting.time_image(one_event(value, 8))[1, 2],
                                   np.multiply((255, 30, 30), 1 - np.exp(-value)), atol=1)
    both = one_event(2, 0) + one_event(2, 2 * BINS - 1)  # half of them early, half late: green, in the middle
    np.testing.assert_allclose(plotting.time_image(both)[1, 2], np.multiply((40, 220, 60), 1 - np.exp(-4)), atol=1)


def test_extremes():
    assert not plotting.time_image(np.zeros((2, 1, 1))).any()
    assert plotting.time_image(one_event(50, 0, bins=1))[1, 2].tolist() == [40, 60, 255]
    for value in (np.nan, np.inf):
        image = plotting.time_image(one_event(value, 3))
        assert (image[1, 2] == 255).all() and image.sum() == 3 * 255
    for shape in ((3, 4), (3, 4, 5), (0, 4, 5), (1, 18, 4, 5)):
        with pytest.raises(ValueError,
                           match=rf"expected a volume \[2B, H, W\], got an array \[{', '.join(map(str, shape))}\]"):
            eventgan.show(np.zeros(shape))


def test_boxes_are_edges_and_joints_are_centres():
    ax = eventgan.show(np.zeros((18, 20, 30)), boxes=[[0, 0, 30, 20], [3, 4, 8.5, 6]],
                       joints=[[[3, 4], [np.nan, np.nan], [29, 19]]])
    assert [(patch.get_xy(), patch.get_width(), patch.get_height())
            for patch in ax.patches] == [((-0.5, -0.5), 30, 20), ((2.5, 3.5), 5.5, 2)]
    assert ax.get_xlim() == (-0.5, 29.5) and ax.get_ylim() == (19.5, -0.5)
    shown, hidden = ax.collections
    np.testing.assert_array_equal(shown.get_offsets(), [[3, 4], [29, 19]])
    assert not len(hidden.get_offsets())


def test_a_sample_s_own_labels_and_others_in_their_place():
    sample = {"volume": np.zeros((18, 20, 30), np.uint8), "scale": np.float32(0.1),
              "boxes": {"xyxy": np.array([[1.0, 2, 3, 4], [5, 6, 7, 8]]), "class_id": np.array([9, 8]),
                        "ignore": np.array([0, 1])},
              "persons": {"joints": np.array([[[1.0, 2], [3, 4], [-1, -1]]]),
                          "joints_source": np.array([[[9.0, 9], [9, 9], [-1, -1]]]), "visible": np.array([[1, 0, -1]])}}
    ax = eventgan.show(sample)
    # what is ignored lies below
    assert [patch.get_xy() for patch in ax.patches] == [(4.5, 5.5), (4.5, 5.5), (0.5, 1.5)]
    assert [patch.get_linestyle() in ("-", "solid") for patch in ax.patches] == [True, False, True]
    assert ax.patches[2].get_edgecolor()[:3] == tuple(np.divide(plotting.CLASSES[1], 255))  # 9 of two colours
    assert [each.get_offsets().tolist() for each in ax.collections] == [[[1, 2]], [[3, 4]]]  # visible, hidden
    ax = eventgan.show(sample, boxes=np.empty((0, 4)), joints=[])
    assert not ax.patches and not sum(len(each.get_offsets()) for each in ax.collections)
    own = {"volume": sample["volume"], "boxes": {"xyxy": [[1, 2, 3, 4]]}, "joints": [[[5, 6]]]}  # Generator.sample's
    assert len(eventgan.show(own).patches) == 1 and ax is not eventgan.show(own, ax=plt.gca())
    assert eventgan.show(own, ax=ax) is ax


def test_outlines_are_edges_too():
    sample = {"volume": np.zeros((18, 20, 30)), "boxes": {
        "xyxy": np.array([[1.0, 2, 5, 6], [7, 8, 9, 10]]), "class_id": np.array([1, 0]), "ignore": np.array([0, 0]),
        "outline": np.array([b"[[1,2,5,2,5,6],[3,3,3,4,4,4]]", b""], object)}}
    outer, hole, first, second = eventgan.show(sample).patches
    np.testing.assert_array_equal(outer.get_xy(), [(0.5, 1.5), (4.5, 1.5), (4.5, 5.5), (0.5, 1.5)])
    np.testing.assert_array_equal(hole.get_xy()[:3], [(2.5, 2.5), (2.5, 3.5), (3.5, 3.5)])
    assert outer.get_edgecolor() == first.get_edgecolor() != second.get_edgecolor() and not outer.get_fill()
    assert len(eventgan.show(sample, boxes=sample["boxes"]["xyxy"]).patches) == 2  # others in their place


def test_a_scale_is_that_of_the_stored_numbers():
    stored = (one_event(2, 8) * 10).astype(np.uint8)
    np.testing.assert_array_equal(eventgan.show({"volume": stored, "scale": np.float32(0.1)}).images[0].get_array(),
                                  plotting.time_image(np.multiply(stored, np.float32(0.1), dtype=np.float32)))


@pytest.mark.parametrize(("labels", "message"), [
    ({"boxes": [1, 2, 3, 4]}, r"expected boxes \[n, 4\], got an array \[4\]"),
    ({"boxes": [[1, 2, 3]]}, r"got an array \[1, 3\]"),
    ({"joints": [1, 2]}, r"expected joints \[J, 2\] or \[P, J, 2\], got an array \[2\]"),
    ({"joints": [[1, 2, 3]]}, r"got an array \[1, 3\]")])
def test_labels_of_another_shape_are_refused(labels, message):
    with pytest.raises(ValueError, match=message):
        eventgan.show(np.zeros((18, 20, 30)), **labels)


def test_a_sample_without_its_volume_is_refused():
    with pytest.raises(ValueError, match="expected a sample with its volume, got one with boxes, pair"):
        eventgan.show({"boxes": {}, "pair": {}})


def test_it_needs_no_opencv():
    code = "import eventgan, sys; sys.modules['cv2'] = None; import numpy; eventgan.show(numpy.zeros((18, 4, 5)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True,
                          env={**os.environ, "MPLBACKEND": "agg",
                               "PYTHONPATH": str(pathlib.Path(eventgan.__file__).parent.parent)})
    assert done.returncode == 0, done.stderr
