#!/usr/bin/python3
"""What all engines are compared with: the generator (stages/generator/weights.h) as a plain PyTorch program, float32,
eager, one thread.

The modules are those of the published code: a convolution, its batch normalisation and its activation run one after the
other, in PyTorch's own layout. Spectral norm is folded, as it is after a checkpoint's first forward pass.

A server for engines.py, which alternates it with the other engines: it reads requests from stdin, a line each, and
answers with a line of JSON.

    input HEIGHT WIDTH FILE   the frames [2, y, x], float32 in [-1, 1], raw; warms up
    run                       one forward pass: {"wall_ms": ..., "cpu_ms": ...}
"""

import argparse
import json
import sys
import time

import numpy
import torch
from torch import nn
from torch.nn import functional

BINS = 9  # per polarity
LEVELS = 4
LEAKY_SLOPE = 0.01
NORM_MOMENTUM = 0.01
WARM_UP_PASSES = 2


class ConvLayer(nn.Module):
    def __init__(self, channels_in, channels_out, kernel=3, stride=1, norm=False, activation=functional.leaky_relu):
        super().__init__()
        self.conv2d = nn.Conv2d(channels_in, channels_out, kernel, stride, padding=kernel // 2, bias=not norm)
        self.norm_layer = nn.BatchNorm2d(channels_out, momentum=NORM_MOMENTUM) if norm else None
        self.activation = activation

    def forward(self, x):
        x = self.conv2d(x)
        if self.norm_layer is not None:
            x = self.norm_layer(x)
        return self.activation(x)


class UpsampleConvLayer(ConvLayer):
    def forward(self, x, skip):
        x = functional.interpolate(x, size=skip.shape[2:], mode="nearest")
        return super().forward(torch.cat([x, skip], dim=1))


class ResidualBlock(nn.Module):
    def __init__(self, channels):
        super().__init__()
        self.conv1 = nn.Conv2d(channels, channels, 3, padding=1, bias=False)
        self.bn1 = nn.BatchNorm2d(channels, momentum=NORM_MOMENTUM)
        self.conv2 = nn.Conv2d(channels, channels, 3, padding=1, bias=False)
        self.bn2 = nn.BatchNorm2d(channels, momentum=NORM_MOMENTUM)

    def forward(self, x):
        y = functional.relu(self.bn1(self.conv1(x)))
        return functional.relu(self.bn2(self.conv2(y)) + x)


class Generator(nn.Module):
    """[B, 2, H, W] in [-1, 1] → [B, 18, H, W] ≥ 0, of any size."""

    def __init__(self, base_width):
        super().__init__()
        widths = [base_width * 2 ** level for level in range(LEVELS + 1)]
        self.head = ConvLayer(2, base_width)
        self.encoders = nn.ModuleList(
            ConvLayer(widths[i], widths[i + 1], stride=2, norm=True) for i in range(LEVELS))
        self.resblocks = nn.ModuleList(ResidualBlock(widths[-1]) for _ in range(2))
        self.decoders = nn.ModuleList(
            UpsampleConvLayer(widths[i + 1] + widths[i], widths[i], norm=True) for i in reversed(range(LEVELS)))
        self.pred = ConvLayer(base_width, 2 * BINS, kernel=1, activation=functional.relu)

    def forward(self, x):
        x = self.head(x)
        skips = []
        for encoder in self.encoders:
            skips.append(x)
            x = encoder(x)
        for block in self.resblocks:
            x = block(x)
        for decoder, skip in zip(self.decoders, reversed(skips)):
            x = decoder(x, skip)
        return self.pred(x)


def random_generator(base_width, seed):
    """He initialisation, so that the numbers neither vanish nor overflow on their way."""
    torch.manual_seed(seed)
    network = Generator(base_width).eval()
    for module in network.modules():
        if isinstance(module, nn.Conv2d):
            nn.init.kaiming_normal_(module.weight)
    return network


def timed_pass(network, frames):
    wall, cpu = time.perf_counter(), time.process_time()
    network(frames)
    return {"wall_ms": 1e3 * (time.perf_counter() - wall), "cpu_ms": 1e3 * (time.process_time() - cpu)}


def answers(network, requests):
    frames = None
    for request in requests:
        word, *rest = request.split()
        if word == "input":
            height, width, path = rest
            frames = torch.from_numpy(numpy.fromfile(path, numpy.float32)).reshape(1, 2, int(height), int(width))
            for _ in range(WARM_UP_PASSES):
                network(frames)
            yield {"size": list(frames.shape[2:])}
        elif word == "run":
            yield timed_pass(network, frames)
        else:
            raise SystemExit(f"expected input or run, got {request!r}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--base-width", type=int, default=32)
    parser.add_argument("--seed", type=int, default=7)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    with torch.no_grad():
        network = random_generator(arguments.base_width, arguments.seed)
        print(json.dumps({"description": f"PyTorch {torch.__version__} eager float32, 1 thread", "native": True}),
              flush=True)
        for answer in answers(network, sys.stdin):
            print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
