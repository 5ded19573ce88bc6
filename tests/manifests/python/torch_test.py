"""eventgan.torch: volumes, boxes and joints that stay together whatever is done to them."""

import dataclasses
import re

import h5py
import numpy as np
import pytest
from conftest import NAME, SOURCE, TRAINERS

torch = pytest.importorskip("torch")
from torch.utils.data import DataLoader

from eventgan import Shards
from eventgan.torch import (DetectionDataset, EventAugmentation, FlowDataset, HalfVolumes, KeypointDataset,
                            PoseAugmentation, PoseDataset, collate_torchvision, collate_yolo,
                            exchange_first_convolution, fitted, flip_pairs, heatmaps, mixture, move_boxes, move_points)

JOINTS = ["nose", "left hand", "right hand"]


def test_detection_items(shards):
    items = DetectionDataset(shards)
    assert items.classes == {"Car": 0}
    first = items[0]
    assert first["volume"].shape == (4, 6, 8) and first["volume"].dtype == torch.float32
    assert first["boxes"].tolist() == [[1, 1, 4.25, 4.5], [0, 0, 0.5, 0.5]]
    assert first["labels"].tolist() == [0, -1] and first["ignore"].tolist() == [False, True]
    assert (first["id"], first["index"]) == ("000000", 0)
    assert items[1]["boxes"].shape == (0, 4)
    assert len(items) == 4


def test_classes_may_be_joined_chosen_or_unknown(shards):
    assert DetectionDataset(shards, {"Car": 3, "DontCare": 1})[0]["labels"].tolist() == [3, 1]
    assert DetectionDataset(shards, ["DontCare"])[0]["boxes"].shape == (1, 4)
    with pytest.raises(ValueError, match="expected classes of Car, DontCare, got Bus"):
        DetectionDataset(shards, ["Car", "Bus"])
    with pytest.raises(ValueError, match=r"got cra, in .*; did you mean Car\?$"):
        DetectionDataset(shards, ["cra"])
    with pytest.raises(ValueError, match=r"expected a list of classes, such as \['person'\], got 'Car'"):
        DetectionDataset(shards, "Car")
    with pytest.raises(ValueError, match=r"expected a size of height and width, such as \(192, 320\), got 192"):
        DetectionDataset(shards, size=192)


def test_detection_items_of_another_size(shards):
    item = DetectionDataset(shards, size=(8, 4))[0]
    assert item["volume"].shape == (4, 8, 4)
    assert torch.equal(item["volume"][:, :6], DetectionDataset(shards)[0]["volume"][:, :, :4])
    assert item["volume"][:, 6:].sum() == 0
    assert item["boxes"].tolist() == [[1, 1, 4, 4.5], [0, 0, 0.5, 0.5]]
    narrow = DetectionDataset(shards, size=(6, 1))[0]  # a box that is cut off whole is gone
    assert narrow["labels"].tolist() == [-1]
    assert DetectionDataset(shards, size=(6, 5))[2]["boxes"].shape == (0, 4)  # it began at 5
    assert DetectionDataset(shards, size=(2, 8), visible=0.5)[0]["ignore"].tolist() == [True, True]  # 1/3.5 is left


def test_classes_are_numbered_alike_in_all_parts(folder):
    with h5py.File(folder / NAME, "r+") as file:
        file["labels/boxes/class_id"].attrs["class_names"] = ["Van", "Car", "DontCare"]
        file["labels/boxes/class_id"][...] += 1
    assert [DetectionDataset(part).classes
            for part in (Shards(folder / NAME), Shards(folder / NAME)[1:2])] == [{"Van": 0, "Car": 1}] * 2


def test_volumes_that_the_shards_leave_stored_are_decoded(folder):
    stored, plain = Shards(folder, decode=False), Shards(folder)
    assert stored[0]["volume"].dtype == np.uint8
    for dataset in (DetectionDataset, KeypointDataset):
        assert torch.equal(dataset(stored)[0]["volume"], dataset(plain)[0]["volume"])
    assert torch.equal(PoseDataset(stored, size=(64, 64))[0][0], PoseDataset(plain, size=(64, 64))[0][0])


