#!/usr/bin/python3
"""Trains Microsoft's pose_resnet (Simple Baselines) on the persons of event-volume shards: its network, its loss.

    train_pose.py --trainer human-pose-estimation.pytorch --data out --out poses --minutes 30
"""

from __future__ import annotations

import argparse
import functools

import numpy as np
import torch
import training
from eventgan import Shards, drawing
from eventgan.pose_scores import pose_scores, read_persons
from eventgan.torch import PoseAugmentation, PoseDataset, exchange_first_convolution


def read_args() -> argparse.Namespace:
    parser = training.options(__doc__.splitlines()[0], batch=16, lr=1e-3)
    parser.add_argument("--trainer", required=True, help="folder of microsoft/human-pose-estimation.pytorch")
    parser.add_argument("--size", type=int, default=128, help="height and width of the input, a multiple of 32")
    parser.add_argument("--layers", type=int, default=18, help="layers of the ResNet: 18, 34, 50, 101 or 152")
    parser.add_argument("--filters", type=int, default=128, help="filters of each of the three deconvolutions")
    parser.add_argument("--rotation", type=float, default=15.0,
                        help="standard deviation of the crops' angles in degrees; Simple Baselines uses 30")
    parser.add_argument("--sigma", type=float, default=1.5,
                        help="standard deviation of the heatmap peaks, in heatmap pixels")
    training.add_tune(parser)
    return training.begin(parser)


def with_persons(shards: Shards) -> np.ndarray:
    return np.unique(shards.persons[:, 0])


def deconvolution(layer: torch.nn.ConvTranspose2d, x: torch.Tensor) -> torch.Tensor:
    """What the layer (kernel 4, stride 2, padding 1) makes of x [n, C, H, W], as a convolution to 4 C' channels that
    are then laid out in squares: its output at 2i is of inputs i - 1 and i with kernel rows 3 and 1, that at 2i + 1 of
    i and i + 1 with rows 2 and 0."""
    taps = torch.tensor([[3, 1, 4], [4, 2, 0]])  # 4: the zeros beyond the kernel
    # in, out, y of the square, y, x of the square, x
    kernel = torch.nn.functional.pad(layer.weight, (0, 1, 0, 1))[:, :, taps][..., taps]
    kernel = kernel.permute(1, 2, 4, 0, 3, 5).flatten(0, 2)
    return torch.nn.functional.pixel_shuffle(torch.nn.functional.conv2d(x, kernel, padding=1), 2)


