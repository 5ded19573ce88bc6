"""Images from event volumes by FireNet+, a network trained on other events, and how similar they are to the frames.

    network = reconstruction.load_firenet("model.pth")
    images = reconstruction.reconstruct(network, volumes)  # [T, H, W] of a sequence [T, 2B, H, W]
    normalized = reconstruction.robust_normalized
    score = reconstruction.ssim(normalized(images[-1]), normalized(frames[-1]))

The more a volume is like a camera's, the sharper the image. FireNet is from Scheerlinck et al. 2020, "Fast Image
Reconstruction with an Event Camera"; FireNet+ has the weights of Stoffregen et al. 2020, "Reducing the Sim-to-Real Gap
for Event Cameras", and is evaluated in EVREAL (Ercan et al. 2023). The weights do not come with the package. Needs
PyTorch.
"""

from __future__ import annotations

import collections
import io
import pathlib
import pickle
import zipfile
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from eventgan.open_shards import PathLike

BINS = 5  # of FireNet+'s grids
_CHANNELS = 16
_PERCENTILES = (1, 99)
_TAPS, _SIGMA = 11, 1.5
_STABLE = (0.01**2, 0.03**2)  # C1 and C2 of SSIM, of values in 0..1


class FireNet(nn.Module):
    """FireNet: a convolution, two convolutional GRUs, each followed by a residual block,
    and a convolution to an image."""

    def __init__(self) -> None:
        super().__init__()
        self.head = nn.ModuleDict({"conv2d": nn.Conv2d(BINS, _CHANNELS, 3, padding=1)})
        self.G1, self.R1 = _ConvGRU(), _ResidualBlock()
        self.G2, self.R2 = _ConvGRU(), _ResidualBlock()
        self.pred = nn.ModuleDict({"conv2d": nn.Conv2d(_CHANNELS, 1, 1)})

    def forward(self, grids: torch.Tensor, states: tuple[torch.Tensor, torch.Tensor] | None = None,
                ) -> tuple[torch.Tensor, tuple[torch.Tensor, torch.Tensor]]:
        """One step: images float32 [N, 1, H, W], about 0..1, and the states for the next step.

        `grids` are float32 [N, 5, H, W], counts of positive minus negative events; `states` are those of the step
        before, two of [N, 16, H, W], None for the first one of a sequence.
        """
        x = torch.relu(self.head["conv2d"](grids))
        first, second = states or (torch.zeros_like(x), torch.zeros_like(x))
        first = self.G1(x, first)
        second = self.G2(self.R1(first), second)
        return self.pred["conv2d"](self.R2(second)), (first, second)