def test_boxes_are_mirrored_with_their_events(shards):
    plain, mirrored = DetectionDataset(shards)[0], DetectionDataset(shards, augmentation=EventAugmentation(flip=1))[0]
    assert torch.equal(mirrored["volume"], plain["volume"].flip(2))
    assert mirrored["boxes"].tolist() == [[3.75, 1, 7, 4.5], [7.5, 0, 8, 0.5]]


def test_an_area_of_the_volume_fills_the_item(shards):
    affine = fitted([2, 1, 6, 3], (24, 32))  # 4 x 2 pixels, 8 times as large, 4 rows free above and below
    assert move_boxes([[2, 1, 6, 3]], affine).tolist() == [[0, 4, 32, 20]]
    item = DetectionDataset(shards, size=(24, 32), view=affine)[0]
    assert item["volume"].shape == (4, 24, 32) and item["boxes"][0].tolist() == [0, 4, 18, 24]
    mirrored = DetectionDataset(shards, size=(24, 32), view=affine, augmentation=EventAugmentation(flip=1))[0]
    assert mirrored["boxes"][0].tolist() == [14, 4, 32, 24]
    np.testing.assert_allclose(mirrored["volume"], item["volume"].flip(2), atol=1e-5)
    keypoints = KeypointDataset(shards, JOINTS, size=(24, 32), view=affine)[0]["keypoints"][0]
    np.testing.assert_allclose(keypoints[1, :2], [(2.25 + 0.5 - 2) * 8 - 0.5, (2.875 + 0.5 - 1) * 8 + 4 - 0.5])


STAY = EventAugmentation(flip=0)


@pytest.mark.parametrize("augmentation, size, flow, valid", [
    (None, None, (0.5, -0.25), (1, 0, 8, 5)),  # of 8 x 6; it leads back by half a column, on by a quarter of a row
    (None, (5, 9), (0.5, -0.25), (1, 0, 8, 4)),
    (dataclasses.replace(STAY, flip=1), None, (-0.5, -0.25), (0, 0, 7, 5)),
    (dataclasses.replace(STAY, scale=(2, 2)), None, (1, -0.5), (1, 0, 8, 5)),
    (dataclasses.replace(STAY, reverse=1, reverse_all=True), None, (-0.5, 0.25), (1, 0, 8, 5)),
    (dataclasses.replace(STAY, reverse=1, invert=1), None, (0.5, -0.25), (1, 0, 8, 5))])
def test_flow_moves_with_the_volume(shards, augmentation, size, flow, valid):
    still = shards[[3]]
    item = FlowDataset(still, size, augmentation)[0]
    height, width = size or (6, 8)
    assert item["id"] == "000004" and item["volume"].shape[1:] == item["valid"].shape == (height, width)
    left, top, right, bottom = valid
    expected = torch.zeros(height, width, dtype=torch.bool)
    expected[top:bottom, left:right] = True
    assert torch.equal(item["valid"], expected)
    for channel, value in zip(item["flow"], flow):
        assert (channel[expected] == value).all()
    assert item["label_position"] == (0 if augmentation and augmentation.reverse_all else 1)


def test_flow_is_asked_for_where_there_is_none(shards):
    with pytest.raises(ValueError, match='expected a sample with flow .*, got none, in .* \\(000000\\)'):
        FlowDataset(shards)[0]


def test_what_a_yolo_trainer_takes(shards):
    imgs, targets, ids = next(iter(DataLoader(DetectionDataset(shards), batch_size=4, collate_fn=collate_yolo)))
    assert imgs.shape == (4, 4, 6, 8) and imgs.dtype == torch.float32
    np.testing.assert_allclose(targets,
                               [[0, 0, 2.625 / 8, 2.75 / 6, 3.25 / 8, 3.5 / 6], [2, 0, 6.5 / 8, 1.5 / 6, 3 / 8, 3 / 6]],
                               rtol=1e-6)
    assert ids == ["000000", "000001", "000003", "000004"]
    assert collate_yolo([DetectionDataset(shards)[1]])[1].shape == (0, 6)


