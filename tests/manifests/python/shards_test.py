"""eventgan.Shards: reading, selecting, dividing, in workers of all kinds."""

import collections
import json
import multiprocessing
import pickle
import xml.etree.ElementTree

import h5py
import numpy as np
import pytest
from conftest import NAME, SECOND

from eventgan import InvalidSample, Shards
from eventgan import open_shards


def ids_of(shards):
    return [shards.labels(i)["pair"]["sample_id"] for i in range(len(shards))]


def id_of(shards, index):
    return shards[index]["pair"]["sample_id"]


def test_a_folder_without_its_quarantined_samples(folder):
    shards = Shards(folder)
    assert ids_of(shards) == ["000000", "000001", "000003", "000004"]
    assert id_of(shards, -1) == "000004"
    with pytest.raises(IndexError, match="expected a sample of 4, got number 4"):
        shards[4]


def test_several_shards_follow_each_other(two_shards):
    shards = Shards(two_shards)
    assert [sample["slot"] for sample in shards] == [0, 1, 3, 4] * 2
    assert shards[4]["shard"].endswith(SECOND)


def test_parts_are_sequences_too(two_shards):
    shards = Shards(two_shards)
    assert [sample["slot"] for sample in shards[1:6]] == [1, 3, 4, 0, 1]
    assert [sample["slot"] for sample in shards[1:6][::-2]] == [1, 4, 1]
    assert [sample["slot"] for sample in shards[[7, 0]]] == [4, 0]
    assert len(shards[:0]) == len(shards[[]]) == 0
    assert shards[:0].persons.shape == (0, 2)


def test_no_more_shards_stay_open_than_asked(folder, example):
    paths = [example.path(f"{dtype}-{level}") for dtype in ("float32", "float16", "uint8") for level in (0, 1, 9)]
    shards = Shards(paths, open_files=2)
    assert len(list(shards)) == 36
    assert len(shards._files._open) == 2
    shards.close()
    assert shards[0]["valid"]  # opened again
    with Shards(folder) as again:
        assert len(again) == 4
    assert not again._files._open


@pytest.mark.parametrize(("kind", "tolerance"), [("float32-0", 0), ("float16-9", 1e-3), ("uint8-1", 3e-3)])
def test_volumes_are_decoded(example, kind, tolerance):
    expected = np.array(example.volumes[3], "float32").reshape(4, 6, 8)
    volume = Shards(example.path(kind))[2]["volume"]
    assert volume.dtype == np.float32
    np.testing.assert_allclose(volume, expected, rtol=0, atol=tolerance)


def test_the_library_decodes_what_h5py_reads(example, monkeypatch):
    if open_shards._engine_if_any() is None:
        pytest.skip("libeventgan is not built with sanitizers")
    for kind in (f"{dtype}-{level}" for dtype in ("float32", "float16", "uint8") for level in (0, 1, 9)):
        path = example.path(kind)
        with h5py.File(path) as file:
            stored, scale = file["events/volume"][:], file["events/scale"][:]
        shards = Shards(path)
        for sample in shards:
            expected = stored[sample["slot"]].astype(np.float32) * scale[sample["slot"]]
            assert sample["volume"].tobytes() == expected.tobytes()
            assert shards._files[path]._decoded(sample["slot"], 1.0) is not None
        with monkeypatch.context() as without:
            without.setattr(open_shards, "_engine_if_any", lambda: None)
            for sample, other in zip(shards, Shards(path)):
                assert sample["volume"].tobytes() == other["volume"].tobytes()


def test_volumes_with_other_filters_are_read_by_hdf5(folder):
    path = folder / NAME
    before = [sample["volume"] for sample in Shards(path)]
    with h5py.File(path, "r+") as file:  # as h5repack would leave it
        stored = file["events/volume"][:]
        attributes = dict(file["events/volume"].attrs)
        del file["events/volume"]
        again = file.create_dataset("events/volume", data=stored, chunks=(1, *stored.shape[1:]), compression="lzf")
        again.attrs.update(attributes)
    shards = Shards(path)
    assert shards._files[path]._decoded(0, 1.0) is None
    assert [sample["volume"].tobytes() for sample in shards] == [volume.tobytes() for volume in before]


