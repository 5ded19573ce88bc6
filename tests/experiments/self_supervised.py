#!/usr/bin/python3
"""Networks for optical flow and for images, learnt without labels on generated events of some recordings, tested on the
real events of others.

    self_supervised.py --program build/release/eventgan --recordings recordings slider_depth_mvsec_layout.hdf5
    --peers peers --out flows

The networks and their losses are those that `eventgan train` has besides the generator (EventGAN, section 3.3). The
flow network learns from events how each pixel moves: the previous frame, moved by the flow, should look like the next
one. The reconstruction network learns the next frame from the previous one and the events' sum. Each way of making
events has its row; a row's networks see its events alone, of the same crops in the same order as every other row's, and
the row "real" those of the camera: the bound. Controls learn nothing: a flow that is no better than the previous frame
blurred has not been learnt. `--with` and no row measures them alone.

Recordings are of MVSEC's layout, and of one camera and scene if their names begin with the same word (up to _). Every
second such group is one half: the networks that learn on one half are tested on the other, so every recording is tested
by networks that have not seen it. The same command resumes: what networks of a row and a seed scored is kept.
"""

from __future__ import annotations

import argparse
import csv
import functools
import io
import itertools
import json
import os
import pathlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import cv2
import matplotlib
import numpy as np
import recordings
import torch
import training
from kept_settings import require_same, write
from torch import nn
from torch.nn import functional
from train_flow import UNet, begin_at_rest, error_at_events, in_colour, moved, normalized

matplotlib.use("Agg")
from matplotlib import pyplot

SMOOTHNESS = 0.5  # of `eventgan train`
SIDE, BATCH, RATE = 96, 4, 2e-3
AGAIN = 40  # batches for the batch norms' means
PLACES = 4  # a crop is that of so many places where the frames differ most: most of a frame at rest has no events
GAIN, GAMMA = (0.3, 1.5), (0.8, 1.25)  # of the frames' brightness, with which the shipped weights were trained, too
LONGEST = 346  # side of a frame in pixels, that of a DAVIS346; larger ones are reduced, for time
FARTHEST = 32  # pixels of a constant flow in x and in y
FITTING = 0.5  # least correlation of a pair's events with what changes between its frames
REAL = "real"
ROWS = [*recordings.METHODS, REAL]
DRAWN = ["EventGAN 16", "difference, fitted", REAL]


# The losses, with the published oddities, of which stages/training/losses.cc tells
# ----------------------------------------------------------------------------------------------------------------------


def charbonnier(error: torch.Tensor) -> torch.Tensor:
    return (0.45 * (error * error + 1e-10).log()).exp()  # a third of a power's time, with its gradient