def test_what_torchvision_takes(shards):
    images, targets = collate_torchvision([DetectionDataset(shards)[i] for i in (0, 1)])
    assert [image.shape for image in images] == [(4, 6, 8)] * 2
    assert targets[0]["boxes"].tolist() == [[1, 1, 4.25, 4.5]] and targets[0]["labels"].tolist() == [1]
    assert targets[1]["boxes"].shape == (0, 4) and targets[1]["labels"].dtype == torch.int64


def test_keypoint_items(shards):
    item = KeypointDataset(shards, JOINTS, margin=0)[0]
    # 1.5, 1.75 and 2.25, 2.875; the second person also has 3.25, 3.25. The centre of a pixel is 0.5 right of its left
    # edge.
    np.testing.assert_allclose(item["boxes"], [[1.5, 1.75, 3.25, 3.875], [1.5, 1.75, 4.25, 4.25]])
    assert item["keypoints"][0].tolist() == [[1.5, 1.75, 2], [2.25, 2.875, 1], [0, 0, 0]]
    assert item["keypoints"][1].tolist() == [[1.5, 1.75, 2], [2.25, 2.875, 1], [3.25, 3.25, 2]]
    mirrored = KeypointDataset(shards, JOINTS, augmentation=EventAugmentation(flip=1))[0]["keypoints"][1]
    assert mirrored.tolist() == [[5.5, 1.75, 2], [3.75, 3.25, 2], [4.75, 2.875, 1]]
    assert KeypointDataset(shards, JOINTS)[1]["keypoints"].shape == (0, 3, 3)
    images, targets = collate_torchvision([item])
    assert targets[0]["keypoints"].shape == (2, 3, 3)


def test_mirrored_joints():
    assert flip_pairs(["left hand", "nose", "right hand", "head"]) == [(0, 2)]
    assert flip_pairs(["RightFoot", "Hips", "LeftFoot", "R_Wrist_End", "L_Wrist_End"]) == [(2, 0), (4, 3)]
    assert flip_pairs(["r_hip", "l_hip", "pelvis", "l_wrist", "r_wrist"]) == [(1, 0), (3, 4)]
    assert flip_pairs(["head", "foot"]) == flip_pairs([]) == []


@pytest.mark.parametrize("flip", [0, 1])
def test_left_and_right_are_exchanged_where_it_mirrors_however_far_it_turns(shards, flip):
    plain = KeypointDataset(shards, JOINTS)[0]
    augmentation = EventAugmentation(flip=flip, turn=180, scale=(0.2, 0.2))
    for seed in range(8):
        torch.manual_seed(seed)
        found = KeypointDataset(shards, JOINTS, augmentation=augmentation)[0]["keypoints"]
        torch.manual_seed(seed)
        augmentation.events(plain["volume"])  # it draws before the map
        affine = augmentation.affine(*plain["volume"].shape[1:])
        expected = move_points(plain["keypoints"][..., :2].numpy(), affine)[:, [0, 2, 1] if flip else [0, 1, 2]]
        there = found[..., 2] > 0
        assert there.any()
        np.testing.assert_allclose(found[there][:, :2], expected[there.numpy()], atol=1e-4)


def words_of(path, begin, end):
    """The words in quotation marks between these texts of one of the program's sources."""
    return re.findall('"([^"]+)"', (SOURCE / path).read_text().partition(begin)[2].partition(end)[0])


