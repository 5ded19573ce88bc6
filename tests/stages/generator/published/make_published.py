#!/usr/bin/python3
"""Makes published.pt and published_case.pt beside this file, with which the engines are compared on every machine.

    /usr/bin/python3 tests/stages/generator/published/make_published.py [GOLDEN.h5]

The generator as the authors' code defines it (repository alexzzhu/EventGAN, commit c423048), with random weights of
base width 2: published.pt is the state dict before the first forward pass (spectral norm changes it with each), in the
format before PyTorch 1.6; published_case.pt has the input and what that pass gives. With a file of numbers that the
authors' own code computed (golden.h5 of ../shared/data) this definition is compared with them first.
"""

import pathlib
import sys

import torch
from torch import nn

FOLDER = pathlib.Path(__file__).parent


def l2normalize(vector, eps=1e-12):
    return vector / (vector.norm() + eps)


class SpectralNorm(nn.Module):
    """One power iteration in each forward pass, also in evaluation."""

    def __init__(self, module):
        super().__init__()
        self.module = module
        weight = module.weight
        height, width = weight.shape[0], weight.view(weight.shape[0], -1).shape[1]
        module.register_parameter("weight_u", nn.Parameter(l2normalize(torch.randn(height)), requires_grad=False))
        module.register_parameter("weight_v", nn.Parameter(l2normalize(torch.randn(width)), requires_grad=False))
        del module._parameters["weight"]
        module.register_parameter("weight_bar", nn.Parameter(weight.data))

    def forward(self, x):
        module = self.module
        matrix = module.weight_bar.view(module.weight_bar.shape[0], -1)
        module.weight_v.data = l2normalize(torch.mv(matrix.t(), module.weight_u))
        module.weight_u.data = l2normalize(torch.mv(matrix, module.weight_v))
        sigma = module.weight_u.dot(matrix.mv(module.weight_v))
        module.weight = module.weight_bar / sigma
        return module(x)


class ConvLayer(nn.Module):
    def __init__(self, into, out, kernel, stride=1, norm=True, spectral=False, activation=None):
        super().__init__()
        conv2d = nn.Conv2d(into, out, kernel, stride, kernel // 2, bias=not norm)
        self.conv2d = SpectralNorm(conv2d) if spectral else conv2d
        self.norm_layer = nn.BatchNorm2d(out, momentum=0.01) if norm else nn.Identity()
        self.activation = activation

    def forward(self, x):
        return self.activation(self.norm_layer(self.conv2d(x)))


class ResidualBlock(nn.Module):
    def __init__(self, channels):
        super().__init__()
        self.conv1 = SpectralNorm(nn.Conv2d(channels, channels, 3, 1, 1, bias=False))
        self.bn1 = nn.BatchNorm2d(channels, momentum=0.01)
        self.bn2 = nn.BatchNorm2d(channels, momentum=0.01)
        self.conv2 = SpectralNorm(nn.Conv2d(channels, channels, 3, 1, 1, bias=False))

    def forward(self, x):
        inner = torch.relu(self.bn1(self.conv1(x)))
        return torch.relu(self.bn2(self.conv2(inner)) + x)


class Generator(nn.Module):
    def __init__(self, base, bins=9):
        super().__init__()
        leaky = nn.LeakyReLU(0.01)
        self.head = ConvLayer(2, base, 3, norm=False, activation=leaky)
        self.encoders = nn.ModuleList(
            ConvLayer(base << level, base << (level + 1), 3, stride=2, activation=leaky) for level in range(4))
        self.resblocks = nn.ModuleList(ResidualBlock(16 * base) for _ in range(2))
        self.decoders = nn.ModuleList(
            ConvLayer((base << level) + (base << (level - 1)), base << (level - 1), 3, spectral=True, activation=leaky)
            for level in range(4, 0, -1))
        self.pred = ConvLayer(base, 2 * bins, 1, norm=False, activation=torch.relu)

    def forward(self, x):
        x = self.head(x)
        skips = []
        for encoder in self.encoders:
            skips.append(x)
            x = encoder(x)
        for block in self.resblocks:
            x = block(x)
        for decoder, skip in zip(self.decoders, reversed(skips)):
            x = nn.functional.interpolate(x, size=skip.shape[2:], mode="nearest")
            x = decoder(torch.cat([x, skip], 1))
        return self.pred(x)


def check(golden_file):
    import h5py
    with h5py.File(golden_file) as golden:
        group = golden["generator"]
        state = {name: torch.from_numpy(group["state"][name][()]) if group["state"][name].shape
                 else torch.tensor(group["state"][name][()]) for name in group["state"]}
        for case in sorted(set(group) - {"state"}):
            generator = Generator(state["head.conv2d.weight"].shape[0]).eval()
            generator.load_state_dict(state)
            with torch.no_grad():
                volume = generator(torch.from_numpy(group[case]["input"][()])[None])[0]
            expected = torch.from_numpy(group[case]["volume"][()])
            error = ((volume - expected).norm() / expected.norm()).item()
            print(f"{case}: relative L2 error against the authors' code {error:.1e}")
            assert error < 1e-6


def main():
    if len(sys.argv) > 1:
        check(sys.argv[1])
    torch.manual_seed(7)
    generator = Generator(2).eval()
    for module in generator.modules():
        if isinstance(module, nn.BatchNorm2d):
            nn.init.uniform_(module.weight, 0.5, 1.5)
            nn.init.uniform_(module.bias, -0.3, 0.3)
            nn.init.uniform_(module.running_mean, -0.3, 0.3)
            nn.init.uniform_(module.running_var, 0.2, 0.6)
    state = {name: value.clone() for name, value in generator.state_dict().items()}
    torch.save({"gen": state, "epoch": 3, "dataset_perm": None}, FOLDER / "published.pt",
               _use_new_zipfile_serialization=False)
    # A bright disc on a slope that moves by two pixels; an odd size, so that levels do not halve evenly.
    height, width = 21, 30
    y, x = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    frames = torch.stack([((x - 12 - 2 * k) ** 2 + (y - 10) ** 2 < 36) * 120 + 3 * x + y for k in range(2)])
    frames = (frames.float() / 255 - 0.5) * 2
    with torch.no_grad():
        volume = generator(frames[None])[0]
    print(f"volume: {(volume > 0).float().mean():.2f} of it above 0, {(volume.amax((1, 2)) > 0).sum()} of 18 channels")
    torch.save({"case": {"input": frames, "volume": volume}}, FOLDER / "published_case.pt",
               _use_new_zipfile_serialization=False)


main()