def test_volumes_as_they_are_stored(example):
    expected = np.array(example.volumes[3], "float32").reshape(4, 6, 8)
    sample = Shards(example.path("uint8-1"), decode=False)[2]
    assert sample["volume"].dtype == np.uint8
    np.testing.assert_allclose(sample["volume"] * sample["scale"], expected, rtol=0, atol=3e-3)


def test_outlines_are_bytes_and_masks(example):
    shards = Shards(example.path("float16-1"))
    boxes = shards[0]["boxes"]
    assert list(boxes["outline"]) == [b"[[1,1,4.25,1,4.25,4.5,1,4.5],[2,2,2,3,3,3,3,2]]", b""]
    masks = shards.masks(0)
    expected = np.zeros((6, 8), bool)
    expected[1:4, 1:4] = True  # the centres 1.5 to 3.5; 4.5 is an edge, and belongs to what is below it
    expected[2, 2] = False
    assert masks.dtype == bool and masks.shape == (2, 6, 8)
    np.testing.assert_array_equal(masks, [expected, np.zeros((6, 8), bool)])
    assert shards.masks(1).shape == (0, 6, 8) and not shards.masks(2).any()
    with pytest.raises(IndexError, match="got number 4"):
        shards.masks(4)
    pickle.loads(pickle.dumps(shards[0]))
    assert "outline" not in Shards(example.path("unlabelled"))[0]["boxes"]
    assert Shards(example.path("unlabelled")).masks(0).shape == (0, 6, 8)


def test_masks_end_where_the_image_does(example, tmp_path):
    path = tmp_path / "letterbox.h5"
    path.write_bytes(example.path("float16-1").read_bytes())
    with h5py.File(path, "r+") as file:
        # 16 x 12 pixels as 8 x 4, with a row of border above and below: an edge maps as x / 2 and y / 3 + 1
        file["pairs/source_to_volume"][3] = [[1 / 2, 0, -1 / 4], [0, 1 / 3, 1 / 6 + 1 - 1 / 2]]
        outlines = file["labels/boxes/outline"]
        outlines[2] = np.frombuffer(b"[[-9,-9,99,-9,99,99,-9,99]]", np.uint8)
    expected = np.zeros((6, 8), bool)
    expected[1:5] = True
    np.testing.assert_array_equal(Shards(path).masks(2), [expected])


def half(sample):
    return sample["volume"] / 2


def test_changed_volumes(folder):
    shards = Shards(folder, invalid="keep", decode=False)
    changed = shards.changed(half).changed(lambda sample: sample["volume"] + sample["pair"]["gap_frames"])
    for stored, sample in zip(shards, changed):
        if sample["valid"]:
            np.testing.assert_allclose(sample["volume"],
                                       stored["volume"] * stored["scale"] / 2 + sample["pair"]["gap_frames"], rtol=1e-6)
            assert sample["volume"].dtype == np.float32 and "scale" not in sample
        else:
            assert not sample["volume"].any()
    assert changed[1:].sample(0, {"volume"})["volume"].tolist() == changed[1]["volume"].tolist()
    assert "pair" not in changed.sample(0, {"boxes"})
    assert (pickle.loads(pickle.dumps(shards.changed(half)))[0]["volume"].tolist()
            == shards.changed(half)[0]["volume"].tolist())


def test_labels(folder):
    shards = Shards(folder)
    first = shards[0]
    assert first["boxes"]["xyxy"].tolist() == [[1, 1, 4.25, 4.5], [0, 0, 0.5, 0.5]]
    assert first["boxes"]["ignore"].tolist() == [0, 1]
    assert first["persons"]["joints"].shape == (2, 3, 2)
    assert first["persons"]["camera_distortion"].shape == (2, 5)
    assert np.isnan(first["persons"]["joints3d_mm"][1, 0]).all()  # this joint is not known
    assert first["persons"]["joints3d_mm"][1, 1].tolist() == [4, 5, 3001]
    assert first["original"] == b"Car 0.10 0 1.57 2.00 2.00 8.50 9.00\r\nDontCare\n"
    assert first["pair"]["gap_frames"] == 2
    assert first["pair"]["source_to_volume"].shape == (2, 3)
    assert shards[1]["boxes"]["xyxy"].shape == (0, 4)
    assert shards.class_names(0) == ["Car", "DontCare"]
    assert shards.joint_names(-1) == ["nose", "left hand", "right hand"]
    assert shards.class_counts() == {"Car": 2, "DontCare": 0}
    assert shards[1:].class_counts() == {"Car": 1, "DontCare": 0}