HUMAN36M = "stages/frames/human36m/human36m_dataset.cc"
# every one that the program names itself: path, text before it, text behind it, its joints on the left, and on the
# right
LISTS = {
    "MPII": ("stages/frames/mpii/mpii_annotations.cc", "schema{", "}};",
             ["l_" + name for name in ("ankle", "knee", "hip", "wrist", "elbow", "shoulder")],
             ["r_" + name for name in ("ankle", "knee", "hip", "wrist", "elbow", "shoulder")]),
    "MPII's short names": ("stages/exports/pose_list.cc", 'kNames[] = {', "};",
                           ["lank", "lkne", "lhip", "lwri", "lelb", "lsho"],
                           ["rank", "rkne", "rhip", "rwri", "relb", "rsho"]),
    "Human3.6M, 17": (HUMAN36M, "count == 17", "};",
                      ["left_" + name for name in ("hip", "knee", "foot", "shoulder", "elbow", "wrist")],
                      ["right_" + name for name in ("hip", "knee", "foot", "shoulder", "elbow", "wrist")]),
    "Human3.6M, 32": (HUMAN36M, "count == 32", "};",
                      ["LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase", "LeftToeBase_Site", "LeftShoulder", "LeftArm",
                       "LeftForeArm", "LeftHand",
                       "LeftHandThumb", "LeftHandThumb_Site", "L_Wrist_End", "L_Wrist_End_Site"],
                      ["RightUpLeg", "RightLeg", "RightFoot", "RightToeBase", "RightToeBase_Site", "RightShoulder",
                       "RightArm", "RightForeArm", "RightHand",
                       "RightHandThumb", "RightHandThumb_Site", "R_Wrist_End", "R_Wrist_End_Site"]),
    "DHP19": ("stages/frames/events/dhp19_dataset.cc", "kJoints = {", "};",
              ["shoulderL", "elbowL", "hipL", "handL", "kneeL", "footL"],
              ["shoulderR", "elbowR", "hipR", "handR", "kneeR", "footR"])}


@pytest.mark.parametrize("name", LISTS)
def test_a_mirror_exchanges_the_sides_of_every_list_that_the_program_writes(name):
    path, begin, end, left, right = LISTS[name]
    names = words_of(path, begin, end)
    names = list(dict.fromkeys(names[1::2])) if name == "MPII's short names" else names
    assert len(names) == {"MPII": 16, "MPII's short names": 16, "Human3.6M, 17": 17,
                          "Human3.6M, 32": 32, "DHP19": 13}[name]
    assert ({(names[i], names[j]) for i, j in flip_pairs(names)} == set(zip(left, right))
            and len(flip_pairs(names)) == len(left))
    for i in range(len(names)):  # and nothing is left where it is if one is missing
        if names[i] in left and name != "MPII's short names":
            with pytest.raises(ValueError, match=f"got {right[left.index(names[i])]} without a counterpart"):
                flip_pairs(names[:i] + names[i + 1:])


@pytest.mark.parametrize(("left", "right"), [
    ("lShoulder", "rShoulder"), ("LShoulder", "RShoulder"), ("LBigToe", "RBigToe"), ("ShoulderLeft", "ShoulderRight"),
    ("LEFT_HIP", "RIGHT_HIP"),
    ("hip_l", "hip_r"), ("Hip_L", "Hip_R"), ("hip.L", "hip.R"), ("hip_left", "hip_right"), ("handL_end", "handR_end"),
    ("hip (l)", "hip (r)"), ("body_l_hip", "body_r_hip"), ("l", "r"), ("toe1L", "toe1R")])
def test_sides_in_names_of_one_s_own(left, right):
    assert flip_pairs([right, "nose", left]) == [(2, 0)]
    for alone in (left, right):
        with pytest.raises(ValueError, match=f"got {re.escape(alone)} without a counterpart"):
            flip_pairs(["nose", alone])


