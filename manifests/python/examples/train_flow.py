#!/usr/bin/python3
"""Trains a small network of optical flow on shards that have it: photographs teach it, no recording is needed.

    train_flow.py --data out --test recordings --out flows

It finds how each pixel has moved from the previous image to the next in an event volume: a least-squares fit gives a
first answer, and the flow network of the EventGAN paper, of a quarter of its width and with group normalization,
corrects it. Shards with flow are of photographs, with `"flow": true` in their source; `"kind": "esim"` makes events
that follow this motion.
"""

from __future__ import annotations

import collections
import json
import math
import pathlib
from collections.abc import Callable, Sequence
from typing import Any

import cv2
import h5py
import numpy as np
import torch
import training
from eventgan import Sample, Shards, drawing
from eventgan.flow_scores import flow_scores
from eventgan.torch import EventAugmentation, FlowDataset
from torch import nn
from torch.nn import functional
from torch.utils.data import Dataset

LEVELS, RESIDUAL_BLOCKS, WIDTH = 4, 2, 8
STEPS = 1500  # unless the options say
SIDE = 96  # of the crops, pixels
WINDOWS = (4, 8, 32)  # pixels, of planes in the time of events
STEP_WINDOW = 16  # of the step by gradients
# Added to the mean squares, of gradients as a share of the volume's: this favours no motion.
RESTING, STEP_RESTING = 0.01, 0.03
FARTHEST = 16.0  # most pixels of flow by least squares
CHECKED = 64  # validation samples that are looked at while it learns
# Polarities are exchanged, but not time: flow is at the pixels of one image, backwards of the other.
AUGMENTATION = EventAugmentation(flip=0, invert=0.5, threshold=(0.0, 0.5), lost=(0.0, 0.4), isolated=(0.0, 0.02))


Norm = Callable[[int], nn.Module]  # of so many channels


def batch_norm(channels: int) -> nn.Module:
    return nn.BatchNorm2d(channels, momentum=0.01)


class GroupNorm(nn.GroupNorm):
    """Computed in float32: PyTorch 1.13 on a processor takes no input in bfloat16 beside weights in float32."""

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return super().forward(x.float()).to(x.dtype)


def group_norm(channels: int) -> nn.Module:
    """Groups of 8 channels, each sample alone: the same in training and in evaluation."""
    return GroupNorm(channels // 8, channels)


def layer(inputs: int, outputs: int, kernel: int = 3, stride: int = 1, norm: Norm | None = None,
          activation: nn.Module | None = None) -> nn.Sequential:
    parts: dict[str, nn.Module] = {"conv2d": nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, bias=not norm)}
    if norm:
        parts["norm_layer"] = norm(outputs)
    return nn.Sequential(collections.OrderedDict(parts, activation=activation or nn.LeakyReLU(0.01)))


class ResidualBlock(nn.Module):
    def __init__(self, channels: int, norm: Norm) -> None:
        super().__init__()
        self.conv1, self.conv2 = (nn.Conv2d(channels, channels, 3, padding=1, bias=False) for _ in range(2))
        self.bn1, self.bn2 = norm(channels), norm(channels)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return torch.relu(x + self.bn2(self.conv2(torch.relu(self.bn1(self.conv1(x))))))