def test_flow(folder):
    still = Shards(folder, fields=["flow", "pair"])[-1]
    assert still["pair"]["sample_id"] == "000004"
    assert still["flow"].dtype == np.float16 and still["flow"].shape == (2, 6, 8)
    assert (still["flow"][0] == 0.5).all() and (still["flow"][1] == -0.25).all()
    assert still["flow_valid"].dtype == np.uint8 and still["flow_valid"].sum() == 7 * 5  # within the volume of 8 x 6
    assert "flow" not in Shards(folder, fields=["pair"])[0]


def table(shards):
    """What a notebook shows, by row."""
    rows = xml.etree.ElementTree.fromstring(shards._repr_html_())
    assert rows.tag == "table"
    return {row[0].text: row[1].text for row in rows.iter("tr")}


def test_what_is_printed(two_shards):
    shards = Shards(two_shards, split="train")
    assert repr(shards) == f"<eventgan.Shards {two_shards}, split train: 8 samples of 2 shards>"
    first, *rows = str(shards).splitlines()
    assert first == f"{two_shards}, split train"
    assert dict(row.split(maxsplit=1) for row in rows if "gaps" not in row) == {
        what: text for what, text in table(shards).items() if "gaps" not in what}
    assert str(shards[:0]).splitlines()[1].split() == ["samples", "0"]


def test_where_there_are_no_shards(tmp_path):
    with pytest.raises(FileNotFoundError, match="expected a folder of shards, or a shard, got no such file: .*nothing"):
        Shards(tmp_path / "nothing")
    (tmp_path / "text.h5").write_text("text")
    with pytest.raises(OSError, match="expected a shard, got what HDF5 does not open .*text.h5"):
        Shards(tmp_path / "text.h5")


def test_what_a_notebook_shows(two_shards, monkeypatch):
    monkeypatch.setattr(open_shards.OpenShard, "volume", None)  # is not touched
    shards = Shards(two_shards)
    gaps, classes = collections.Counter(shards.column("gap").tolist()), shards.class_counts()
    shown = table(shards)
    assert shown == {"samples": "8", "splits": "train: 8", "sources": f"{shards.column('dataset')[0]}: 8",
                     "gaps, frames": ", ".join(f"{gap}: {gaps[gap]}" for gap in sorted(gaps)),
                     "boxes": ", ".join(f"{name}: {classes[name]}" for name in sorted(classes) if classes[name]),
                     "volumes": "4 x 6 x 8, uint8: 8", "quarantined": "2 in these shards"}
    assert any(classes.values()) and not all(classes.values())  # those without a box are left out
    assert table(Shards(two_shards, invalid="keep"))["samples"] == "10"
    part = table(shards[[0]])
    assert part["volumes"] == "4 x 6 x 8, uint8: 1" and part["quarantined"] == shown["quarantined"]
    assert part["boxes"] == (", ".join(f"{name}: {count}" for name, count in sorted(shards[[0]].class_counts().items())
                                       if count) or "none")
    assert table(shards[:0]) == {"samples": "0", "quarantined": "2 in these shards"}


def test_what_a_notebook_shows_opens_a_shard_once(two_shards, monkeypatch):
    shards, opened = Shards(two_shards, open_files=1), []
    shards.close()
    monkeypatch.setattr(open_shards, "open_shard",
                        lambda path, open_shard=open_shards.open_shard: opened.append(path) or open_shard(path))
    shards._repr_html_()
    assert opened == shards.paths


def test_what_a_notebook_shows_is_escaped(folder, tmp_path):
    name = "<script>&amp;"
    folder.rename(tmp_path / name)
    with h5py.File(tmp_path / name / NAME, "r+") as file:
        file.attrs["dataset"] = "<b>"
    (tmp_path / name / NAME).with_suffix(".json").unlink()
    html = Shards([tmp_path / name / NAME])._repr_html_()
    assert "<script" not in html and "<b>" not in html and "&lt;b&gt;: 4" in html and "&lt;script&gt;&amp;amp;" in html