def test_names_that_suggest_no_side():
    middle = ["root (pelvis)", "Spine1", "neck_base", "ROOT", "L5", "Head_Site", "lower back", "rib", "tail", "C7",
              "nostril"]
    assert flip_pairs(middle) == []
    with pytest.raises(ValueError, match="got joint_0, joint_1 without a counterpart"):  # of which nothing is known
        flip_pairs(["joint_0", "joint_1"])
    with pytest.raises(ValueError, match="got 0, 1, 2 without a counterpart"):  # YOLO's, COCO's without names
        flip_pairs(["0", "1", "2"])
    assert flip_pairs(["0"]) == []  # one alone stays itself
    with pytest.raises(ValueError, match="got left_hip, RAnkle, kneeR without a counterpart .flip=0 mirrors nothing."):
        flip_pairs(["left_hip", "RAnkle", "kneeR", "l_knee", "r_knee"])


def test_persons_of_dhp19_s_names_are_mirrored(folder):
    with h5py.File(folder / NAME, "r+") as file:
        file["labels/poses"].attrs["joint_names"] = ["head", "handL", "handR"]
        file["labels/poses"].attrs["joint_aliases"] = ["", "", ""]
    shards = Shards(folder / NAME)
    keypoints = [KeypointDataset(shards, augmentation=EventAugmentation(flip=flip))[0]["keypoints"][1]
                 for flip in (0, 1)]
    np.testing.assert_allclose(keypoints[1][:, 0], 7 - keypoints[0][[0, 2, 1], 0])  # of 8 columns
    persons = [PoseDataset(shards, size=(64, 64), augmentation=PoseAugmentation(scale=0, rotated=0, flip=flip))[1]
               for flip in (0, 1)]
    np.testing.assert_allclose(persons[1][3]["joints"][:, 0], 63 - persons[0][3]["joints"][[0, 2, 1], 0])
    assert PoseDataset(shards).flip_pairs == [(1, 2)]
    lost = PoseAugmentation(scale=0, rotated=0, flip=0, events=EventAugmentation(flip=0, lost=(1, 1)))
    assert persons[0][0].any() and not PoseDataset(shards, size=(64, 64), augmentation=lost)[1][0].any()
    for dataset, augmentation in ((KeypointDataset, EventAugmentation()), (PoseDataset, PoseAugmentation())):
        with pytest.raises(ValueError, match="got handL without a counterpart"):  # at once
            dataset(shards, joints=["head", "handL"], augmentation=augmentation)
        dataset(shards, joints=["head", "handL"], augmentation=dataclasses.replace(augmentation, flip=0))[0]
        dataset(shards, joints=["head", "handL"])[0]


@pytest.mark.parametrize(("moved", "center", "scale"),
                         [(False, [2.75, 2.25 + 15 * 0.875], 1.25 * 0.875), (True, [2.75, 2.25], 0.875)])
def test_mpii_s_centres_are_moved_once(folder, moved, center, scale):
    with h5py.File(folder / NAME, "r+") as file:
        file["pairs/dataset"][...] = "mpii_list"
    meta = PoseDataset(Shards(folder / NAME), size=(64, 64), moved=moved)[1][3]
    np.testing.assert_allclose(meta["center"], center)
    np.testing.assert_allclose(meta["scale"], scale)


def test_joints_by_the_names_in_common_use(shards):
    assert PoseDataset(shards,
                       joints=["right_wrist", "nose"], size=(64, 64))[1][3]["joints_vis"].tolist() == [[1, 1, 0]] * 2
    for dataset in (PoseDataset, KeypointDataset):
        with pytest.raises(ValueError, match="expected joints of nose, left hand, right hand or left_wrist, "
                           "right_wrist, got tail, in .*'dataset'"):
            dataset(shards, joints=["tail"])