def flow_losses(previous: torch.Tensor, following: torch.Tensor, flows: Sequence[torch.Tensor],
                mask: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """How much the previous frame, moved by the flow, differs from the next one where there are events; and how rough
    the flow is.

    Parameters
    ----------
    previous, following : torch.Tensor
        Float [B, 1, H, W], in -1..1.
    flows : sequence of torch.Tensor
        [B, 2, h, w], coarse to fine: x as a share of the width, y of the height. What is at (x, y) in the next frame is
        looked up in the previous one at (x + u, y + v).
    mask : torch.Tensor
        [B, 1, H, W], >= 0: how much a pixel counts.

    Returns
    -------
    photometric, smoothness : torch.Tensor
        Scalars, sums over scales, each with half the weight of the next finer one; the second one is not weighted yet.
    """
    height, width = previous.shape[2:]
    y, x = torch.meshgrid(torch.linspace(0, 1, height), torch.linspace(0, 1, width), indexing="ij")
    photometric = smoothness = torch.zeros(())
    for scale, flow in enumerate(flows, 1 - len(flows)):
        places = torch.stack([x, y], 2) + functional.interpolate(flow, (height, width)).permute(0, 2, 3, 1)
        weights = mask * (places.detach().abs() < 1).all(3)[:, None]
        error = charbonnier(functional.grid_sample(previous, 2 * places - 1, align_corners=False) - following)
        photometric = photometric + 2.0**scale * ((error * weights).sum((1, 2, 3))
                                                  / weights.sum((1, 2, 3)).clamp_min(1e-30)).mean()
        for side in (2, 3):
            smoothness = smoothness + 2.0**scale / 2 * charbonnier(torch.diff(flow, dim=side,
                                                                              prepend=flow.narrow(side, 0, 1))).mean()
    return photometric, smoothness


def ssim(first: torch.Tensor, second: torch.Tensor) -> torch.Tensor:
    """Structural similarity (Wang et al. 2004) at each pixel of two float tensors [B, 1, H, W] in -1..1: the same
    shape. Gaussian window of 11x11, zeros beyond the edge, constants for images in 0..1."""

    weights = torch.exp(-torch.arange(-5.0, 6) ** 2 / (2 * 1.5**2))
    weights = weights / weights.sum()

    def blur(image: torch.Tensor) -> torch.Tensor:
        """Images as channels of their own, which is twenty times as fast as one channel of each."""
        count = len(image)
        across = functional.conv2d(image.transpose(0, 1), weights.expand(count, 1, 1, 11), padding=(0, 5), groups=count)
        return functional.conv2d(across, weights[:, None].expand(count, 1, 11, 1),
                                 padding=(5, 0), groups=count).transpose(0, 1)

    mean1, mean2, product = blur(first), blur(second), blur(first * second)
    squares = mean1**2 + mean2**2
    variances = blur(first**2 + second**2) - squares
    return (2 * mean1 * mean2 + 1e-4) * (2 * (product - mean1 * mean2) + 9e-4) / ((squares + 1e-4) * (variances + 9e-4))


def reconstruction_loss(images: Sequence[torch.Tensor], target: torch.Tensor) -> torch.Tensor:
    """L1 - SSIM of predictions [B, 1, h, w], coarse to fine, to the target, float [B, 1, H, W] in -1..1: a scalar, the
    sum over scales, each with half the weight of the next finer one."""
    loss = torch.zeros(())
    for scale, image in enumerate(images, 1 - len(images)):
        image = functional.interpolate(image, target.shape[2:])
        loss = loss + 2.0**scale * ((image - target).abs().mean() - ssim(image, target).mean())
    return loss


# The experiment
# ----------------------------------------------------------------------------------------------------------------------

# previous and following frame, uint8 [H, W], and volume, float16 [2B, H, W]
Pair = tuple[np.ndarray, np.ndarray, np.ndarray]


def reduced(images: np.ndarray, factor: int) -> np.ndarray:
    """[..., H, W] -> float32 [..., H // factor, W // factor]: sums of squares of pixels."""
    height, width = (side // factor for side in images.shape[-2:])
    parts = images[..., :height * factor, :width * factor].reshape(*images.shape[:-2], height, factor, width, factor)
    return parts.sum((-3, -1), dtype=np.float32)


def kept(args: argparse.Namespace, row: str, path: pathlib.Path, compute: Callable[[], dict[str, np.ndarray]]) -> Any:
    """What OUT keeps of a row's events of a recording, computed if it is not there yet."""
    file = args.out / "volumes" / f"{row} {path.stem}.npz".replace(",", "").replace(" ", "-")
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        new = file.with_suffix(".new.npz")
        np.savez(new, **compute())
        new.replace(file)
    return np.load(file)


def read_pairs(args: argparse.Namespace, row: str, path: pathlib.Path) -> list[Pair]:
    """Neighbouring frames of a recording, reduced if they are large, with the row's events; without the pairs whose
    frames do not fit the camera's events, as where their clocks disagree."""
    frames, _ = recordings.frames_of(path)
    factor = -(-max(frames.shape[1:]) // LONGEST)

    def small(volumes: Iterable[np.ndarray]) -> np.ndarray:
        return np.stack([normalized(reduced(volume, factor)) for volume in volumes]).astype(np.float16)

    def of_camera() -> dict[str, np.ndarray]:
        real = recordings.real_volumes(args.program, path, args.out / "shards" / path.stem)
        polarities = (positive.sum(0) - negative.sum(0)
                      for positive, negative in (np.split(volume, 2) for volume in real))
        changes = np.diff(np.log1p(frames.astype(np.float32)), axis=0)
        pairs = ((cv2.GaussianBlur(image, (0, 0), 1).ravel() for image in pair) for pair in zip(polarities, changes))
        return {"volumes": small(real), "event_counts": real.sum((1, 2, 3)),
                "correlations": np.array([np.corrcoef(*pair)[0, 1] for pair in pairs])}

    camera = kept(args, REAL, path, of_camera)

    def of_method() -> dict[str, np.ndarray]:
        return {"volumes": small(map(recordings.METHODS[row](frames, camera["event_counts"], args.peers),
                                     frames, frames[1:]))}

    volumes = (camera if row == REAL else kept(args, row, path, of_method))["volumes"]
    grey = (reduced(frames, factor) / factor**2).round().astype(np.uint8)
    return [pair for pair, fits in zip(zip(grey, grey[1:], volumes), camera["correlations"] >= FITTING) if fits]


def tensors(pairs: Sequence[Pair]) -> tuple[torch.Tensor, ...]:
    """Frames in -1..1, [B, 1, H, W] each, and volumes [B, 2B, H, W], float32."""
    previous, following, volumes = (torch.from_numpy(np.stack(each).astype(np.float32)) for each in zip(*pairs))
    return previous[:, None] / 127.5 - 1, following[:, None] / 127.5 - 1, volumes


def batches(pairs: Sequence[Pair], seed: int) -> Iterator[tuple[torch.Tensor, ...]]:
    """Crops without end, flipped and of changed brightness. Which ones does not depend on the events,
    so every row learns from the same."""
    random = np.random.default_rng(seed)

    def crop() -> Pair:
        previous, following, volume = pairs[random.integers(len(pairs))]
        corners = random.integers(0, np.array(previous.shape) - SIDE + 1, (PLACES, 2))
        views = [(..., slice(y, y + SIDE), slice(x, x + SIDE)) for y, x in corners]
        view = max(views, key=lambda view: cv2.norm(previous[view], following[view], cv2.NORM_L1))
        flip = (..., *(slice(None, None, int(step)) for step in random.choice([-1, 1], 2)))
        table = (255 * np.clip(random.uniform(*GAIN) * np.linspace(0, 1, 256) ** random.uniform(*GAMMA), 0, 1)).astype(
            np.uint8)
        return table[previous[view][flip]], table[following[view][flip]], volume[view][flip]

    while True:
        yield tensors([crop() for _ in range(BATCH)])


def flow_of(network: UNet, _: torch.Tensor, volumes: torch.Tensor) -> list[torch.Tensor]:
    return [flow.float() for flow in network(volumes)]


def images_of(network: UNet, previous: torch.Tensor, volumes: torch.Tensor) -> list[torch.Tensor]:
    return [image.float() for image in network(torch.cat([volumes.sum(1, keepdim=True), previous], 1))]


def learn(what: str, pairs: Sequence[Pair], seed: int, steps: int) -> UNet:
    """The "flow" or the "reconstruction" network, in its evaluation mode."""
    torch.manual_seed(seed)
    network, predictions_of = (UNet(2 * recordings.BINS, 2), flow_of) if what == "flow" else (UNet(2, 1), images_of)
    if what == "flow":
        begin_at_rest(network)  # as published, flows begin at random, a dozen pixels long
    optimizer = torch.optim.Adam(network.parameters())
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, RATE, total_steps=steps)
    for _, (previous, following, volumes) in zip(range(steps), batches(pairs, seed)):
        with torch.autocast("cpu", torch.bfloat16, enabled=training.has_bfloat16()):
            predictions = predictions_of(network, previous, volumes)
        if what == "flow":
            photometric, smoothness = flow_losses(previous, following, predictions, volumes.sum(1, keepdim=True) > 0)
            loss = photometric + SMOOTHNESS * smoothness
        else:
            loss = reconstruction_loss(predictions, following)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
    # So few steps leave the batch norms' running means behind the weights: they are taken again.
    for norm in (module for module in network.modules() if isinstance(module, nn.BatchNorm2d)):
        norm.reset_running_stats()
        norm.momentum = None  # the mean of all batches
    with torch.no_grad(), torch.autocast("cpu", torch.bfloat16, enabled=training.has_bfloat16()):
        for _, (previous, _, volumes) in zip(range(min(AGAIN, steps)), batches(pairs, seed)):
            predictions_of(network, previous, volumes)
    return network.eval()


@torch.no_grad()
def predict(networks: dict[str, UNet], pair: Pair) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Of a whole frame the flow in pixels [1, 2, H, W], the previous frame moved by it,
    and the reconstruction of the next one [1, 1, H, W]."""
    previous, _, volume = tensors([pair])
    flow = SIDE * flow_of(networks["flow"], previous, volume)[-1]  # learnt as shares of the crops' sides
    return flow, moved(previous, flow), images_of(networks["reconstruction"], previous, volume)[-1]


def scores_of(pair: Pair, image: torch.Tensor, reconstruction: torch.Tensor) -> dict[str, float]:
    """How far a moved frame is from the next one, in grey levels, at pixels with events;
    and SSIM of a reconstruction with it."""
    _, following, volume = tensors([pair])
    similarity = ssim(reconstruction, following)
    return {"error": 127.5 * error_at_events(image, following, volume), "ssim": float(similarity.mean()),
            "ssim_at_events": float(similarity[volume.sum(1, keepdim=True) > 0].mean())}


def mean_scores(pairs: Sequence[Pair], images: Callable[[Pair], tuple[torch.Tensor, torch.Tensor]]) -> dict[str, float]:
    scores = [scores_of(pair, *images(pair)) for pair in pairs]
    return {name: float(np.mean([each[name] for each in scores])) for name in scores[0]}


def moved_by(previous: torch.Tensor, flow: tuple[float, float]) -> torch.Tensor:
    """`moved` by the same x and y everywhere."""
    flows = torch.tensor(flow, dtype=torch.float32)[None, :, None, None]
    return moved(previous, flows.expand(len(previous), 2, *previous.shape[2:]))


def best_constant_flow(pairs: Sequence[Pair]) -> tuple[float, float]:
    """The x and y in pixels, the same at all pixels of all pairs, by which the previous frames, moved, have the least
    mean error.

    All whole pixels up to 32 are tried, then halves, quarters and eighths of one around the best so far.
    """
    previous, following, _ = tensors(pairs)
    masks = [volume.any(0).astype(np.uint8) for _, _, volume in pairs]
    there = torch.from_numpy(np.stack(masks))[:, None]
    shares = there / there.sum((1, 2, 3), keepdim=True)  # each pair counts the same
    padded = [np.pad(image, FARTHEST, "edge") for image, _, _ in pairs]
    height, width = masks[0].shape

    def error_of_whole(flow: tuple[int, int]) -> float:
        x, y = (FARTHEST + each for each in flow)
        return sum(cv2.norm(image[y:y + height, x:x + width], pair[1], cv2.NORM_L1, mask) / cv2.countNonZero(mask)
                   for image, pair, mask in zip(padded, pairs, masks))

    def error_of(flow: tuple[float, float]) -> float:
        return float(((moved_by(previous, flow) - following).abs() * shares).sum())

    best = min(itertools.product(range(-FARTHEST, FARTHEST + 1), repeat=2), key=error_of_whole)
    for step in (0.5, 0.25, 0.125):
        best = min(itertools.product(*((each - step, each, each + step) for each in best)), key=error_of)
    return best


def blurred(images: torch.Tensor) -> torch.Tensor:
    """[B, 1, H, W] by a Gaussian of 1 pixel."""
    return torch.from_numpy(np.stack([cv2.GaussianBlur(image, (0, 0), 1) for image in images[:, 0].numpy()])[:, None])


# By name a function of a recording's pairs. It returns what makes of the previous frame the one that is scored.
CONTROLS: dict[str, Callable[[Sequence[Pair]], Callable[[torch.Tensor], torch.Tensor]]] = {
    "previous frame as it is": lambda _: lambda previous: previous,
    "previous frame blurred by 1 px": lambda _: blurred,
    "previous frame moved by half a pixel": lambda _: lambda previous: moved_by(previous, (0.5, 0.0)),
    "best constant flow of the recording": lambda pairs: functools.partial(moved_by, flow=best_constant_flow(pairs)),
}


def control_scores(name: str, pairs: Sequence[Pair]) -> dict[str, float]:
    change = CONTROLS[name](pairs)
    return mean_scores(pairs, lambda pair: (change(tensors([pair])[0]),) * 2)


def read_args() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", default="eventgan", help="the eventgan program")
    parser.add_argument("--recordings", required=True, nargs="+", type=pathlib.Path,
                        help="recordings in MVSEC's layout, or folders of such")
    parser.add_argument("--peers", type=pathlib.Path,
                        help="folder with v2e, a checkout of SensorsINI/v2e; without it its rows are left out")
    parser.add_argument("--out", required=True, type=pathlib.Path,
                        help="folder for volumes, networks, results.json, table.csv and images; run the "
                        "same command again to resume")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--steps", type=int, default=400, help="batches that each network learns from")
    parser.add_argument("--with", nargs="*", choices=ROWS, dest="rows", metavar="ROW",
                        help=f"only these rows, of: {'; '.join(ROWS)}; without one only the controls")
    args = parser.parse_args()
    if args.rows is None:
        args.rows = [row for row in ROWS if args.peers or not row.startswith("v2e")]
    args.out = args.out.resolve()
    return args


def halves_of(paths: Iterable[pathlib.Path]) -> tuple[list[pathlib.Path], list[pathlib.Path]]:
    """The recordings in two parts that share no group of names."""
    files = sorted((file for path in paths for file in (path.glob("*.hdf5") if path.is_dir() else [path])),
                   key=lambda file: file.stem)
    groups = sorted({file.stem.split("_")[0] for file in files})
    if len(groups) < 2:
        raise SystemExit(f"expected recordings of at least 2 groups, got {len(groups)}, in {' '.join(map(str, paths))}")
    even, odd = ([file for file in files if groups.index(file.stem.split("_")[0]) % 2 == half] for half in (0, 1))
    return even, odd


def table_of(scores: dict[str, dict[str, list[dict[str, float]]]],
             recording_names: Sequence[str]) -> Iterator[list[str]]:
    """The lines of table.csv. `scores`: by row and recording those of each seed; the first row is the previous frame as
    it is, neither moved nor changed. sd: standard deviation over the seeds. In means each recording counts the same;
    that of the error is of shares of the error without flow."""
    yield ["score", "learnt on", "recording", "value", "sd"]
    for title, name, digits, of_mean in (("error in grey levels", "error", 1, "error as a share of that without flow"),
                                         ("ssim", "ssim", 3, "ssim"),
                                         ("ssim at pixels with events", "ssim_at_events", 3,
                                          "ssim at pixels with events")):
        rows = {row: np.array([[each[name] for each in by_recording[recording]] for recording in recording_names])
                for row, by_recording in scores.items()}
        plain = next(iter(rows.values()))  # [recording, 1]
        for row, values in rows.items():  # [recording, seed]
            means = (values / plain if name == "error" else values).mean(0)
            lines = [(title, *each, digits) for each in zip(recording_names, values)]
            for score, recording, of_seeds, places in (*lines, (of_mean, "mean", means, 3)):
                yield [score, row, recording, f"{of_seeds.mean():.{places}f}",
                       f"{of_seeds.std():.{places}f}" if len(of_seeds) > 1 else ""]


def draw(file: pathlib.Path, pair: Pair, networks: dict[str, dict[str, UNet]]) -> None:
    """A line for each row's networks: the pair's events and frames, the flow,
    the frame moved by it and the reconstruction."""
    previous, following, volume = pair
    positive, negative = np.split(volume.astype(np.float32), 2)
    signed = positive.sum(0) - negative.sum(0)
    limit = np.percentile(np.abs(signed), 99.5)
    grey, polarity = {"cmap": "gray", "vmin": 0,
                      "vmax": int(following.max())}, {"cmap": "bwr_r", "vmin": -limit, "vmax": limit}
    predicted = {row: predict(of_row, pair) for row, of_row in networks.items()}
    there = volume.any(0)
    longest = max(float(np.percentile(flow.norm(dim=1)[0].numpy()[there], 98)) for flow, _, _ in predicted.values())
    height = 3 * previous.shape[0] / previous.shape[1] + 0.6
    figure, axes = pyplot.subplots(len(networks), 6, figsize=(18, height * len(networks)), squeeze=False,
                                   constrained_layout=True)
    for line, (row, (flow, *images)) in zip(axes, predicted.items()):
        scores = scores_of(pair, *images)
        panels = [("real events", signed, polarity), ("previous frame", previous, grey),
                  ("next frame", following, grey),
                  (f"flow learnt on {row}\nfull colour: {longest:.1f} px", in_colour(flow[0].numpy(), longest), {}),
                  (f"previous frame moved by it\nerror {scores['error']:.1f} grey levels",
                   127.5 * (images[0][0, 0] + 1), grey),
                  (f"reconstruction\nSSIM {scores['ssim']:.3f}", 127.5 * (images[1][0, 0] + 1), grey)]
        for ax, (title, image, colours) in zip(line, panels):
            ax.imshow(image, **colours)
            ax.set_title(title, fontsize=10)
            ax.set_axis_off()
    figure.savefig(file, dpi=70)
    pyplot.close(figure)


def load(file: pathlib.Path) -> dict[str, UNet]:
    networks = {"flow": UNet(2 * recordings.BINS, 2), "reconstruction": UNet(2, 1)}
    for what, state in torch.load(file, map_location="cpu").items():  # its own: a pickle, not to be had from others
        networks[what].load_state_dict(state)
        networks[what].eval()
    return networks


def main() -> None:
    args = read_args()
    torch.set_num_threads(int(os.environ.get("OMP_NUM_THREADS") or len(os.sched_getaffinity(0))))
    halves = halves_of(args.recordings)
    (args.out / "networks").mkdir(parents=True, exist_ok=True)
    file = args.out / "results.json"
    require_same(args.out, args.program, {
        "steps": args.steps, "recordings": [{path.stem: path.stat().st_size for path in half} for half in halves]})
    results = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {"runs": {}}
    runs, tests = results["runs"], {path.stem: read_pairs(args, REAL, path) for half in halves for path in half}
    if "controls" not in results:
        results["controls"] = {control: {name: [control_scores(control, pairs)] for name, pairs in tests.items()}
                               for control in CONTROLS}
        write(file, json.dumps(results, indent=1) + "\n")

    def weights(row: str, half: int) -> pathlib.Path:
        return args.out / "networks" / f"{row} {half}.pt".replace(",", "").replace(" ", "-")

    def learn_and_test(row: str, half: int, seed: int) -> dict[str, dict[str, float]]:
        pairs = [pair for path in halves[half] for pair in read_pairs(args, row, path)]
        networks = {what: learn(what, pairs, seed, args.steps) for what in ("flow", "reconstruction")}
        if seed == 0:  # for the images
            torch.save({what: network.state_dict() for what, network in networks.items()}, weights(row, half))
        return {path.stem: mean_scores(tests[path.stem], lambda pair: predict(networks, pair)[1:])
                for path in halves[1 - half]}

    # all rows of a seed first: they can be compared early
    for seed, row, half in itertools.product(range(args.seeds), args.rows, (0, 1)):
        run = f"{row} {half} {seed}"
        if run not in runs:
            runs[run] = learn_and_test(row, half, seed)
            write(file, json.dumps(results, indent=1) + "\n")
            print(run,
                  {name: {key: round(value, 3) for key, value in scores.items()} for name, scores in runs[run].items()},
                  flush=True)
    scores = results["controls"] | {
        row: {path.stem: [runs[f"{row} {half} {seed}"][path.stem] for seed in range(args.seeds)]
              for half in (0, 1) for path in halves[1 - half]} for row in args.rows}
    table = io.StringIO()
    csv.writer(table, lineterminator="\n").writerows(table_of(scores, list(tests)))
    write(args.out / "table.csv", table.getvalue())
    print(table.getvalue())
    for half in (0, 1):
        networks = {row: load(weights(row, half)) for row in args.rows if row in DRAWN}
        for path in halves[1 - half] if networks else []:
            pairs = tests[path.stem]
            draw(args.out / f"{path.stem}.png", pairs[len(pairs) // 2], networks)


if __name__ == "__main__":
    main()