def test_labels_do_not_touch_volumes(folder):
    with h5py.File(folder / NAME, "r+") as file:  # the first volume's bytes are spoilt, so that its checksum is wrong
        where = file["events/volume"].id.get_chunk_info(0).byte_offset
    with open(folder / NAME, "r+b") as file:
        file.seek(where)
        file.write(b"\xff" * 8)
    shards = Shards(folder)
    assert shards.labels(0)["boxes"]["xyxy"].shape == (2, 4)
    assert shards.persons.tolist() == [[0, 0], [0, 1], [3, 0]]
    assert Shards(folder, fields=["pair"])[0].keys() == {"pair", "valid", "shard", "slot"}
    with pytest.raises(OSError):
        shards[0]


def test_labels_are_read_once(folder):
    shards = Shards(folder)
    assert shards.labels(0)["boxes"]["xyxy"].base is shards.labels(0)["boxes"]["xyxy"].base is not None


def test_persons_of_a_part(two_shards):
    assert Shards(two_shards)[[7, 4]].persons.tolist() == [[0, 0], [1, 0], [1, 1]]


def test_quarantined_samples_raise_with_the_reason(folder):
    shards = Shards(folder, invalid="raise")
    assert len(shards) == 5
    with pytest.raises(InvalidSample, match="cannot decode kitti/image_2/000002.png"):
        shards[2]


def test_quarantined_samples_can_be_kept(folder):
    sample = Shards(folder, invalid="keep")[2]
    assert not sample["valid"]
    assert not sample["volume"].any()


def test_ids_from_a_list_or_a_file(two_shards, tmp_path):
    assert ids_of(Shards(two_shards, ids=["000003"])) == ["000003"] * 2
    listed = tmp_path / "ids.txt"
    listed.write_text("000004\n\n000000\n")
    assert ids_of(Shards(two_shards, ids=listed)) == ["000000", "000004"] * 2
    assert len(Shards(two_shards, ids=[])) == 0
    listed.write_text("000004\n", encoding="utf-8-sig")  # as Windows' editors begin a file
    assert ids_of(Shards(two_shards, ids=listed)) == ["000004"] * 2
    with pytest.raises(ValueError, match=r"expected sample ids of .* \('000000', '000001', .*\), got 1 that it does "
                       r"not have .'7'., in ids"):
        Shards(two_shards, ids=["7", "000000", "000002"])  # 000002 is in quarantine


def test_ids_in_quarantine_are_skipped_with_a_word(folder):
    with pytest.warns(UserWarning, match="1 samples named by ids are quarantined and skipped .000002., in"):
        assert ids_of(Shards(folder, ids=["000001", "000002"])) == ["000001"]
    assert len(Shards(folder, ids=["000002"], invalid="keep")) == 1


def write_column(path, name, values=None):
    with h5py.File(path, "r+") as file:
        if "pairs/" + name in file:
            del file["pairs/" + name]
        if values is not None:
            file["pairs/" + name] = values
    record = path.with_suffix(".json")
    record.write_text(json.dumps({**json.loads(record.read_text()), "size_bytes": path.stat().st_size}))


def test_a_class_has_one_number_in_every_split(two_shards):
    second = two_shards / SECOND
    with h5py.File(second, "r+") as file:
        names = list(file["labels/boxes/class_id"].attrs["class_names"])
        file["labels/boxes/class_id"].attrs["class_names"] = ["Bike", *names[::-1]]
        file.attrs["split"] = "val"
    record = second.with_suffix(".json")
    record.write_text(json.dumps({**json.loads(record.read_text()), "size_bytes": second.stat().st_size}))
    for split in ("train", "val", None):
        assert Shards(two_shards, split=split).known_classes() == [*names, "Bike"]


def test_a_frame_s_id_stands_for_all_its_samples(folder):
    write_column(folder / NAME, "sample_id", ["000001@before1", "000001@around2", "000002", "a@b", "000001@b@after1"])
    assert ids_of(Shards(folder, ids=["000001"])) == ["000001@before1", "000001@around2"]
    assert ids_of(Shards(folder, ids=["000001@around2", "a@b"])) == ["000001@around2", "a@b"]


def test_many_ids_are_found_at_once(folder):
    shards = Shards(folder)
    shards.column = lambda name: np.array([f"{i}@before1" for i in range(100_000)], object)
    # pair by pair it would not end
    chosen = shards._with_ids([str(i) for i in range(0, 100_000, 2)], np.ones(100_000, bool))
    assert chosen.tolist() == [True, False] * 50_000