def test_pose_items(shards):
    persons = PoseDataset(shards, size=(64, 64), joints=JOINTS)
    assert len(persons) == 3 and persons.joint_names == ["nose", "left hand", "right hand"]
    input, target, weight, meta = persons[1]  # centre 2.75, 2.25 and scale 0.875 as annotated: not MPII's
    assert input.shape == (4, 64, 64) and target.shape == (3, 16, 16) and weight.tolist() == [[1], [1], [1]]
    zoom = 64 / 175
    np.testing.assert_allclose(meta["joints"][0], [32 + (1.5 - 2.75) * zoom, 32 + (1.75 - 2.25) * zoom, 0])
    np.testing.assert_allclose(move_points(meta["joints"][:, :2], meta["to_volume"]),
                               [[1.5, 1.75], [2.25, 2.875], [3.25, 3.25]], atol=1e-9)
    np.testing.assert_allclose(move_points(meta["joints"][:, :2], meta["to_source"]), [[3.5, 4], [5, 6.25], [7, 7]],
                               atol=1e-9)
    assert (meta["image"], meta["index"], meta["person"]) == ("000000", 0, 1)


def test_joints_in_common_use_are_taken_unless_told_otherwise(shards):
    assert (PoseDataset(shards, size=(64, 64)).joint_names == KeypointDataset(shards).joint_names
            == ["left_wrist", "right_wrist"])
    sources = [shards.labels(index)["persons"]["joints_source"][row, 2].tolist() for index, row in shards.persons]
    annotated = [source != [-1, -1] for source in sources]
    assert shards.annotated(["right hand"]).tolist() == annotated and len(set(annotated)) == 2
    assert PoseDataset(shards,
                       joints=["right hand"], size=(64, 64)).persons.tolist() == shards.persons[annotated].tolist()


def test_datasets_without_anything_to_learn_say_so(shards, example, folder):
    with pytest.raises(ValueError, match="expected persons of whom one of left_wrist, right_wrist is annotated, got "
                       f"none, in {folder}"):
        PoseDataset(shards[1:2])
    unlabelled = Shards(example.path("unlabelled"))
    for dataset, what in ((PoseDataset, "joints"), (KeypointDataset, "joints"), (DetectionDataset, "boxes")):
        with pytest.raises(ValueError, match=f"expected samples of sources with {what}, got none, in .*{NAME}"):
            dataset(unlabelled)


def test_boxes_of_classes_that_are_not_asked_for_are_not_to_be_ignored_either(folder):
    with h5py.File(folder / NAME, "r+") as file:
        file["labels/boxes/class_id"].attrs["class_names"] = ["Car", "Van"]  # the one to ignore
    shards = Shards(folder / NAME)
    assert DetectionDataset(shards, ["Car"])[0]["labels"].tolist() == [0]
    assert DetectionDataset(shards, ["Car"], size=(2, 8), visible=0.5)[0]["labels"].tolist() == [0]  # 1/3.5 is left
    assert DetectionDataset(shards, ["Van"])[0]["ignore"].tolist() == [True]
    assert DetectionDataset(shards, ["Van"], size=(2, 8), visible=0.5)[0]["labels"].tolist() == [0]


def test_persons_are_counted_without_reading_each(shards, monkeypatch):
    monkeypatch.setattr(Shards, "sample", None)
    assert len(PoseDataset(shards)) == 3


def test_a_wide_crop_is_filled_by_its_width(shards):
    meta = PoseDataset(shards, size=(32, 64), joints=JOINTS)[1][3]
    np.testing.assert_allclose(meta["joints"][0], [32 + (1.5 - 2.75) * 64 / 175, 16 + (1.75 - 2.25) * 64 / 175, 0])


def test_a_person_without_a_scale_has_that_of_its_joints(shards):
    meta = PoseDataset(shards, size=(64, 64), joints=JOINTS)[0][3]  # joints 1.5, 1.75 and 2.25, 2.875
    np.testing.assert_allclose(meta["center"], [1.875, 2.3125])
    np.testing.assert_allclose(meta["scale"], 1.25 * 1.125 / 200)
    assert meta["joints_vis"].tolist() == [[1, 1, 0], [1, 1, 0], [0, 0, 0]]


