#!/usr/bin/python3
"""Trains Microsoft's pose_resnet (Simple Baselines) on the persons of event-volume shards: its network, its loss, its PCKh.

    train_pose.py --trainer ../shared/trainers/pose_resnet --data out --out poses --minutes 30
"""

from __future__ import annotations

import argparse
import functools
import pathlib

import cv2
import numpy as np
import torch
import training
from eventgan_shards import Shards
from eventgan_shards.torch import PoseAugmentation, PoseDataset, exchange_first_convolution, move_points


def read_args() -> argparse.Namespace:
    parser = training.options(__doc__.splitlines()[0], batch=16, lr=1e-3, dataset="mpii")
    parser.add_argument("--trainer", required=True, help="folder of microsoft/human-pose-estimation.pytorch")
    parser.add_argument("--size", type=int, default=128, help="height and width of the input, a multiple of 32")
    parser.add_argument("--layers", type=int, default=18, help="of the ResNet: 18, 34, 50, 101, 152")
    parser.add_argument("--filters", type=int, default=128, help="of each of the three deconvolutions")
    parser.add_argument("--rotation", type=float, default=15.0, help="deviation of the crops' angles in degrees; Simple Baselines': 30")
    parser.add_argument("--sigma", type=float, default=1.5, help="of the heatmaps, in their pixels")
    return training.begin(parser)


def with_persons(shards: Shards) -> np.ndarray:
    return np.unique(shards.persons[:, 0])


def head_sizes(shards: Shards, persons: np.ndarray) -> np.ndarray:
    """[n, 2, 2]: the head boxes of persons [n, 2] (sample, row) in volume pixels, as two corners; NaN where there is none."""
    boxes = np.array([shards.labels(index)["persons"]["head_box"][row] for index, row in persons]).reshape(-1, 2, 2)
    boxes[(boxes == -1).all((1, 2))] = np.nan
    return boxes


def short_name(joint: str) -> str:
    """MPII's name as PCKh's ground truth has it: r_ankle → rank, head_top → head."""
    return joint[0] + joint[2:5] if joint[1] == "_" else {"head_top": "head", "upper_neck": "neck"}.get(joint, joint[:4])


def write_truth(folder: pathlib.Path, data: PoseDataset, metas: list[dict], heads: np.ndarray) -> None:
    """annot/gt_valid.mat as the trainer's evaluate reads it, 1-based, in volume pixels: joints [J, 2, n], missing [J, n], heads [2, 2, n]."""
    from scipy.io import savemat
    joints = np.stack([move_points(meta["joints"][:, :2], meta["to_volume"]) for meta in metas])
    missing = np.stack([meta["joints_vis"][:, 0] == 0 for meta in metas])
    folder.mkdir(exist_ok=True)
    savemat(folder / "gt_valid.mat", {"dataset_joints": np.array([[short_name(name) for name in data.joint_names]], object),
                                      "jnt_missing": missing.T.astype(float), "pos_gt_src": joints.transpose(1, 2, 0) + 1,
                                      "headboxes_src": heads.transpose(1, 2, 0) + 1})


def deconvolution(layer: torch.nn.ConvTranspose2d, x: torch.Tensor) -> torch.Tensor:
    """What the layer (kernel 4, stride 2, padding 1) makes of x [n, C, H, W], as a convolution to 4 C' channels that are then laid out in
    squares: its output at 2i is of inputs i - 1 and i with kernel rows 3 and 1, that at 2i + 1 of i and i + 1 with rows 2 and 0."""
    taps = torch.tensor([[3, 1, 4], [4, 2, 0]])  # 4: the zeros beyond the kernel
    kernel = torch.nn.functional.pad(layer.weight, (0, 1, 0, 1))[:, :, taps][..., taps]  # in, out, y of the square, y, x of the square, x
    kernel = kernel.permute(1, 2, 4, 0, 3, 5).flatten(0, 2)
    return torch.nn.functional.pixel_shuffle(torch.nn.functional.conv2d(x, kernel, padding=1), 2)