def test_where(two_shards):
    assert ids_of(Shards(two_shards, where={"sequence": "drive_0"})) == ["000000", "000001"] * 2
    assert ids_of(Shards(two_shards, where={"class": "Car"})) == ["000000", "000003"] * 2
    assert ids_of(Shards(two_shards, where={"class": ["Car"], "sequence": ["drive_1"]})) == ["000003"] * 2
    assert len(Shards(two_shards, where={"gap": 2})) == 8
    # a box to be ignored is none
    for where in ({"gap": [1, 2]}, {"sequence": "drive_7"}, {"class": "Bus"}, {"class": "DontCare"}):
        with pytest.raises(ValueError, match="that it does not have"):
            Shards(two_shards, where=where)
    with pytest.raises(ValueError, match=f"expected a split of train, got 'val', in {two_shards}"):
        Shards(two_shards, split="val")
    with pytest.raises(ValueError,
                       match=r"expected classes of .* \('Car'\), got 1 that it does not have \('Bus'\), in where"):
        Shards(two_shards, where={"class": ["Car", "Bus"]})
    with pytest.raises(ValueError, match=r"expected values of sequence of .* \('drive_0', 'drive_1', 'drive_2'\), got "
                       r"1 that it does not have \('drive_7'\)"):
        Shards(two_shards, where={"sequence": "drive_7"})
    with pytest.raises(ValueError, match=f"expected values of gap of {two_shards}, split train .2., got 1 that it does "
                       "not have .1., in where"):
        Shards(two_shards, split="train", where={"gap": 1})
    with pytest.raises(ValueError, match="expected a column of action, camera, .*, got 'weather', in "):
        Shards(two_shards, where={"weather": "rain"})


def test_columns_that_only_some_shards_have(two_shards):
    write_column(two_shards / NAME, "subject", ["S1", "S1", "S5", "S5", "S7"])
    write_column(two_shards / SECOND, "subject")
    write_column(two_shards / NAME, "prev_time_s")
    write_column(two_shards / SECOND, "prev_time_s", np.arange(5.0))
    shards = Shards(two_shards)
    assert shards.column("subject").tolist() == ["S1", "S1", "S5", "S7", "", "", "", ""]
    assert shards[4:].column("subject").tolist() == [""] * 4
    np.testing.assert_equal(shards.column("prev_time_s"), [np.nan] * 4 + [0, 1, 3, 4])
    assert len(Shards(two_shards, where={"subject": ["S1", "S7"]})) == 3
    assert ids_of(Shards(two_shards, where={"subject": ""})) == ids_of(shards)[4:]
    first, second = shards.divide(0.5, by="subject")
    assert not set(first.groups("subject")) & set(second.groups("subject"))


def test_the_order_of_where_does_not_matter(two_shards):
    for where in ({"class": "Car", "sequence": "drive_1"}, {"sequence": "drive_1", "class": "Car"}):
        assert ids_of(Shards(two_shards, where=where)) == ["000003"] * 2
    one, other = {"ids": ["000001"]}, {"sequence": "drive_1"}
    assert len(Shards(two_shards, where=other, **one)) == 0  # both exist, but in no sample together
    assert (len(Shards(two_shards, where={**other, "sample_id": "000001"}))
            == len(Shards(two_shards, where={"sample_id": "000001", **other})) == 0)


def test_divided_parts_share_no_sequence(two_shards):
    shards = Shards(two_shards)
    for seed in range(5):
        first, second = shards.divide(0.5, seed=seed)
        assert len(first) + len(second) == 8
        sequences = [set(part.column("sequence")) for part in (first, second)]
        assert all(sequences) and not sequences[0] & sequences[1]
        assert ids_of(first) == ids_of(shards.divide(0.5, seed=seed)[0])
    assert {ids_of(shards.divide(0.4, seed=seed)[0])[0] for seed in range(8)} == {"000000", "000003", "000004"}
    name = first[:1].groups()[0]
    with pytest.raises(ValueError, match=f"expected samples of two or more groups by sequence, one for each part, got "
                                         f'1 of {name} alone, in .*; by="sample_id" divides by labelled frame'):
        first[:1].divide(0.5)
    with pytest.raises(ValueError, match="by sample_id, .* alone, in [^;]*$"):
        first[:1].divide(0.5, by="sample_id")
    with pytest.raises(ValueError, match="between 0 and 1"):
        shards.divide(1)