class _ConvGRU(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.reset_gate, self.update_gate, self.out_gate = (nn.Conv2d(2 * _CHANNELS, _CHANNELS, 3, padding=1)
                                                            for _ in range(3))

    def forward(self, x: torch.Tensor, state: torch.Tensor) -> torch.Tensor:
        both = torch.cat([x, state], 1)
        update, reset = torch.sigmoid(self.update_gate(both)), torch.sigmoid(self.reset_gate(both))
        candidate = torch.tanh(self.out_gate(torch.cat([x, state * reset], 1)))
        return state * (1 - update) + candidate * update


class _ResidualBlock(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.conv1, self.conv2 = (nn.Conv2d(_CHANNELS, _CHANNELS, 3, padding=1) for _ in range(2))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return torch.relu(x + self.conv2(torch.relu(self.conv1(x))))


def load_firenet(path: PathLike) -> FireNet:
    """FireNet with the weights of a checkpoint.

    The checkpoint is a pickle with objects of its trainer's classes, which `torch.load` would run, or refuse with
    weights_only. Here only tensors of float32 are read: nothing that the file names is imported or called.

    Parameters
    ----------
    path : str or path
        A checkpoint of `torch.save` (a zip file, or as before PyTorch 1.6), with `state_dict`, or a state dict alone.

    Returns
    -------
    FireNet
        On the CPU, for inference: its parameters need no gradients.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    ValueError
        It is not a checkpoint, or not of FireNet with 5 bins and 16 channels.
    """
    try:
        checkpoint = _read_checkpoint(pathlib.Path(path).read_bytes())
    except (pickle.UnpicklingError, zipfile.BadZipFile, EOFError, LookupError, TypeError, AttributeError,
            RuntimeError, ValueError) as error:
        raise ValueError(f"expected a checkpoint of PyTorch with tensors of float32, got {type(error).__name__}: "
                         f"{error}, in {path}") from error
    state = checkpoint.get("state_dict", checkpoint) if isinstance(checkpoint, dict) else None
    tensors = {name: tensor for name, tensor in state.items()
               if isinstance(tensor, torch.Tensor)} if isinstance(state, dict) else {}
    network = FireNet()
    expected, got = ({name: list(tensor.shape) for name, tensor in each.items()}
                     for each in (network.state_dict(), tensors))
    for name in [*expected, *got]:
        if expected.get(name) != got.get(name):
            raise ValueError(f"expected {name} {expected.get(name, 'not at all')} of FireNet, got "
                             f"{got.get(name, 'none')}, in {path}")
    network.load_state_dict(tensors)
    return network.eval().requires_grad_(False)


class _PassedOver:
    """Stands in for an object of any other class."""

    def __new__(cls, *_: Any, **__: Any) -> _PassedOver:
        return object.__new__(cls)

    def __init__(self, *_: Any, **__: Any) -> None:
        pass

    __setstate__ = __setitem__ = append = extend = __init__

    def __call__(self, *_: Any, **__: Any) -> _PassedOver:
        return self


def _tensor(storage: torch.Tensor, offset: int, size: tuple[int, ...],
            stride: tuple[int, ...], *_: Any) -> torch.Tensor:
    return storage.as_strided(size, stride, offset)  # which checks the bounds


class _Unpickler(pickle.Unpickler):
    """Reads containers, numbers, text, and tensors as views of `storages`; `content` makes one, float32 [length],
    from its key and length."""

    def __init__(self, file: io.BytesIO, content: Callable[[str, int], torch.Tensor]) -> None:
        super().__init__(file)
        self.storages: dict[str, torch.Tensor] = {}
        self._content = content

    def find_class(self, module: str, name: str) -> Any:
        known = {("collections", "OrderedDict"): collections.OrderedDict,
                 ("torch._utils", "_rebuild_tensor_v2"): _tensor, ("torch", "FloatStorage"): torch.float32}
        return known.get((module, name), _PassedOver)

    def persistent_load(self, pid: Any) -> Any:
        _, dtype, key, _, length = pid[:5]
        if dtype is not torch.float32:
            raise ValueError("a storage of another type")
        if key not in self.storages:
            self.storages[key] = self._content(key, length)
        return self.storages[key]


def _read_checkpoint(content: bytes) -> Any:
    """What `torch.save` was given, from either of its two formats."""
    if zipfile.is_zipfile(io.BytesIO(content)):
        with zipfile.ZipFile(io.BytesIO(content)) as file:
            index = next((name for name in file.namelist() if name.endswith("/data.pkl")), "data.pkl")
            folder = index.removesuffix(".pkl")
            return _Unpickler(io.BytesIO(file.read(index)),
                              lambda key, length: _floats(file.read(f"{folder}/{key}"), length)).load()
    stream = io.BytesIO(content)
    most = len(content) // 4

    def later(key: str, length: int) -> torch.Tensor:
        if not 0 <= length <= most:
            raise ValueError(f"a storage of {length} numbers")
        return torch.zeros(length)

    for _ in range(3):  # a magic number, the format's version, and the machine's sizes of types
        _Unpickler(stream, later).load()
    unpickler = _Unpickler(stream, later)
    result = unpickler.load()
    for key in _Unpickler(stream, later).load():  # each storage follows in this order, its length first
        storage = unpickler.storages[key]
        length = int.from_bytes(stream.read(8), "little")
        storage.copy_(_floats(stream.read(4 * length), len(storage)))
    return result


def _floats(content: bytes, length: int) -> torch.Tensor:
    if len(content) != 4 * length:
        raise ValueError(f"{len(content)} bytes for {length} numbers")
    return torch.from_numpy(np.frombuffer(content, "<f4").astype(np.float32))


def signed_grid(volume: np.ndarray, bins: int = BINS) -> np.ndarray:
    """The voxel grid of signed events that reconstruction networks take: positive minus negative, resampled in time.

    Bin b of B stands for the time b / (B - 1). Its value is shared between the two new bins nearest in time, as events
    are between bins. If B - 1 is a multiple of `bins` - 1, such as 9 and 5 bins, the result is the grid that the events
    themselves would make.

    Parameters
    ----------
    volume : numpy.ndarray
        [..., 2B, H, W], bins of positive polarity in time order, then of negative; B >= 2.
    bins : int, default 5
        At least 2.

    Returns
    -------
    numpy.ndarray
        float32 [..., bins, H, W]. Its sum is that of the positive events minus that of the negative ones.

    Raises
    ------
    ValueError
        The volume does not have such channels.
    """
    channels = volume.shape[-3] if volume.ndim >= 3 else 0
    if channels % 2 or channels < 4 or bins < 2:
        raise ValueError("expected a volume [..., 2B, H, W] with B of at least 2, and at least 2 bins, got "
                         f"{list(volume.shape)} and {bins}")
    of = channels // 2
    signed = np.subtract(volume[..., :of, :, :], volume[..., of:, :, :], dtype=np.float32)
    times = np.arange(of) * ((bins - 1) / (of - 1))
    weights = np.maximum(0, 1 - np.abs(np.arange(bins)[:, None] - times)).astype(np.float32)  # [bins, B]
    return np.einsum("kb,...bhw->...khw", weights, signed, optimize=True)


def reconstruct(network: FireNet, volumes: Iterable[np.ndarray]) -> np.ndarray:
    """An image after each volume of a sequence, which starts without any knowledge of the scene.

    The grids are not normalised: FireNet+ was trained on counts of events at thresholds from 0.2 to 1.5, and EVREAL
    gives it counts (event_tensor_normalization: false). Scale volumes that are not counts. The network keeps the
    resolution, so nothing is padded.

    Parameters
    ----------
    network : FireNet
    volumes : numpy.ndarray or iterable
        [T, 2B, H, W], or T of [2B, H, W], in time order.

    Returns
    -------
    numpy.ndarray
        float32 [T, H, W], clipped to 0..1. The first images lack what has not moved yet.
    """
    images, states = [], None
    with torch.no_grad():
        for volume in volumes:
            image, states = network(torch.from_numpy(signed_grid(volume))[None], states)
            images.append(image[0, 0].clamp(0, 1).numpy())
    if not images:
        raise ValueError("expected volumes, got none")
    return np.stack(images)


def robust_normalized(image: np.ndarray) -> np.ndarray:
    """The image with its 1st percentile at 0 and its 99th at 1, clipped, float32 [H, W]: post-processing "robust" of
    EVREAL. Zeros if both are the same.
    """
    low, high = np.percentile(image, _PERCENTILES)
    return (np.clip((image - low) / (high - low), 0, 1).astype(np.float32) if high > low
            else np.zeros(image.shape, np.float32))


def ssim(image: np.ndarray, reference: np.ndarray) -> float:
    """The structural similarity of two images: the mean of `ssim_map`, -1..1; 1 for equal images."""
    return float(ssim_map(image, reference).mean())


def ssim_map(image: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """The structural similarity of two images around each pixel (Wang et al. 2004).

    Where the reference is flat it mostly rates whether the image is flat, too: a grey area can score better against a
    photograph than the true image with noise.

    Means, variances and covariance are weighted by a Gaussian of 11 x 11 pixels, sigma 1.5, and not corrected for the
    sample size; C1 = 0.01², C2 = 0.03². Only windows wholly inside count, so the map lacks five pixels at each
    border, as with scikit-image in EVREAL.

    Parameters
    ----------
    image, reference : numpy.ndarray
        [H, W], 0..1, both sides at least 11.

    Returns
    -------
    numpy.ndarray
        float64 [H - 10, W - 10], -1..1: of the pixels 5..H - 6, 5..W - 6.

    Raises
    ------
    ValueError
        The images differ in size or are smaller.
    """
    if image.shape != reference.shape or image.ndim != 2 or min(image.shape) < _TAPS:
        raise ValueError(f"expected two images of one size [H, W], both sides at least {_TAPS}, got "
                         f"{list(image.shape)} and {list(reference.shape)}")
    gauss = torch.exp(-0.5 * ((torch.arange(_TAPS, dtype=torch.float64) - _TAPS // 2) / _SIGMA) ** 2)
    gauss /= gauss.sum()
    x, y = (torch.from_numpy(one.astype(np.float64)) for one in (image, reference))
    moments = torch.stack([x, y, x * x, y * y, x * y])[:, None]
    moments = functional.conv2d(functional.conv2d(moments, gauss.view(1, 1, -1, 1)), gauss.view(1, 1, 1, -1))
    mean_x, mean_y, square_x, square_y, product = moments[:, 0]
    covariance = product - mean_x * mean_y
    variances = square_x - mean_x**2 + square_y - mean_y**2
    c1, c2 = _STABLE
    return ((2 * mean_x * mean_y + c1) * (2 * covariance + c2)
            / ((mean_x**2 + mean_y**2 + c1) * (variances + c2))).numpy()
