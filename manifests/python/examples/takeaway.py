"""What one takes to the camera: detector.pt, a trained detector in one file that needs PyTorch alone, and detect.py."""

import copy
import json
import pathlib
import shutil
import warnings
from typing import Any, Callable, Dict, List, Tuple  # as TorchScript reads them

import torch
import torch.nn.functional as F
import training
from torch import nn


class EventsToBoxes(nn.Module):
    """Of a window of a camera's events its objects. It makes the volume as in the shards, of so many bins and with
    `eta98` divided by its 98th percentile, or with `signed` the `signed_channel` of that, and brings it to the size
    H, W by `fitted`; `network` gives boxes, labels and scores of that [1, n, ...], the surest first."""

    def __init__(self, network: nn.Module, size: Tuple[int, int], bins: int, eta98: bool, signed: bool) -> None:
        super().__init__()
        self.network, self.height, self.width = network, size[0], size[1]
        # positive minus negative events of a pixel are as many in any number of bins
        self.bins, self.eta98, self.signed = 1 if signed and not eta98 else bins, eta98, signed

    def forward(self, t: torch.Tensor, x: torch.Tensor, y: torch.Tensor, p: torch.Tensor, height: int,
                width: int) -> Tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Of events in time order: t, x, y [N], whole numbers, and p [N], positive if above 0, of a sensor of that
        height and width: boxes [n, 4], left, top, right, bottom in its pixels, labels [n], scores [n]."""
        if not len(t):
            return torch.zeros(0, 4), torch.zeros(0, dtype=torch.long), torch.zeros(0)
        seen = self.seen(t, x, y, p, height, width)
        scale = min(self.width / width, self.height / height)
        wide, high = self.width / (scale * width), self.height / (scale * height)
        grid = F.affine_grid(torch.tensor([[[wide, 0.0, 0.0], [0.0, high, 0.0]]]),
                             [1, 1, self.height, self.width], align_corners=False)
        found: Tuple[torch.Tensor, torch.Tensor, torch.Tensor] = self.network(
            F.grid_sample(seen[None], grid, align_corners=False))
        boxes, labels, scores = found[0][0], found[1][0], found[2][0]
        corner = torch.tensor([self.width - scale * width, self.height - scale * height]) / 2
        sole: List[int] = []
        for i in range(len(boxes)):  # those that non-maximum suppression leaves
            box = boxes[i]
            if float(scores[i]) <= 0.001 or float((box[2:] - box[:2]).min()) <= 0:
                continue
            others = boxes[sole]
            both = (torch.minimum(box[2:], others[:, 2:]) - torch.maximum(box[:2], others[:, :2])).clamp(min=0).prod(1)
            areas = (box[2:] - box[:2]).prod() + (others[:, 2:] - others[:, :2]).prod(1)
            if not bool(((both > 0.5 * (areas - both)) & (labels[sole] == labels[i])).any()):
                sole.append(i)
        return (boxes[sole] - corner.repeat(2)) / scale, labels[sole], scores[sole]

    def seen(self, t: torch.Tensor, x: torch.Tensor, y: torch.Tensor, p: torch.Tensor, height: int,
             width: int) -> torch.Tensor:
        """[C, height, width]: the volume, or its signed channel."""
        count, pixels = 2 * self.bins * height * width, height * width
        if int(x.max()) >= width or int(y.max()) >= height:
            raise ValueError(f"expected events within {width}x{height}, got one at {int(x.max())}, {int(y.max())}")
        at = (self.bins - 1) * (t - t[0]).double() / max(int(t[-1] - t[0]), 1)
        cell = (at.long() + self.bins * (p <= 0).long()) * pixels + y.long() * width + x.long()
        volume = torch.bincount(cell, 1 - at % 1, count)
        if self.bins > 1:
            volume += torch.bincount(cell + pixels, at % 1, count)[:count]
        if self.eta98:
            there = volume[volume > 0]
            volume = (volume / there.kthvalue(max(int(0.98 * len(there)), 1))[0]).clamp(max=1)
        volume = volume.float().view(2 * self.bins, height, width)
        if not self.signed:
            return volume
        signed = volume[:self.bins].sum(0) - volume[self.bins:].sum(0)
        strength = signed.abs()
        scale = torch.quantile(strength, 0.99)
        return (signed / torch.where(scale > 0, scale, strength.max())).nan_to_num().clamp(-1, 1)[None]


class _Likeliest(nn.Module):
    def __init__(self, network: nn.Module, likeliest: Callable[..., Tuple[torch.Tensor, ...]]) -> None:
        super().__init__()
        self.network, self.likeliest = network, likeliest

    def forward(self, events: torch.Tensor) -> Tuple[torch.Tensor, ...]:
        return self.likeliest(*self.network(events))


def write(folder: pathlib.Path, network: nn.Module, likeliest: Callable[..., Tuple[torch.Tensor, ...]], channels: int,
          size: Tuple[int, int], told: Dict[str, Any]) -> None:
    """FOLDER/detector.pt of the network, of whose output `likeliest` makes boxes, labels and scores, for detect.py,
    which is put beside it. `told`: classes, bins, normalize, channels, score and window_ms, which lie in the file, too,
    as detector.json."""
    # TorchScript, not ONNX: Debian 12 has nothing that runs ONNX's files (its OpenCV does not read this one), and
    # PyTorch 2 writes them only with the package onnx.
    events = torch.zeros(1, channels, *size)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", torch.jit.TracerWarning)  # sizes are to be constants
        traced = torch.jit.trace(_Likeliest(copy.deepcopy(network).cpu(), likeliest).eval(), events, check_trace=False)
    whole = torch.jit.script(EventsToBoxes(traced, size, told["bins"], told["normalize"] == "eta98",
                                           told["channels"] == "signed"))
    training.replace(folder / "detector.pt",
                     lambda path: torch.jit.save(whole, str(path), {"detector.json": json.dumps(told)}))
    script = pathlib.Path(__file__).with_name("detect.py")
    training.replace(folder / script.name, lambda path: shutil.copy(script, path))