def test_divided_parts_share_no_frame_and_no_take(two_shards):
    for path in (NAME, SECOND):
        for column in ("subject", "action", "drive"):
            write_column(two_shards / path, column)
        write_column(two_shards / path, "sequence", ["drive_0", "", "", "", ""])
        write_column(two_shards / path, "sample_id", ["0@before1", "1@before1", "2", "1@before2", "4"])
    shards = Shards(two_shards)
    assert shards.groups().tolist() == ["drive_0", "1", "1", "4"] * 2
    assert shards.groups("sample_id").tolist() == ["0", "1", "1", "4"] * 2
    shards.close()
    write_column(two_shards / NAME, "dataset", ["human36m"] * 5)
    write_column(two_shards / NAME, "subject", ["S1"] * 5)
    write_column(two_shards / NAME, "action", ["Walking", "Walking", "", "Eating", ""])
    write_column(two_shards / SECOND, "drive", ["d", "", "", "d", ""])
    shards = Shards(two_shards)
    assert shards.groups().tolist() == ["S1/Walking", "S1/Walking", "S1/Eating", "4", "d", "1", "d", "4"]
    for seed in range(4):
        first, second = shards.divide(0.5, seed=seed)
        assert len(first) and len(second) and not set(first.groups()) & set(second.groups())


def test_columns(two_shards):
    shards = Shards(two_shards)
    assert shards.column("gap").tolist() == [2] * 8
    assert shards[[5, 0]].column("sample_id").tolist() == ["000001", "000000"]
    assert shards.column("source_to_volume").shape == (8, 2, 3)


def test_what_images_cover(folder):
    with Shards(folder) as shards:
        assert shards.image_area().tolist() == [0, 0, 8, 6]
    with h5py.File(folder / NAME, "r+") as file:  # 16 x 12 pixels at a quarter, with borders of 2, 1 and 2, 2
        del file["pairs/source_to_volume"]
        file["pairs/source_to_volume"] = [[[0.25, 0, 1.625], [0, 0.25, 0.625]]] * 5
    assert Shards(folder / NAME).image_area().tolist() == [2, 1, 6, 4]
    # stills of 16x8, of which the letterbox shows the middle 8x4 in 8x4 of its 8x6 pixels
    with h5py.File(folder / NAME, "r+") as file:
        file["pairs/motion"][:] = [[1, 0, 0, 1]] * 5
        file["pairs/source_size"][:] = [[8, 16]] * 4 + [[0, 0]]
        file["pairs/source_to_volume"][:] = [[[1, 0, -4], [0, 1, -1]]] * 4 + [[[np.nan] * 3] * 2]
        file.attrs["preprocessing"] = json.dumps({"fit": "letterbox"})
    assert Shards(folder / NAME).image_area().tolist() == [0, 1, 8, 5]
    with pytest.raises(ValueError, match="expected samples with images, got none"):
        shards[:0].image_area()


def test_shards_that_are_not_done_are_named_or_left_out(two_shards):
    whole = (two_shards / SECOND).read_bytes()
    (two_shards / SECOND).write_bytes(whole[:-1])  # the commit record tells how many bytes there are
    with pytest.raises(ValueError, match=f"expected 2 finished shards, got 1 unfinished .{SECOND}., in"):
        Shards(two_shards)
    (two_shards / SECOND).write_bytes(whole)
    assert len(Shards(two_shards)) == 8
    (two_shards / SECOND).with_suffix(".json").unlink()
    with pytest.raises(ValueError, match=f"expected 2 finished shards, got 1 unfinished .{SECOND}., in"):
        Shards(two_shards)
    assert len(Shards(two_shards, partial=True)) == 4
    (two_shards / SECOND).unlink()
    assert len(Shards(two_shards)) == 4
    (two_shards / "plan.json").write_text(
        json.dumps({"shards": [{"name": NAME}, {"name": "demo-train-00001-of-00003.h5"}]}))
    with pytest.raises(ValueError, match="expected 2 finished shards, got 1 unfinished .demo-train-00001-of-00003.h5."):
        Shards(two_shards)
    (two_shards / "plan.json").unlink()
    (two_shards / NAME).rename(two_shards / "other")  # a commit record alone
    with pytest.raises(ValueError, match=f"expected 1 finished shards, got 1 unfinished .{NAME}."):
        Shards(two_shards)
    for none in (two_shards, two_shards.parent, []):
        with pytest.raises(ValueError, match="expected finished shards, got none"):
            Shards(none, partial=True)