def test_a_person_with_a_scale_and_no_centre_has_both_of_its_joints(folder):
    with h5py.File(folder / NAME, "r+") as file:
        for column in ("center", "center_source"):
            file[f"labels/poses/{column}"][1] = -1
    meta = PoseDataset(Shards(folder / NAME), size=(64, 64), joints=JOINTS)[1][3]  # joints 1.5, 1.75 to 3.25, 3.25
    np.testing.assert_allclose(meta["center"], [2.375, 2.5])
    np.testing.assert_allclose(meta["scale"], 1.25 * 1.75 / 200)


def test_varied_poses_still_lead_back(shards):
    torch.manual_seed(3)
    persons = PoseDataset(shards, size=(64, 48), joints=JOINTS, augmentation=PoseAugmentation(rotated=1))
    flips = set()
    for _ in range(12):
        meta = persons[1][3]
        flips.add(meta["flipped"])
        order = [0, 2, 1] if meta["flipped"] else [0, 1, 2]
        np.testing.assert_allclose(move_points(meta["joints"][:, :2], meta["to_source"])[order],
                                   [[3.5, 4], [5, 6.25], [7, 7]], atol=1e-6)
    assert flips == {False, True}


def test_heatmaps():
    maps, weight = heatmaps(np.array([[5.4, 3.6], [-1, 2], [4, 4], [-9, 2]]), np.array([True, True, False, True]), 12,
                            10, 1.0)
    assert weight.tolist() == [[1], [1], [0], [0]]
    assert np.unravel_index(maps[0].argmax(), (12, 10)) == (4, 5) and maps[0].max() == 1
    np.testing.assert_allclose(maps[0, 4, 3:9], np.exp(-np.array([4, 1, 0, 1, 4, 9]) / 2), rtol=1e-6)
    assert maps[0, 4, 9] == 0 and maps[1, 2, 0] == np.float32(np.exp(-0.5)) and not maps[2:].any()
    corners = np.array([[59, 2], [2, 59]])  # of which a map of 64 x 32 has one, and one of 32 x 64 the other
    for height, width, inside in ((32, 64, [[1], [0]]), (64, 32, [[0], [1]])):
        assert heatmaps(corners, np.array([True, True]), height, width, 1.0)[1].tolist() == inside


def test_a_box_around_joints_has_a_margin_of_its_longer_side():
    from eventgan.torch import _around

    # from the left edge of the first joint's pixel to the right one of the last: 21 x 5, and 0.1 x 21 around
    boxes, found = _around(np.array([[[10, 12], [30, 16]]]), np.array([[True, True]]), 0.1)
    np.testing.assert_allclose(boxes, [[10 - 2.1, 12 - 2.1, 31 + 2.1, 17 + 2.1]])
    assert found.all()


@pytest.mark.skipif(not TRAINERS.is_dir(), reason="no ../shared/trainers")
def test_crops_and_heatmaps_are_those_of_simple_baselines(monkeypatch):
    monkeypatch.syspath_prepend(str(TRAINERS / "pose_resnet" / "lib"))
    transforms = pytest.importorskip("utils.transforms")
    from eventgan.torch import _crop
    joints_dataset = pytest.importorskip("dataset.JointsDataset")
    for center, scale, rotation, (width, height) in (((100, 80), 0.7, 0, (256, 256)),
                                                     ((31.5, 47.25), 1.3, -40, (192, 256)),
                                                     ((0, 0), 2.0, 75, (256, 192))):
        expected = transforms.get_affine_transform(np.array(center, float), np.array([scale, scale]), rotation,
                                                   [width, height])
        np.testing.assert_allclose(_crop(np.array(center, float), scale, rotation, height, width), expected, atol=1e-3)
    theirs = joints_dataset.JointsDataset.__new__(joints_dataset.JointsDataset)
    theirs.num_joints, theirs.target_type, theirs.sigma = 4, "gaussian", 2
    theirs.image_size, theirs.heatmap_size = np.array([256, 256]), np.array([64, 64])
    joints = np.array([[100.3, 7, 0], [255, 255, 0], [2, 130, 0], [300, 20, 0]])
    visible = np.array([[1, 1, 0], [1, 1, 0], [0, 0, 0], [1, 1, 0]], float)
    expected, expected_weight = theirs.generate_target(joints, visible)
    maps, weight = heatmaps(joints[:, :2] / 4, visible[:, 0] > 0, 64, 64, 2)
    assert weight.tolist() == expected_weight.tolist()
    np.testing.assert_allclose(maps[visible[:, 0] > 0], expected[visible[:, 0] > 0], rtol=1e-6)