def main() -> None:
    args = read_args()
    training.use_trainer(args.trainer, "lib/models", "lib/core")
    from core.config import config
    from core.inference import get_final_preds
    from core.loss import JointsMSELoss
    from models.pose_resnet import get_pose_net

    train_shards, validation_shards = training.divided(args, with_persons)
    size = (args.size, args.size)
    searched = training.tested(args, train_shards, validation_shards, with_persons)
    tune_shards = training.tuned_on(args, with_persons, searched) if args.tune else None
    try:
        augmentation = PoseAugmentation(rotation=args.rotation)
        train_set = PoseDataset(train_shards, size, sigma=args.sigma, augmentation=augmentation)
        validation_set = PoseDataset(validation_shards, size, train_set.joint_names, sigma=args.sigma)
        test = PoseDataset(searched, size, train_set.joint_names, sigma=args.sigma)
        tuned = PoseDataset(tune_shards, size, train_set.joint_names, sigma=args.sigma,
                            augmentation=augmentation) if tune_shards else None
        persons = read_persons(validation_shards)
    except ValueError as error:
        raise SystemExit(str(error))
    persons = persons.rows(validation_shards.annotated(train_set.joint_names))
    # PCKh by the heads' boxes, as MPII has it, or else by their joints, as the EventGAN paper has it
    by_head = {"pckh_mpii": np.isfinite(persons.head_box), "pckh": np.isfinite(persons.head)}
    pckh = next((key for key, known in by_head.items() if known.any()), None)
    if pckh:
        persons = persons.rows(by_head[pckh])
    validation_set.persons = persons.place
    if not len(validation_set) or persons.names != train_set.joint_names:
        raise SystemExit(f"expected validation persons with the {len(train_set.joint_names)} trained joints, got "
                         f"{len(validation_set)} with {len(persons.names)} joints, in "
                         f"{args.data}{f' (--dataset {args.dataset})' if args.dataset else ''}")
    wanted = searched.default_joints()  # eventgan.evaluate reads predictions.json in this order
    if set(wanted) != set(train_set.joint_names):
        raise SystemExit(f"expected the trained joints {', '.join(train_set.joint_names)}, got {', '.join(wanted)}, in "
                         f"{args.test or args.data}")
    print(f"{len(train_set)} persons for training, {len(validation_set)} for validation")

    config.MODEL.NUM_JOINTS, config.MODEL.IMAGE_SIZE, config.MODEL.EXTRA.NUM_LAYERS = (len(train_set.joint_names),
                                                                                       list(size), args.layers)
    config.MODEL.EXTRA.NUM_DECONV_FILTERS = [args.filters] * 3
    model = get_pose_net(config, is_train=False)
    model = exchange_first_convolution(model, len(validation_set[0][0]))
    training.load_fitting(model, args.pretrained)
    model = model.to(args.device).to(memory_format=torch.channels_last)
    for layer in model.deconv_layers if args.device == "cpu" else ():
        # PyTorch 1.13 leaves it to the system's BLAS there, several times slower
        if isinstance(layer, torch.nn.ConvTranspose2d):
            layer.forward = functools.partial(deconvolution, layer)
    criterion = JointsMSELoss(use_target_weight=True)

    def loss_of(batch: tuple, _: float) -> torch.Tensor:
        events, target, weight, _ = batch
        if args.last_layer:
            model.eval()  # nor do the other layers' means and variances change
        return 1000 * criterion(model(events.to(args.device)), target.to(args.device), weight.to(args.device))

    def find(events: torch.Tensor, meta: dict) -> np.ndarray:
        """[n, J, 2]: joints in volume pixels."""
        maps = model(events.to(args.device)).cpu().numpy()
        return get_final_preds(config, maps, np.asarray(meta["center"]), np.asarray(meta["scale"]))[0]

    def search(dataset: PoseDataset) -> np.ndarray:
        """[persons, J, 2]: joints in volume pixels."""
        return np.concatenate([find(events, meta) for events, _, _, meta in training.batches(args, dataset)])

    def measure() -> dict[str, float]:
        scores = pose_scores(search(validation_set), persons, hidden=True)["all"]
        return ({"PCKh@0.5": scores[pckh]} if pckh else {}) | {"MPJPE": scores["mpjpe_source"]}

    if args.last_layer:
        model.requires_grad_(False).final_layer.requires_grad_(True)

    def learn(args: argparse.Namespace, tuned: PoseDataset | None = None) -> None:
        optimizer = torch.optim.Adam([weight for weight in model.parameters() if weight.requires_grad], lr=args.lr)
        training.fit(args, model, optimizer, training.batches(args, train_set, shuffle=True, tuned=tuned), loss_of,
                     measure, "PCKh@0.5" if pckh else "MPJPE")

    learn(training.untuned(args))
    if tuned:
        args = training.tuning(args, len(tuned))
        learn(args, tuned)

    def image_of(i: int) -> tuple[str, np.ndarray]:
        events, _, _, meta = validation_set[i]
        canvas = drawing.of_events(validation_shards[int(meta["index"])]["volume"])
        found = find(events[None], {name: meta[name][None] for name in ("center", "scale")})[0]
        drawing.draw_joints(canvas, persons.joints[i][persons.annotated[i]], drawing.TRUE)
        drawing.draw_joints(canvas, found, drawing.FOUND,
                            np.where(persons.annotated[i][:, None], persons.joints[i], np.nan))
        return f"{meta['image']}_{meta['person']}", canvas

    names = searched.column("sample_id")[test.persons[:, 0]]
    with torch.no_grad():
        found = search(test)[:, [train_set.joint_names.index(name) for name in wanted]].tolist()
    entries = ({"image_id": name, "person": person, "joints": joints}
               for name, person, joints in zip(names, test.persons[:, 1].tolist(), found))
    training.write_predictions(args, searched, entries, "poses")
    training.write_images(args, len(validation_set), image_of)


if __name__ == "__main__":
    main()