def test_a_description_that_misses_shards(folder):
    record = json.loads((folder / NAME).with_suffix(".json").read_text())
    entry = {"name": NAME, "split": "train", "samples": 5, "size_bytes": record["size_bytes"],
             "sha256": record["sha256"]}
    quarantined = [{"shard": NAME, "slot": 2}]
    (folder / "dataset.json").write_text(json.dumps({"format": "eventgan-dataset", "version": "1.0", "shards": [entry],
                                                     "missing": [SECOND], "quarantined": quarantined}))
    with pytest.raises(ValueError, match=f"expected 2 finished shards, got 1 unfinished .{SECOND}."):
        Shards(folder)
    assert len(Shards(folder, partial=True)) == 4


@pytest.mark.parametrize("name", [f"../out/{NAME}", "{folder}/" + NAME, f"./{NAME}", "other.h5", f"{NAME}\n",
                                  f"..-train-{NAME}", 7])
def test_names_in_a_description_that_are_no_shards_are_refused(folder, name):
    record = json.loads((folder / NAME).with_suffix(".json").read_text())
    name = name.format(folder=folder) if isinstance(name, str) else name
    (folder / "other.h5").write_bytes((folder / NAME).read_bytes())
    entry = {"name": name, "split": "train", "samples": 5, "size_bytes": record["size_bytes"],
             "sha256": record["sha256"]}
    (folder / "dataset.json").write_text(json.dumps({"format": "eventgan-dataset", "version": "1.0", "shards": [entry],
                                                     "quarantined": []}))
    with pytest.raises(ValueError, match="expected the name of a shard beside it, got .*dataset.json"):
        Shards(folder)


def test_the_fields_asked_for(folder):
    shards = Shards(folder, fields=["pair"])
    assert shards.sample(0).keys() == {"pair", "valid", "shard", "slot"}
    assert shards.sample(0, ["boxes"]).keys() == {"boxes", "valid", "shard", "slot"}
    for wrong in (["volumes"], "pair"):
        with pytest.raises(ValueError, match="expected "):
            shards.sample(0, wrong)
        with pytest.raises(ValueError, match="expected "):
            Shards(folder, fields=wrong)


def test_other_files_and_words_are_refused(folder):
    for wrong in ({"invalid": "maybe"}, {"fields": ["volumes"]}, {"open_files": 0}, {"split": "val"}):
        with pytest.raises(ValueError, match="expected "):
            Shards(folder, **wrong)
    with h5py.File(folder / "other.h5", "w"):
        pass
    with pytest.raises(ValueError, match="expected eventgan-shard 1.x, got None None, in .*other.h5"):
        Shards(folder / "other.h5")
    (folder / "dataset.h5").touch()
    with pytest.raises(ValueError, match="expected dataset.json beside dataset.h5, got none"):
        Shards(folder / "dataset.h5")


@pytest.mark.parametrize("version", ["2.0", "1", "1.", "1.0.0", "11.0", 1])
def test_another_major_version_is_refused(folder, version):
    with h5py.File(folder / NAME, "r+") as file:
        file.attrs["format_version"] = version
    with pytest.raises(ValueError, match=f"expected eventgan-shard 1.x, got eventgan-shard {version}, in .*{NAME}"):
        Shards(folder / NAME)


def test_another_minor_version_is_read_and_features_unknown_are_named_once(folder):
    plain = Shards(folder / NAME)[0]
    with h5py.File(folder / NAME, "r+") as file:
        file.attrs["format_version"] = "1.7"
        file.attrs["features"] = ["tiles", "masks"]
    with pytest.warns(UserWarning, match="has 'masks', which this version of eventgan does not know") as told:
        sample = Shards(folder / NAME)[0]
        Shards(folder / NAME)
    assert len(told) == 1
    np.testing.assert_array_equal(sample["volume"], plain["volume"])


@pytest.mark.parametrize("start", ["fork", "spawn"])
def test_workers_can_share_it(two_shards, start):
    shards = Shards(two_shards)
    shards[0]
    assert id_of(pickle.loads(pickle.dumps(shards)), 1) == "000001"
    with multiprocessing.get_context(start).Pool(2) as pool:
        assert pool.starmap(id_of, [(shards, i) for i in range(8)]) == ["000000", "000001", "000003", "000004"] * 2
    assert id_of(shards, 0) == "000000"