class UNet(nn.Module):
    """The flow network (18 channels to 2) or the reconstruction network (2 to 1) of the EventGAN paper.

    Parameters
    ----------
    inputs, outputs : int
        Channels.
    width : int
        Channels of the first layer; each of the four levels below has twice as many as the one above it.
    norm : callable
        The layer that normalizes so many channels.
    """

    def __init__(self, inputs: int, outputs: int, width: int = WIDTH, norm: Norm = batch_norm) -> None:
        super().__init__()
        widths = [width << level for level in range(LEVELS + 1)]
        self.head = layer(inputs, width)
        self.encoders = nn.ModuleList(layer(above, below, stride=2, norm=norm)
                                      for above, below in zip(widths, widths[1:]))
        self.resblocks = nn.Sequential(*(ResidualBlock(widths[-1], norm) for _ in range(RESIDUAL_BLOCKS)))
        # Each but the lowest takes the prediction of the level below, too.
        self.decoders = nn.ModuleList(layer(3 * each + (outputs if i else 0), each, norm=norm)
                                      for i, each in enumerate(widths[-2::-1]))
        self.pred_layers = nn.ModuleList(layer(each, outputs, 1, activation=nn.Tanh())
                                         for each in widths[-2::-1])
        for parameter in self.parameters():
            if parameter.dim() == 4:
                nn.init.kaiming_normal_(parameter, a=10)  # as published

    def forward(self, x: torch.Tensor) -> list[torch.Tensor]:
        """float32 [B, inputs, H, W] -> four predictions in -1..1, [B, outputs, h, w], coarse to fine,
        the last one of H x W."""
        x, skips, predictions = self.head(x), [], []
        for encoder in self.encoders:
            skips.append(x)
            x = encoder(x)
        x = self.resblocks(x)
        for decoder, predict, skip in zip(self.decoders, self.pred_layers, reversed(skips)):
            x = functional.interpolate(torch.cat([x, *predictions[-1:]], 1), skip.shape[2:])
            x = decoder(torch.cat([x, skip], 1))
            predictions.append(predict(x))
        return predictions


def begin_at_rest(network: UNet) -> UNet:
    """Its flows are zero at first."""
    for prediction in network.pred_layers:
        nn.init.zeros_(prediction.conv2d.weight)
        nn.init.zeros_(prediction.conv2d.bias)
    return network


def blurred(images: torch.Tensor, times: int = 1) -> torch.Tensor:
    """[B, C, H, W] by 1, 2, 1 along x and y, so many times."""
    for _ in range(times):
        images = functional.pad(images, (1, 1, 1, 1), mode="replicate")
        images = (images[..., :-2] + 2 * images[..., 1:-1] + images[..., 2:]) / 4
        images = (images[..., :-2, :] + 2 * images[..., 1:-1, :] + images[..., 2:, :]) / 4
    return images


def moved(images: torch.Tensor, flow: torch.Tensor) -> torch.Tensor:
    """Images [B, C, H, W], each pixel looked up where it and flow [B, 2, H, W], in pixels, lead; beyond the edge their
    outermost pixels."""
    height, width = flow.shape[2:]
    y, x = torch.meshgrid(torch.arange(height, device=flow.device), torch.arange(width, device=flow.device),
                          indexing="ij")
    places = (torch.stack([x, y], 2) + flow.permute(0, 2, 3, 1)) / torch.tensor([width - 1, height - 1],
                                                                              device=flow.device)
    return functional.grid_sample(images, 2 * places - 1, padding_mode="border", align_corners=True)


def least_squares(moments: torch.Tensor, side: int, resting: float | torch.Tensor) -> torch.Tensor:
    """The flow [B, 2, H, W], pixels, that minimizes the mean of (g . flow - a)^2, plus resting |flow|^2, over the
    windows of `side` pixels around. moments [B, 5, H, W]: g_x^2, g_x g_y, g_y^2, g_x a, g_y a."""
    height, width = moments.shape[2:]
    parts = functional.avg_pool2d(functional.pad(moments, (0, -width % side, 0, -height % side)), side)
    xx, xy, yy, x, y = blurred(parts).unbind(1)
    xx, yy = xx + resting, yy + resting
    flow = torch.stack([yy * x - xy * y, xx * y - xy * x], 1) / (xx * yy - xy * xy)[:, None]
    return functional.interpolate(flow.clamp(-FARTHEST, FARTHEST), scale_factor=side,
                                  mode="bilinear")[..., :height, :width]