def main() -> None:
    args = read_args()
    training.use_trainer(args.trainer, "lib/models", "lib/core", "lib/dataset/mpii.py")
    from core.config import config
    from core.inference import get_final_preds
    from core.loss import JointsMSELoss
    from dataset.mpii import MPIIDataset
    from models.pose_resnet import get_pose_net

    learnt, checked = training.divided(args, with_persons)
    size = (args.size, args.size)
    learn = PoseDataset(learnt, size, sigma=args.sigma, augmentation=PoseAugmentation(rotation=args.rotation))
    check = PoseDataset(checked, size, learn.joint_names, sigma=args.sigma)
    heads = head_sizes(checked, check.persons)  # PCKh is measured by them
    known = np.isfinite(heads).all((1, 2))
    check.persons, heads = check.persons[known], heads[known]
    if len(learn.joint_names) != 16 or not len(check):
        raise SystemExit(f"expected persons with MPII's 16 joints and head boxes to check, got {len(check)} with {len(learn.joint_names)} joints, in "
                         f"{args.data} (--dataset {args.dataset})")
    print(f"{len(learn)} persons to learn, {len(check)} to check")
    metas = [check[i][3] for i in range(len(check))]
    write_truth(pathlib.Path(args.out, "annot"), check, metas, heads)

    config.MODEL.NUM_JOINTS, config.MODEL.IMAGE_SIZE, config.MODEL.EXTRA.NUM_LAYERS = len(learn.joint_names), list(size), args.layers
    config.MODEL.EXTRA.NUM_DECONV_FILTERS = [args.filters] * 3
    config.DATASET.ROOT, config.DATASET.TEST_SET = args.out, "valid"
    model = get_pose_net(config, is_train=False)
    training.load_fitting(model, args.pretrained)
    model = exchange_first_convolution(model, 18).to(args.device).to(memory_format=torch.channels_last)
    for layer in model.deconv_layers if args.device == "cpu" else ():
        if isinstance(layer, torch.nn.ConvTranspose2d):  # PyTorch 1.13 leaves it to the system's BLAS there, several times slower
            layer.forward = functools.partial(deconvolution, layer)
    criterion = JointsMSELoss(use_target_weight=True)

    def loss_of(batch: tuple, _: float) -> torch.Tensor:
        events, target, weight, _ = batch
        return 1000 * criterion(model(events.to(args.device)), target.to(args.device), weight.to(args.device))

    def find(events: torch.Tensor, meta: dict) -> np.ndarray:
        """[n, J, 2]: joints in volume pixels."""
        maps = model(events.to(args.device)).cpu().numpy()
        return get_final_preds(config, maps, np.asarray(meta["center"]), np.asarray(meta["scale"]))[0]

    def measure() -> dict[str, float]:
        found = np.concatenate([find(events, meta) for events, _, _, meta in training.batches(args, check)])
        values, _ = MPIIDataset.evaluate(None, config, found, "")  # its method that reads gt_valid.mat needs nothing of a dataset
        return {name: float(value) / 100 for name, value in values.items()}

    optimizer = torch.optim.Adam(model.parameters(), lr=args.lr)
    training.fit(args, model, optimizer, training.batches(args, learn, learn=True), loss_of, measure, "Mean")

    def picture_of(i: int) -> tuple[str, np.ndarray]:
        events, _, _, meta = check[i]
        volume = checked[int(meta["index"])]["volume"]
        picture = training.events_picture(torch.from_numpy(volume))
        found = find(events[None], {name: meta[name][None] for name in ("center", "scale")})[0]
        truth = move_points(meta["joints"][:, :2], meta["to_volume"])
        for there, here, annotated in zip(found, truth, meta["joints_vis"][:, 0]):
            there, here = (tuple(int(x) for x in np.round(2 * point + 0.5)) for point in (there, here))
            if annotated:
                cv2.line(picture, there, here, training.GREY, 1, cv2.LINE_AA)
                cv2.circle(picture, here, 3, training.GREEN, -1, cv2.LINE_AA)
            cv2.circle(picture, there, 2, training.YELLOW, -1, cv2.LINE_AA)
        return f"{meta['image']}_{meta['person']}", picture

    training.write_pictures(args, len(check), picture_of)


if __name__ == "__main__":
    main()