def test_half_volumes_are_rounded_and_stay_finite(shards):
    cars = DetectionDataset(shards)
    whole, half = cars[0], HalfVolumes(cars)[0]
    assert half["volume"].dtype == torch.float16 and len(HalfVolumes(cars)) == len(cars)
    assert torch.equal(half["volume"], whole["volume"].half())
    assert whole.keys() == half.keys() and torch.equal(half["boxes"], whole["boxes"])
    values = torch.tensor([0, 1e-9, 1 + 2**-11, 2049, 65504, 1e9, -1e9])    # ties to even, the smallest half is 6e-8
    volume, target = HalfVolumes(torch.utils.data.TensorDataset(values[None], torch.ones(1)))[0]
    assert volume.tolist() == [0, 0, 1, 2048, 65504, 65504, -65504] and target == 1
    imgs, targets, _ = next(iter(DataLoader(HalfVolumes(cars), 2, collate_fn=collate_yolo, num_workers=1)))
    assert imgs.dtype == torch.float16 and targets.dtype == torch.float32


def test_datasets_are_mixed_by_share():
    few, many = torch.utils.data.TensorDataset(torch.zeros(5)), torch.utils.data.TensorDataset(torch.ones(500))
    joined, sampler = mixture([few, many], [0.8, 0.2], length=2000, generator=torch.Generator().manual_seed(1))
    drawn = np.array([float(joined[i][0]) for i in sampler])
    assert len(drawn) == 2000 and 0.16 < drawn.mean() < 0.24
    with pytest.raises(ValueError, match="expected a share"):
        mixture([few, many], [1])


def test_the_first_convolution_is_exchanged():
    model = torch.nn.Sequential(torch.nn.Sequential(torch.nn.Conv2d(3, 8, 7, 2, 3, bias=False), torch.nn.ReLU()),
                                torch.nn.Conv2d(8, 4, 1))
    kept = model[1].weight.clone()
    assert exchange_first_convolution(model, 18) is model
    assert model(torch.zeros(1, 18, 16, 16)).shape == (1, 4, 8, 8)
    assert model[0][0].bias is None and torch.equal(model[1].weight, kept)
    assert exchange_first_convolution(torch.nn.Conv2d(3, 4, 3), 18).weight.shape == (4, 18, 3, 3)
    with pytest.raises(ValueError, match="expected a model with a Conv2d"):
        exchange_first_convolution(torch.nn.ReLU(), 18)
    with pytest.raises(ValueError, match="one group"):
        exchange_first_convolution(torch.nn.Conv2d(4, 4, 3, groups=4), 18)


@pytest.mark.parametrize("start", ["fork", "spawn"])
def test_loaders_with_workers(shards, start):
    loader = DataLoader(DetectionDataset(shards), batch_size=2, num_workers=2, multiprocessing_context=start,
                        collate_fn=collate_yolo)
    assert [ids for _, _, ids in loader] == [["000000", "000001"], ["000003", "000004"]]
    poses = DataLoader(PoseDataset(shards, size=(32, 32), joints=JOINTS), batch_size=3, num_workers=1,
                       multiprocessing_context=start)
    input, target, weight, meta = next(iter(poses))
    assert (input.shape == (3, 4, 32, 32) and target.shape == (3, 3, 8, 8)
            and meta["image"] == ["000000", "000000", "000004"])
    assert meta["to_source"].shape == (3, 2, 3)
