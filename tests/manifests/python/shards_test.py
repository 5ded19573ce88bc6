"""eventgan_shards.Shards: reading, selecting, dividing, in workers of all kinds."""

import multiprocessing
import pickle

import h5py
import numpy as np
import pytest
from conftest import NAME, SECOND

from eventgan_shards import InvalidSample, Shards


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


def test_volumes_as_they_are_stored(example):
    expected = np.array(example.volumes[3], "float32").reshape(4, 6, 8)
    sample = Shards(example.path("uint8-1"), decode=False)[2]
    assert sample["volume"].dtype == np.uint8
    np.testing.assert_allclose(sample["volume"] * sample["scale"], expected, rtol=0, atol=3e-3)


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
    with pytest.raises(ValueError, match="expected sample ids of .*, got 2 that it does not have .'7', '000002'., in ids"):
        Shards(two_shards, ids=["7", "000000", "000002"])  # 000002 is in quarantine


def test_where(two_shards):
    assert ids_of(Shards(two_shards, where={"sequence": "drive_0"})) == ["000000", "000001"] * 2
    assert ids_of(Shards(two_shards, where={"class": "Car"})) == ["000000", "000003"] * 2
    assert ids_of(Shards(two_shards, where={"class": ["Car"], "sequence": ["drive_1"]})) == ["000003"] * 2
    assert len(Shards(two_shards, where={"gap": 2})) == 8
    assert len(Shards(two_shards, where={"class": "DontCare"})) == 0  # a box to be ignored is none
    for where in ({"gap": [1, 2]}, {"sequence": "drive_7"}, {"class": "Bus"}):
        with pytest.raises(ValueError, match="that it does not have"):
            Shards(two_shards, where=where)
    with pytest.raises(ValueError, match="expected a column pairs/weather, got none"):
        Shards(two_shards, where={"weather": "rain"})


def test_divided_parts_share_no_sequence(two_shards):
    shards = Shards(two_shards)
    for seed in range(5):
        first, second = shards.divide(0.5, seed=seed)
        assert len(first) + len(second) == 8
        sequences = [set(part.column("sequence")) for part in (first, second)]
        assert all(sequences) and not sequences[0] & sequences[1]
        assert ids_of(first) == ids_of(shards.divide(0.5, seed=seed)[0])
    assert {ids_of(shards.divide(0.4, seed=seed)[0])[0] for seed in range(8)} == {"000000", "000003", "000004"}
    with pytest.raises(ValueError, match="two or more values of sequence"):
        first[:1].divide(0.5)
    with pytest.raises(ValueError, match="between 0 and 1"):
        shards.divide(1)


def test_columns(two_shards):
    shards = Shards(two_shards)
    assert shards.column("gap").tolist() == [2] * 8
    assert shards[[5, 0]].column("sample_id").tolist() == ["000001", "000000"]
    assert shards.column("source_to_volume").shape == (8, 2, 3)


def test_what_pictures_cover(folder):
    with Shards(folder) as shards:
        assert shards.picture_area().tolist() == [0, 0, 8, 6]
    with h5py.File(folder / NAME, "r+") as file:  # 16 x 12 pixels at a quarter, with borders of 2, 1 and 2, 2
        del file["pairs/source_to_volume"]
        file["pairs/source_to_volume"] = [[[0.25, 0, 1.625], [0, 0.25, 0.625]]] * 5
    assert Shards(folder / NAME).picture_area().tolist() == [2, 1, 6, 4]
    with pytest.raises(ValueError, match="expected samples with pictures, got none"):
        shards[:0].picture_area()


def test_shards_that_are_not_done_are_left_out(two_shards):
    (two_shards / SECOND).with_suffix(".json").unlink()
    assert len(Shards(two_shards)) == 4
    with open(two_shards / NAME, "ab") as file:
        file.write(b"x")
    assert len(Shards(two_shards)) == 0
    assert len(Shards(two_shards.parent)) == 0


def test_other_files_and_words_are_refused(folder):
    for wrong in ({"invalid": "maybe"}, {"fields": ["volumes"]}, {"open_files": 0}, {"split": "val"}):
        with pytest.raises(ValueError, match="expected "):
            Shards(folder, **wrong)
    with h5py.File(folder / "other.h5", "w"):
        pass
    with pytest.raises(ValueError, match="expected eventgan-shard 1.*other.h5"):
        Shards(folder / "other.h5")
    (folder / "dataset.h5").touch()
    with pytest.raises(ValueError, match="expected dataset.json beside dataset.h5, got none"):
        Shards(folder / "dataset.h5")


@pytest.mark.parametrize("start", ["fork", "spawn"])
def test_workers_can_share_it(two_shards, start):
    shards = Shards(two_shards)
    shards[0]
    assert id_of(pickle.loads(pickle.dumps(shards)), 1) == "000001"
    with multiprocessing.get_context(start).Pool(2) as pool:
        assert pool.starmap(id_of, [(shards, i) for i in range(8)]) == ["000000", "000001", "000003", "000004"] * 2
    assert id_of(shards, 0) == "000000"