def gradients(images: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Of images [B, C, H, W] along x, and along y."""
    images = functional.pad(images, (1, 1, 1, 1), mode="replicate")
    return ((images[..., 1:-1, 2:] - images[..., 1:-1, :-2]) / 2, (images[..., 2:, 1:-1] - images[..., :-2, 1:-1]) / 2)


def planes(volume: torch.Tensor) -> tuple[torch.Tensor, list[torch.Tensor]]:
    """How edges move, by the time of their events, which rises along their way (Benosman et al. 2014, "Event-based
    visual flow"; here times are means of both polarities' own).

    Parameters
    ----------
    volume : torch.Tensor
        [B, 2b, H, W], divided by its 98th percentile.

    Returns
    -------
    slopes : torch.Tensor
        float32 [B, 4, H, W]: of the positive and the negative events' mean time, from -1 to 1, along x, then along y,
        weighted by how many events there are.
    flows : list of torch.Tensor
        float32 [B, 2, H, W], pixels, for each of WINDOWS: the motion of which the slopes around a pixel are, by
        least_squares.
    """
    bins = volume.shape[1] // 2
    time = torch.linspace(-1, 1, bins, device=volume.device)[:, None, None]
    events = volume.float().unflatten(1, (2, bins))
    count, times = blurred(torch.cat([events.sum(2), (events * time).sum(2)], 1), 3).chunk(2, 1)
    x, y = gradients(times / (count + 0.02))
    weight = count / (count + 0.1)
    moments = torch.stack([weight * each for each in (x * x, x * y, y * y, 2 * x, 2 * y)], 1).sum(2)
    return torch.cat([weight * x, weight * y], 1), [least_squares(moments, side, RESTING) for side in WINDOWS]


def step_by_gradients(volume: torch.Tensor, flow: torch.Tensor, position: float) -> torch.Tensor:
    """A better flow [B, 2, H, W], pixels: the gradients of the bins, blurred and moved by it to the first time
    (position 0) or the last (1), at whose pixels it is, say what it lacks (Lucas and Kanade 1981, "An iterative image
    registration technique")."""
    bins = volume.shape[1] // 2
    if bins < 3:
        return flow
    events = blurred(volume.float(), 3).unflatten(1, (2, bins))
    events = torch.stack([moved(each, (i / (bins - 1) - position) * flow)
                          for i, each in enumerate(events.unbind(2))], 2)
    x, y = (each.unflatten(1, (2, bins))[:, :, 1:-1] for each in gradients(events.flatten(1, 2)))
    time = (events[:, :, 2:] - events[:, :, :-2]) * (bins - 1) / 2
    moments = torch.stack([each.sum((1, 2)) for each in (x * x, x * y, y * y, -x * time, -y * time)], 1)
    resting = STEP_RESTING * (moments[:, 0] + moments[:, 2]).mean((1, 2), keepdim=True) + 1e-9  # not 0 without events
    return (flow + least_squares(moments, STEP_WINDOW, resting)).clamp(-FARTHEST, FARTHEST)


class FlowNetwork(nn.Module):
    """The U-Net, which finds what is to be added to the flow by least squares: of the largest planes, and a step by
    gradients. It sees slopes and flows of all planes, and this one, beside the volume. At first it adds nothing. Flow
    is at the pixels of the next image (position 1) or of the previous one (0)."""

    def __init__(self, channels: int, position: float = 1) -> None:
        super().__init__()
        self.position = position
        self.unet = begin_at_rest(UNet(channels + 4 + 2 * (len(WINDOWS) + 1), 2, norm=group_norm))
        for prediction in self.unet.pred_layers:
            prediction.activation = nn.Identity()

    def forward(self, volume: torch.Tensor) -> list[torch.Tensor]:
        """Float [B, 2b, H, W] -> four flows in pixels, float32 [B, 2, h, w], coarse to fine, the last one of H x W."""
        with torch.autocast(volume.device.type, enabled=False):
            slopes, flows = planes(volume)
            flows.append(step_by_gradients(volume, flows[-1], self.position))
        added = self.unet(torch.cat([volume, slopes, *(flow / 4 for flow in flows)], 1))
        return [functional.adaptive_avg_pool2d(flows[-1], each.shape[2:]) + each.float() for each in added]


def error_at_events(image: torch.Tensor, following: torch.Tensor, volume: torch.Tensor) -> float:
    """Mean difference of two frames [B, 1, H, W] at pixels of the volume [B, 2B, H, W] with events."""
    return float((image - following)[volume.sum(1, keepdim=True) > 0].abs().mean())


def normalized(volume: np.ndarray) -> np.ndarray:
    """Divided by its 98th percentile (of what is not 0) and clipped: "normalize": "eta98".

    Counts depend on the threshold and on the interval. This takes their unit away, each volume on its own, so nothing
    of a camera needs to be known. Where events are, how many at each pixel relative to others, and when, stays."""
    values = volume[volume > 0]
    return np.minimum(volume / np.percentile(values, 98), 1) if len(values) else volume


def in_colour(flow: np.ndarray, longest: float) -> np.ndarray:
    """[2, H, W] -> uint8 [H, W, 3], red, green, blue: hue is the direction,
    saturation the length as a share of `longest`, so no flow is white."""
    x, y = flow
    hue = np.degrees(np.arctan2(y, x)) % 360 / 2
    saturation = 255 * np.minimum(np.hypot(x, y) / longest, 1)
    return cv2.cvtColor(np.stack([hue, saturation, np.full_like(hue, 255)], 2).astype(np.uint8), cv2.COLOR_HSV2RGB)


class Crops(Dataset):
    """Items of FlowDataset, kept in memory: of each a random square, mirrored, turned and as another sensor sees it.
    Volume [2B, S, S], flow [2, S, S], and 1 where it is valid [1, S, S]."""

    def __init__(self, items: Sequence[dict[str, Any]]) -> None:
        self._items = items
        self._side = min(SIDE, *(side for item in items for side in item["valid"].shape))

    def __len__(self) -> int:
        return len(self._items)

    def __getitem__(self, index: int) -> tuple[torch.Tensor, ...]:
        item = self._items[index]
        y, x = (int(torch.randint(side - self._side + 1, ())) for side in item["valid"].shape)
        view = (..., slice(y, y + self._side), slice(x, x + self._side))
        volume, flow, valid = (item[name][view].float() for name in ("volume", "flow", "valid"))
        valid, sign = valid[None], torch.ones(2, 1, 1)
        mirror_x, mirror_y, transpose = (torch.rand(3) < 0.5).tolist()
        for channel, mirror in enumerate((mirror_x, mirror_y)):
            if mirror:
                volume, flow, valid = (each.flip(2 - channel) for each in (volume, flow, valid))
                sign[channel] = -1
        flow = sign * flow
        if transpose:
            volume, flow, valid = (each.transpose(1, 2) for each in (volume, flow.flip(0), valid))
        return AUGMENTATION.events(AUGMENTATION.sensor(volume.contiguous())), flow.contiguous(), valid.contiguous()


def flow_loss(predictions: Sequence[torch.Tensor], flow: torch.Tensor, valid: torch.Tensor) -> torch.Tensor:
    """Mean length of the flow's error, in pixels, where it is valid: the sum over the scales of the predictions,
    coarse to fine, each with half the weight of the next finer one."""
    loss = torch.zeros((), device=flow.device)
    for scale, predicted in enumerate(predictions, 1 - len(predictions)):
        weight = functional.adaptive_avg_pool2d(valid, predicted.shape[2:])
        true = functional.adaptive_avg_pool2d(flow * valid, predicted.shape[2:]) / weight.clamp_min(1e-6)
        error = ((predicted.float() - true).square().sum(1, keepdim=True) + 1e-4).sqrt()
        loss = loss + 2.0**scale * (error * weight).sum() / weight.sum().clamp_min(1)
    return loss


@torch.no_grad()
def predict(network: nn.Module, volume: torch.Tensor) -> torch.Tensor:
    """float32 [2, H, W], pixels, of a volume [2B, H, W]; the network must be in its evaluation mode."""
    return network(volume[None].float().to(next(network.parameters()).device))[-1][0].cpu()


def has_flow(sample: Sample) -> bool:
    return "flow" in sample and bool(sample["flow_valid"].any())


def with_flow(shards: Shards) -> list[int]:
    return [i for i in range(len(shards)) if has_flow(shards.sample(i, {"flow"}))]


def with_events(shards: Shards) -> Sequence[int]:
    return range(len(shards))


def in_units(sample: Sample) -> np.ndarray:
    return normalized(sample["volume"])


def in_voxels(sample: Sample) -> np.ndarray:
    """What a voxel grid tells: of each bin which polarity has more events, and by how much, [2B, H, W]."""
    positive, negative = np.split(in_units(sample), 2)
    return np.maximum(np.concatenate([positive - negative, negative - positive]), 0)


def frames_of(sample: Sample) -> list[torch.Tensor]:
    """The previous and the next frame of a sample of a recording (MVSEC's layout, or images), as they lie in the
    volume, [1, 1, H, W], 0 to 255; none of other samples."""
    def read(path: str, index: int) -> np.ndarray | None:
        if index < 0 or not h5py.is_hdf5(path):
            return cv2.imread(path, cv2.IMREAD_GRAYSCALE)
        with h5py.File(path) as file:
            return file["davis/left/image_raw"][index] if "davis/left/image_raw" in file else None

    if sample["pair"]["dataset"] != "recording" or "flow" in sample:  # whose windows may begin between frames
        return []
    images = [read(training.frame_path(sample, side), sample["pair"][f"{side}_video_frame"])
              for side in ("prev", "next")]
    if any(image is None for image in images):
        return []
    return [torch.from_numpy(training.placed(sample, image))[None, None] for image in images]


def errors_of_frames(flow: torch.Tensor, position: float, previous: torch.Tensor, following: torch.Tensor,
                     volume: torch.Tensor) -> tuple[float, float]:
    """By how much two frames [1, 1, H, W] differ at pixels of the volume [1, 2B, H, W] with events: once the flow
    [2, H, W], at the next frame's pixels (position 1) or at the previous one's (0), has moved the other, and before."""
    other, here, where = (previous, following, -flow) if position == 1 else (following, previous, flow)
    return error_at_events(moved(other, where[None]), here, volume), error_at_events(other, here, volume)


def has_truth(sample: Sample) -> bool:
    """Whether `scores_of` scores it."""
    return bool(has_flow(sample) or sample["volume"].any() and frames_of(sample))


def scores_of(network: nn.Module, position: float, shards: Shards) -> dict[str, Any]:
    """Scores of the samples with flow, as flow_scores, and of the samples of a recording the share of the frames' error
    that is left once the flow has moved them: of each recording, and the mean."""
    flows: list[tuple[np.ndarray, ...]] = []
    errors: dict[str, list[tuple[float, float]]] = {}
    for i in range(len(shards)):
        sample = shards.sample(i, {"volume", "pair", "flow"})
        found, events = predict(network, torch.from_numpy(sample["volume"])), sample["volume"].any(0)
        if has_flow(sample):
            flows.append((found.numpy(), sample["flow"], sample["flow_valid"] != 0, events))
        frames = frames_of(sample)
        if frames and events.any():
            errors.setdefault(sample["pair"]["sequence"], []).append(
                errors_of_frames(found, position, *frames, torch.from_numpy(sample["volume"])[None]))
    result: dict[str, Any] = {}
    if flows:
        result = {"dense": flow_scores(flow[:3] for flow in flows),
                  "at events": flow_scores((*flow[:2], flow[2] & flow[3]) for flow in flows)}
    if errors:
        left = {name: float(np.divide(*np.mean(each, 0))) for name, each in errors.items()}
        result["error of the moved frame"] = {**left, "mean": float(np.mean([*left.values()]))}
    return result


def main() -> None:
    parser = training.options(__doc__.splitlines()[0], batch=4, lr=2e-3, steps=STEPS)
    parser.add_argument("--bfloat16", action="store_true", help="compute convolutions in bfloat16, faster where the "
                        "processor has AVX512-BF16 or AMX")
    parser.add_argument("--channels", choices=["volume", "voxel"], default="volume",
                        help="what the network sees: each polarity's events, or their difference, as of a voxel grid")
    args = training.begin(parser)
    seen = in_voxels if args.channels == "voxel" else in_units
    train_shards, validation_shards = (part.changed(seen) for part in training.divided(args, with_flow))
    test_shards = training.tested(args, train_shards, validation_shards, with_events).changed(seen)
    if not any(map(has_truth, (test_shards.sample(i, {"volume", "pair", "flow"}) for i in range(len(test_shards))))):
        raise SystemExit(f"expected samples with flow, or of recordings whose frames are still there, got none, in "
                         f"{args.test}")
    dataset = FlowDataset(train_shards)
    items = [{**item, "volume": item["volume"].half()} for item in map(dataset.__getitem__, range(len(dataset)))]
    positions = {item["label_position"] for item in items}
    if len(positions) > 1:
        raise SystemExit(f"expected flow at the pixels of the next image, or of the previous one (side), got both, in "
                         f"{args.data}")
    position = positions.pop()
    tested = test_shards[[*with_flow(test_shards)]]
    for part, folder in ((validation_shards, args.data), (tested, args.test)):
        if any(part.sample(i, {"pair"})["pair"]["label_position"] != position for i in range(len(part))):
            image, side = ("next", "before") if position == 1 else ("previous", "after")
            raise SystemExit(f"expected flow at the pixels of the {image} image (side {side}), as it is learnt, got "
                             f"other flow, in {folder}")
    training.require_own_ids(args, tested)
    network = FlowNetwork(len(items[0]["volume"]), position)
    training.load_fitting(network, args.pretrained)
    network = network.to(args.device).to(memory_format=torch.channels_last)

    def loss_of(batch: tuple, _: float) -> torch.Tensor:
        volumes, flow, valid = (each.to(args.device) for each in batch)
        with torch.autocast(args.device, torch.bfloat16, enabled=args.bfloat16):
            predictions = network(volumes.contiguous(memory_format=torch.channels_last))
        return flow_loss(predictions, flow, valid)

    def check() -> dict[str, float]:
        scores = scores_of(network, position, validation_shards[::math.ceil(len(validation_shards) / CHECKED)])
        return {"AEE": scores["dense"]["aee"], "AEE at events": scores["at events"]["aee"],
                "above 1 px": scores["dense"]["npe_1"], "above 3 px": scores["dense"]["npe_3"]}

    training.fit(args, network, torch.optim.Adam(network.parameters(), args.lr),
                 training.batches(args, Crops(items), shuffle=True), loss_of, check, "AEE")

    test = scores_of(network, position, test_shards)
    for title, numbers in test.items():
        print(f"{title}: " + ", ".join(f"{name} {value:.3g}" for name, value in numbers.items()))
    training.replace(pathlib.Path(args.out, "scores.json"),
                     lambda path: path.write_text(json.dumps(test, indent=1) + "\n", encoding="utf-8"))
    if "dense" in test:
        training.write_predictions(args, test_shards, (
            (name, predict(network, torch.from_numpy(test_shards.sample(i, {"volume"})["volume"])).numpy())
            for i, name in enumerate(test_shards.column("sample_id"))), "flows")

    def image_of(i: int) -> tuple[str, np.ndarray]:
        """The events, the flow that was found, and the true one; white: none, or not valid."""
        sample = test_shards.sample(i, {"volume", "pair", "flow"})
        flows = [predict(network, torch.from_numpy(sample["volume"])).numpy()]
        flows += [np.where(sample["flow_valid"], sample["flow"], 0)] if "flow" in sample else []
        longest = max(1.0, np.percentile(np.hypot(*flows[-1]), 98))
        panels = [drawing.of_events(sample["volume"])]
        panels += [cv2.resize(in_colour(flow, longest)[..., ::-1], panels[0].shape[1::-1]) for flow in flows]
        return sample["pair"]["sample_id"], np.hstack(panels)

    training.write_images(args, len(test_shards), image_of)


if __name__ == "__main__":
    main()
