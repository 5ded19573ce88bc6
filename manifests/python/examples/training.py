"""What the examples share: options, which samples are for training and which for validation,
the loop with its checkpoint, images."""

from __future__ import annotations

import argparse
import functools
import hashlib
import importlib
import json
import math
import os
import pathlib
import shlex
import sys
import time
import types
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import cv2
import numpy as np
import torch
from torch import nn
from torch.utils.data import DataLoader, Dataset

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1]))  # the package, if it is not installed

import eventgan
from eventgan import Sample, Shards, drawing, read_description
from eventgan.detection_scores import Detections, GroundTruth, detection_scores
from eventgan.shard_folder import DESCRIPTION, PLAN
from eventgan.torch import DetectionDataset, fitted, inverse, mixture, move_boxes

VALIDATION_SPLITS = ("validation", "valid", "val", "test")
GROUPS = ("subject", "sequence", "sample_id")  # what Shards.divide keeps together, the most first
MAY_CHANGE = {"out", "data", "trainer", "epochs", "steps", "minutes", "device", "threads", "workers", "images", "every",
              "test", "as_bright", "without_noise", "defaults"}  # when a run goes on

LEAST = {"epochs": 1, "steps": 0, "every": 1, "batch": 1, "threads": 0, "workers": 0, "images": 0, "rotation": 0}
ABOVE_0 = ("minutes", "lr", "sigma", "scale")
MOST_SCALE = 16  # 256 times a camera's pixels
TUNING_STEPS, TUNING_RATE = 200, 0.25  # the latter a share of the learning rate


def options(description: str, **defaults: Any) -> argparse.ArgumentParser:
    """The options of all examples that train on shards."""
    parser = options_of_any(description, "folder that eventgan convert has completed", **defaults)
    parser.add_argument("--dataset", help="use only samples of this kind of source, such as kitti_object")
    parser.add_argument("--test", help="folder of shards whose labelled samples (of its validation split, if it has "
                        "one) are predicted at the end, into predictions.json; default: the validation samples")
    parser.add_argument("--as-bright", action="store_true",
                        help="scale the volumes of predictions.json by one factor to the mean of the training samples, "
                        "and clip them at 1: a camera's are often fainter than generated ones, which have fewer zeros")
    parser.add_argument("--without-noise", action="store_true",
                        help="drop isolated events from the volumes of predictions.json: pixels with events that "
                        "have fewer than two such neighbours")
    parser.add_argument("--frames", action="store_true",
                        help="train on the labelled frames instead of events, grey in the first channel; "
                        "their paths come from the shards (next_path)")
    parser.add_argument("--overfit", action="store_true",
                        help="validate on the training samples, to see whether the network can fit them")
    return parser


def options_of_any(description: str, data: str, steps: int | None = None, **defaults: Any) -> argparse.ArgumentParser:
    """The options that all examples have, of which --data is `data`. The first limit that is reached ends the
    training; if none is given, so many `steps` do, None: 30 minutes."""
    otherwise = " (default: {} if there is no other limit)"
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--data", required=True, help=data)
    parser.add_argument("--out", required=True, help="folder for checkpoint, weights, metrics.json and images; run the "
                        "same command again to resume")
    parser.add_argument("--epochs", type=int, help="stop after this many epochs")
    parser.add_argument("--steps", type=int,
                        help="stop after this many batches" + (otherwise.format(steps) if steps else ""))
    parser.add_argument("--minutes", type=float, help="stop after this much training time, without validation"
                        + ("" if steps else otherwise.format(30)))
    parser.add_argument("--every", type=int, help="validate every so many epochs, and at the end (default: 1; with a "
                        "limit in epochs or steps so many that it is done about 20 times)")
    parser.add_argument("--batch", type=int)
    parser.add_argument("--lr", type=float,
                        help="peak learning rate: it rises during the first 5 %% and decays to 1 %% along a cosine")
    parser.add_argument("--pretrained",
                        help=".pt file of initial weights; layers that do not fit are initialised at random")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--device", default="cpu", help="cpu or cuda")
    parser.add_argument("--threads", type=int, help="number of threads (default: all cores)")
    parser.add_argument("--workers", type=int, default=0, help="processes that read samples")
    parser.add_argument("--images", type=int, default=6)
    parser.set_defaults(unlimited=("steps", steps) if steps else ("minutes", 30.0), **defaults)
    return parser


def begin(parser: argparse.ArgumentParser) -> argparse.Namespace:
    args = parser.parse_args()
    given = {name: value for name, value in vars(args).items() if value is not None}
    for name, least in LEAST.items():
        if name in given and not least <= given[name] < math.inf:
            sys.exit(f"expected --{name} of at least {least}, got {given[name]}")
    if given.get("steps") == 0 and not given.get("pretrained"):
        sys.exit("expected --pretrained weights, since --steps is 0, got none")
    if given.get("last_layer") and not given.get("pretrained"):
        sys.exit("expected --pretrained weights, since only the last layer is trained (--last-layer), got none")
    for name in ABOVE_0:
        if name in given and not 0 < given[name] < math.inf:
            sys.exit(f"expected --{name} above 0 and finite, got {given[name]:g}")
    if given.get("scale", 1) > MOST_SCALE:
        sys.exit(f"expected --scale of at most {MOST_SCALE}, got {given['scale']:g}")
    classes = [name for name in (given.get("classes") or "").split(",") if name]
    twice = [name for name in classes if classes.count(name) > 1]
    if twice:
        sys.exit(f"expected different names in --classes, got {twice[0]} twice")
    shards = [name for name in (PLAN, DESCRIPTION) if pathlib.Path(args.out, name).exists()]
    if shards:
        sys.exit(f"expected a folder of its own for --out, got one of shards, with {shards[0]}, in {args.out}")
    args.defaults = {name: parser.get_default(name) for name in vars(args)}
    name, value = vars(args).pop("unlimited")
    if args.epochs is None and args.steps is None and args.minutes is None:
        setattr(args, name, value)
    if args.device == "cuda" and not torch.cuda.is_available():
        sys.exit("expected a CUDA device, got none, in --device cuda")
    # Debian's PyTorch begins with one thread.
    torch.set_num_threads(args.threads or int(os.environ.get("OMP_NUM_THREADS") or len(os.sched_getaffinity(0))))
    torch.manual_seed(args.seed)
    pathlib.Path(args.out).mkdir(parents=True, exist_ok=True)
    return args


def has_bfloat16() -> bool:
    """Whether the processor computes in bfloat16; one that does not is slower in it than in float32."""
    return "avx512_bf16" in pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8")


def use_trainer(folder: str, *modules: str) -> pathlib.Path:
    """Puts the trainer's folder of modules first on the path, and stand-ins that keep nothing in place of the
    TensorBoards that its modules ask for, if they are not installed."""
    path = pathlib.Path(folder).resolve()
    for module in modules:
        if not (path / module).exists():
            sys.exit(f"expected the trainer's {module}, got none, in {path}")
    first = path / modules[0]
    sys.path.insert(0, str(first.parent))
    for name in ("torch.utils.tensorboard", "tensorboardX"):
        try:
            importlib.import_module(name)
        except (ImportError, AttributeError):  # AttributeError: an old PyTorch with new setuptools
            sys.modules[name] = types.ModuleType(name)
            sys.modules[name].SummaryWriter = _NoWriter
    return path


class _NoWriter:
    """In place of a SummaryWriter: takes everything and keeps nothing."""

    def __init__(self, *_: Any, **__: Any) -> None:
        pass

    def __getattr__(self, name: str) -> Callable[..., None]:
        return lambda *_, **__: None


def validation_split(description: dict[str, Any]) -> str | None:
    """The folder's validation split, of its dataset.json; None if it has none."""
    return next((name for name in VALIDATION_SPLITS if name in description["counts"]["by_split"]), None)


def with_boxes(shards: Shards) -> list[int]:
    """The positions of the samples of sources with boxes."""
    return [i for i in range(len(shards)) if shards.class_names(i)]


def _split_apart(args: argparse.Namespace, description: dict[str, Any]) -> str | None:
    """The validation split of a folder that has one for training, too; None: its samples are to be divided."""
    has_both = "train" in description["counts"]["by_split"] and not args.overfit
    return validation_split(description) if has_both else None


def divided(args: argparse.Namespace, usable: Callable[[Shards], Iterable[int]]) -> tuple[Shards, Shards]:
    """The training samples and the validation samples, of which `usable` gives the positions of those with labels: by
    the folder's splits if it has both, else four fifths and one fifth that share no subject, drive, sequence, or at
    least no labelled frame."""
    where = {"dataset": args.dataset} if args.dataset else None
    try:
        description = read_description(args.data)
        validation = _split_apart(args, description)
        if validation:
            parts, how = [Shards(args.data, split=split, where=where, partial=True)
                          for split in ("train", validation)], f"of split {validation}"
            parts = [part[list(usable(part))] for part in parts]
        else:
            shards = Shards(args.data, where=where, partial=True)
            shards = shards[list(usable(shards))]
            by = next((by for by in GROUPS if _divides(shards, by)), None)
            if by is None and len(shards) and not args.overfit:
                sys.exit("expected two labelled frames or more, for training and for validation, got one, in "
                         f"{args.data} (--overfit validates on the training samples)")
            parts, how = (([shards, shards], "the same") if args.overfit or not len(shards)
                          else (shards.divide(0.8, by, args.seed), f"of other {_groups_named(shards, by)}"))
    except FileNotFoundError as error:
        sys.exit(f"expected a folder that eventgan convert or finalize has completed, got no {error.filename}")
    except ValueError as error:
        sys.exit(str(error))
    if not len(parts[0]) or not len(parts[1]):
        of_dataset = f"--dataset {args.dataset}; " if args.dataset else ""
        sys.exit(f"expected labelled samples for training and validation, got {len(parts[0])} and {len(parts[1])}, in "
                 f"{args.data} ({of_dataset}it has samples of {', '.join(description['counts']['by_dataset'])})")
    if description.get("missing"):
        print(f"{len(description['missing'])} shards are missing in {args.data} (finalize --partial)")
    if "limit" in description["fingerprint"]:
        print(f"warning: {args.data} is a trial of its job (--limit {description['fingerprint']['limit']})",
              file=sys.stderr)
    if description["quarantined"]:
        print(f"{len(description['quarantined'])} quarantined samples are left out")
    print(f"{len(parts[0])} samples for training, {len(parts[1])} for validation, {how}")
    train_shards, validation_shards = (part.changed(labelled_frame) if args.frames else part for part in parts)
    return train_shards, validation_shards


def tested(args: argparse.Namespace, train_shards: Shards, validation_shards: Shards,
           usable: Callable[[Shards], Iterable[int]]) -> Shards:
    """The samples that predictions.json is of, changed as the options say."""
    shards = _to_test(args, validation_shards, usable)
    if args.without_noise:
        shards = shards.changed(without_noise)
    if args.as_bright:
        factor = _mean(train_shards) / _mean(shards)
        print(f"the volumes of {args.test or args.data} are scaled by {factor:.2f}, to the brightness of those of "
              f"{args.data}")
        shards = shards.changed(functools.partial(_brighter, factor=factor))
    return shards


def _part_tested(args: argparse.Namespace) -> tuple[str | None, str | None]:
    """The split and the kind of source of which `tested` has samples; None: any."""
    description = read_description(args.test or args.data)
    split = validation_split(description) if args.test else _split_apart(args, description)
    return split, args.dataset if args.dataset in description["counts"]["by_dataset"] else None


def _to_test(args: argparse.Namespace, validation_shards: Shards, usable: Callable[[Shards], Iterable[int]]) -> Shards:
    if not args.test:
        return validation_shards
    try:
        split, dataset = _part_tested(args)
        shards = Shards(args.test, split=split, where={"dataset": dataset} if dataset else None, partial=True)
        shards = shards[list(usable(shards))]
    except (OSError, ValueError) as error:
        sys.exit(str(error))
    return shards.changed(labelled_frame) if args.frames else shards


def detection_test(args: argparse.Namespace, shards: Shards, classes: Sequence[str], size: tuple[int, int],
                   view: np.ndarray) -> tuple[DetectionDataset, np.ndarray]:
    """What `tested` gives as items of that size, and their view: that of the training, but for a dataset of its own,
    whose images have another size: then the one that fits all of them. It need not have all classes."""
    if args.test:
        view = fitted(shards.image_area(), size)
    return items_of(shards, classes, size, view), view


def items_of(shards: Shards, classes: Sequence[str], size: tuple[int, int], view: np.ndarray) -> DetectionDataset:
    """Items with those of the classes that the shards know, by the numbers that all of them have."""
    known = {name: i for i, name in enumerate(classes) if name in shards.known_classes()}
    return DetectionDataset(shards, known or classes, size, view=view)


def add_tune(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--last-layer", action="store_true", help="train only the last layer, with --pretrained")
    parser.add_argument("--tune", help="folder of shards of your camera's labelled recordings, to go on with once the "
                        f"training has ended: {TUNING_STEPS} steps, in which they are drawn as often as the samples of "
                        "--data; into OUT/tuned (from the weights of --pretrained alone: --steps 0)")


def tuned_on(args: argparse.Namespace, usable: Callable[[Shards], Iterable[int]], tested_shards: Shards) -> Shards:
    """The labelled samples of --tune, of its split train if it has one for validation, too; warns of recordings that
    are tested on, too."""
    try:
        split = "train" if validation_split(read_description(args.tune)) else None
        shards = Shards(args.tune, split=split, partial=True)
        shards = shards[list(usable(shards))]
    except (OSError, ValueError) as error:
        sys.exit(str(error))
    if not len(shards):
        sys.exit(f"expected labelled samples to tune on, got none, in {args.tune}")
    both = sorted({*_frames(shards)} & {*_frames(tested_shards)})
    if both:
        print(f"warning: --tune and {'--test' if args.test else '--data'} share {both[0]}"
              f"{' and others' * (len(both) > 1)}: the score says nothing of other recordings", file=sys.stderr)
    return shards.changed(labelled_frame) if args.frames else shards


def _frames(shards: Shards) -> list[str]:
    return [frame_path(shards.sample(i, {"pair"})) for i in range(len(shards))]


def untuned(args: argparse.Namespace) -> argparse.Namespace:
    """The options of the training before."""
    return argparse.Namespace(**{**vars(args), "tune": None})


def tuning(args: argparse.Namespace, samples: int) -> argparse.Namespace:
    """The options of the training on so many --tune samples that follows: it begins with the weights of the other,
    and anew where these have learnt more since."""
    out = pathlib.Path(args.out)
    (out / "tuned").mkdir(exist_ok=True)
    base = hashlib.sha256((out / "weights.pt").read_bytes()).hexdigest()[:16]
    checkpoint = out / "tuned" / "checkpoint.pt"
    if checkpoint.exists() and _checkpoint(checkpoint)["settings"].get("base") != base:
        print(f"{out / 'tuned'}: anew, since the weights before are other ones")
        checkpoint.unlink()
    plan = read_description(args.tune)["plan_hash"]
    return argparse.Namespace(**{**vars(args), "out": str(out / "tuned"), "base": base,
                                 "tune": f"{samples} samples of plan {plan[:8]}",
                                 "pretrained": str(out / "weights.pt"), "lr": args.lr * TUNING_RATE,
                                 "steps": TUNING_STEPS, "epochs": None, "minutes": None})


def _mean(shards: Shards) -> float:
    return float(np.mean([shards.sample(i, {"volume"})["volume"].mean() for i in range(len(shards))]))


def _brighter(sample: Sample, factor: float) -> np.ndarray:
    return np.minimum(factor * sample["volume"], 1)


def without_noise(sample: Sample) -> np.ndarray:
    """The volume without what stands alone: pixels with events that have fewer than two such neighbours."""
    volume = sample["volume"]
    there = (volume > 0).any(0).astype(np.float32)
    return volume * (cv2.filter2D(there, -1, np.ones((3, 3), np.float32), borderType=cv2.BORDER_CONSTANT) > 2)


def place_of(sample: Sample) -> tuple[int, int, int, int]:
    """Where the whole image lies in the volume, in whole pixels: left, top, width, height. Of a still its borders,
    which are cut, lie outside the volume, or outside what a letterbox shows."""
    (scale_x, _, x), (_, scale_y, y) = sample["pair"]["source_to_volume"]
    height, width = sample["pair"]["source_size"]
    return round(x - scale_x / 2 + 0.5), round(y - scale_y / 2 + 0.5), round(width * scale_x), round(height * scale_y)


def placed(sample: Sample, image: np.ndarray) -> np.ndarray:
    """[H, W] float32: an image of the size of the sample's source, grey, where it lies in the volume,
    and 0 around it."""
    result = np.zeros(sample["volume"].shape[1:], np.float32)
    left, top, width, height = place_of(sample)
    whole = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    seen = whole[max(0, -top):, max(0, -left):][:result.shape[0] - max(0, top), :result.shape[1] - max(0, left)]
    result[max(0, top):, max(0, left):][:seen.shape[0], :seen.shape[1]] = seen
    return result


def frame_path(sample: Sample, side: str = "next") -> str:
    """The file of a frame, "prev" or "next". A relative path begins at the manifest's folder, which run.json beside the
    shard names, or else at the shard's."""
    folder = pathlib.Path(sample["shard"]).parent
    try:
        run = json.loads((folder / "run.json").read_bytes())
        named = pathlib.Path(run.get("manifest_folder") or os.fsdecode(bytes(run["manifest_folder_bytes"])))
        folder = named if named.is_absolute() else folder
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        pass
    return str(folder / sample["pair"][f"{side}_path"])


def labelled_image(sample: Sample) -> np.ndarray:
    """The labelled frame as it was read, uint8 grey [H, W]. It must be an image at the pair's end."""
    pair, path = sample["pair"], frame_path(sample)
    image = cv2.imread(path, cv2.IMREAD_GRAYSCALE) if pair["label_position"] == 1 else None
    if image is None:
        raise ValueError(f"expected an image, of a pair with the label at its end, got none, in {path} "
                         f"(sample {pair['sample_id']})")
    return image


def labelled_frame(sample: Sample) -> np.ndarray:
    """In place of the volume: the labelled frame, grey from 0 to 1, in the first channel."""
    volume = np.zeros_like(sample["volume"])
    volume[0] = placed(sample, labelled_image(sample)) / 255
    return volume


def _groups_named(shards: Shards, by: str) -> str:
    """What each of groups(by) is: of single photographs an image, whatever they are divided by."""
    alone = len(set(shards.groups(by).tolist())) == len(set(shards.groups("sample_id").tolist()))
    return "images" if alone else f"{by}s"


def _divides(shards: Shards, by: str) -> bool:
    try:
        return len(set(shards.groups(by).tolist())) > 1 and (by != "subject"
                                                             or len({*shards.column(by).tolist()} - {""}) > 1)
    except ValueError:  # no shard has it
        return False


def batches(args: argparse.Namespace, dataset: Dataset, collate: Callable | None = None,
            shuffle: bool = False, tuned: Dataset | None = None) -> DataLoader:
    """`tuned`: a second dataset, from which as much is drawn as from the first one, however small it is."""
    dataset, sampler = mixture((dataset, tuned), (1, 1)) if tuned else (dataset, None)
    return DataLoader(dataset, args.batch, shuffle=shuffle and not sampler, sampler=sampler, num_workers=args.workers,
                      collate_fn=collate, persistent_workers=args.workers > 0)


def _loaded(path: str | pathlib.Path, expected: str, advice: str = "", **options: Any) -> Any:
    """What torch.save has written, on the CPU. A file that cannot be read ends the program in a line."""
    try:
        return torch.load(path, map_location="cpu", **options)
    except Exception as error:  # each kind of damage has its own
        reason = f"{type(error).__name__}: {error}".splitlines()[0]
        sys.exit(f"expected {expected}, got one that cannot be read ({reason}), in {path}{advice}")


def _checkpoint(path: pathlib.Path) -> dict[str, Any]:
    """A training's own: a pickle, not to be had from others."""
    return _loaded(path, "a whole checkpoint", " (remove it to start again)")


def load_fitting(model: nn.Module, path: str | None) -> None:
    """Takes over those weights of the file that have the name and shape of one of the model's."""
    if not path:
        return
    # runs nothing that the file holds
    weights = _loaded(path, "a .pt file that contains only tensors", weights_only=True)
    weights = weights if isinstance(weights, dict) else {}
    weights = next((weights[key] for key in ("model", "state_dict") if key in weights), weights)
    own = model.state_dict()
    fitting = {name: value for name, value in weights.items() if name in own and own[name].shape == value.shape}
    if not fitting:
        sys.exit(f"expected weights that fit the model, such as {next(iter(own))}, got none, in {path}")
    model.load_state_dict(fitting, strict=False)
    others = [name for name in own if name not in fitting]
    print(f"{len(fitting)} of the model's {len(own)} tensors loaded from {path}"
          + (f", others begin anew, such as {others[0]}" if others else ""))


def fit(args: argparse.Namespace, model: nn.Module, optimizer: torch.optim.Optimizer, loader: DataLoader,
        loss_of: Callable[[Any, float], torch.Tensor], check: Callable[[], dict[str, float]], metric: str) -> None:
    """Trains up to the limits, from the checkpoint if there is one. loss_of(batch, progress): the loss, progress 0..1
    of the way to the nearest limit. check(): the numbers to report, `metric` among them; asked before the first step
    and after each epoch (each --every). Minutes are those of the steps, here and in metrics.json."""
    out = pathlib.Path(args.out)
    may_change = MAY_CHANGE | ({"pretrained"} if "base" in args else set())  # of tuning, OUT's own
    settings = {name: value for name, value in vars(args).items() if name not in may_change}
    state: dict[str, Any] = {"settings": settings, "epoch": 0, "step": 0, "seconds": 0.0, "history": []}
    if (out / "checkpoint.pt").exists():
        state = _checkpoint(out / "checkpoint.pt")
        # of an option that there was not, its default
        state["settings"] = {**{name: getattr(args, "defaults", {}).get(name) for name in settings},
                             **state["settings"]}
        for name, value in settings.items():
            before = state["settings"][name]
            if before != value:
                option = f"no --{name}" if before is None else f"--{name} {before}"
                sys.exit(f"expected {option}, as when this run started, got {value}, in {out / 'checkpoint.pt'}")
        if args.steps == 0 and state["step"]:
            sys.exit(f"expected --out without a training, since --steps is 0, got {state['step']} steps, in "
                     f"{out / 'checkpoint.pt'}")
        model.load_state_dict(state["model"])
        optimizer.load_state_dict(state["optimizer"])
        print(f"resuming after epoch {state['epoch']}")
    for group in optimizer.param_groups:
        group.setdefault("initial_lr", group["lr"])
    began = time.monotonic()
    steps = min(math.inf if args.steps is None else args.steps,
                math.inf if args.epochs is None else args.epochs * len(loader))
    every = args.every or (1 if math.isinf(steps) else max(1, math.ceil(steps / (20 * len(loader)))))

    def progress() -> float:
        minutes = (state["seconds"] + time.monotonic() - began) / 60
        return max(state["step"] / steps if steps else 1, 0 if args.minutes is None else minutes / args.minutes)

    def report(loss: float | None) -> None:
        model.eval()
        with torch.no_grad():
            found = check()
        row = {"epoch": state["epoch"], "step": state["step"], "minutes": round(state["seconds"] / 60, 2), "loss": loss,
               **found}
        state["history"].append({name: None if value is None or math.isnan(value) else value
                                 for name, value in row.items()})
        numbers = " ".join(f"{name} {value:.4g}" for name, value in state["history"][-1].items() if value is not None
                           and name not in ("epoch", "step"))
        print(f"epoch {row['epoch']:3} step {row['step']:5} {numbers}" + ("" if row["step"] else "  (untrained)"),
              flush=True)

    if not state["history"]:
        report(None)
        began = time.monotonic()
    set_epoch = getattr(getattr(loader, "dataset", None), "set_epoch", lambda epoch: None)  # FramePairs has one
    done = progress() >= 1
    while not done:
        state["epoch"] += 1
        # what an epoch draws does not depend on where a run went on
        torch.manual_seed(args.seed * 1_000_003 + state["epoch"])
        set_epoch(state["epoch"])
        model.train()
        losses = []
        for batch in loader:
            at = progress()
            for group in optimizer.param_groups:
                group["lr"] = group["initial_lr"] * min(at / 0.05 + 0.01,
                                                        1) * (0.505 + 0.495 * math.cos(math.pi * min(at, 1)))
            loss = loss_of(batch, at)
            if not torch.isfinite(loss):
                sys.exit(f"expected a finite loss, got {loss.item()}, at step {state['step']} (try a smaller --lr)")
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(model.parameters(), 10)
            optimizer.step()
            losses.append(loss.item())
            state["step"] += 1
            if progress() >= 1:
                break
        done = progress() >= 1
        if state["epoch"] % every and not done:
            continue
        state["seconds"] += time.monotonic() - began
        report(float(np.mean(losses)))
        replace(out / "checkpoint.pt",
                 lambda path: torch.save({**state, "model": model.state_dict(), "optimizer": optimizer.state_dict()},
                                         path))
        began = time.monotonic()
    model.eval()
    untrained, last = state["history"][0][metric], state["history"][-1][metric]
    summary = {"metric": metric, "untrained": untrained, metric: last, "minutes": round(state["seconds"] / 60, 2),
               **state["settings"], "history": state["history"]}
    replace(out / "weights.pt", lambda path: torch.save(model.state_dict(), path))
    replace(out / "metrics.json", lambda path: path.write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8"))
    first, final = ("none" if value is None else f"{value:.4g}" for value in (untrained, last))
    print(f"{metric} {final} after {summary['minutes']} minutes, untrained {first}; {out}: weights.pt, metrics.json, "
          "images/")


def replace(path: pathlib.Path, write: Callable[[pathlib.Path], Any]) -> None:
    new = path.with_name(path.name + ".new")
    write(new)
    os.replace(new, path)


def average_precisions(pairs: Iterable[tuple[dict, tuple[torch.Tensor, torch.Tensor, torch.Tensor]]],
                       classes: Sequence[str]) -> dict[str, float]:
    """AP@0.5 of each class, as PASCAL VOC has it, of items of DetectionDataset, each with what was found in it:
    boxes [n, 4], labels [n], scores [n]."""
    found, truth = [], []
    for image, (item, columns) in enumerate(pairs):
        boxes, labels, scores = (column.numpy() for column in columns)
        found.append((np.full(len(boxes), image), labels, boxes, scores))
        there, labels, ignore = (item[name].numpy() for name in ("boxes", "labels", "ignore"))
        truth.append((np.full(len(there), image), labels, there, ignore, np.full(len(there), -1)))
    found, truth = Detections.of(*map(np.concatenate, zip(*found))), GroundTruth(*map(np.concatenate, zip(*truth)))
    scores = detection_scores(found, truth, {name: i for i, name in enumerate(classes)})
    return {f"AP50 {name}": scores[name]["ap_voc"] for name in classes}


def box_predictions(item: dict, found: tuple[torch.Tensor, torch.Tensor, torch.Tensor], classes: Sequence[str],
                    view: np.ndarray) -> list[dict]:
    """What was found in an item of DetectionDataset, as in `average_precisions`, for predictions.json;
    `view` is the dataset's."""
    boxes, labels, scores = (column.numpy() for column in found)
    boxes = move_boxes(boxes, inverse(view))
    boxes[:, 2:] -= boxes[:, :2]
    return [{"image_id": item["id"], "category_id": classes[int(label)], "bbox": box, "score": score}
            for box, label, score in zip(boxes.tolist(), labels, scores.tolist())]


def require_own_ids(args: argparse.Namespace, shards: Shards) -> None:
    """Ends the program where two of the samples share an id, by which predictions.npz has what was found."""
    names = shards.column("sample_id").tolist()
    twice = [name for name in names if names.count(name) > 1] if len(set(names)) < len(names) else []
    if twice:
        sys.exit(f"expected samples with ids of their own, got {twice[0]!r}, which two samples have, in "
                 f"{args.test or args.data}")


def write_predictions(args: argparse.Namespace, shards: Shards, entries: Iterable, what: str = "detections") -> None:
    """predictions.json of the samples, ids.txt, which names these, and the line that scores them. `entries`: objects;
    of "flows" the samples' ids with flow [2, H, W], for predictions.npz."""
    def write(path: pathlib.Path) -> None:
        with torch.no_grad(), open(path, "wb") as file:
            if what == "flows":
                np.savez_compressed(file, **dict(entries))
            else:
                file.write((json.dumps(list(entries)) + "\n").encode())

    name = "predictions.npz" if what == "flows" else "predictions.json"
    names = shards.column("sample_id").tolist()
    ids = "".join(f"{each}\n" for each in names)
    replace(pathlib.Path(args.out, name), write)
    replace(pathlib.Path(args.out, "ids.txt"), lambda path: path.write_text(ids, encoding="utf-8"))
    place = pathlib.Path(eventgan.__file__).parents[1]
    path = "" if place.name.endswith("-packages") else f"PYTHONPATH={shlex.quote(str(place))} "
    options = {"--truth": args.test or args.data, "--ids": f"{args.out}/ids.txt"}
    options |= zip(("--split", "--dataset"), _part_tested(args))
    if getattr(args, "classes", None):
        options["--classes"] = ",".join(name for name in args.classes.split(",") if name in shards.known_classes())
    line = [sys.executable, "-m", "eventgan.evaluate", what, f"{args.out}/{name}",
            *(word for option in options.items() if option[1] for word in option)]
    print(f"to score what was found in {args.test or 'the validation samples'}: {path}"
          f"{shlex.join(line + (['--hidden'] if what == 'poses' else []))}")


def draw_item(item: dict, found: torch.Tensor, texts: Iterable[str]) -> np.ndarray:
    """The item's volume, or its signed channel, with its boxes, and those that were found [n, 4] with their texts."""
    volume = item["volume"].numpy()
    canvas = drawing.of_events(np.concatenate([volume, -volume]).clip(0) if len(volume) == 1 else volume)
    drawing.draw_boxes(canvas, item["boxes"][item["ignore"]], drawing.IGNORED)
    drawing.draw_boxes(canvas, item["boxes"][~item["ignore"]], drawing.TRUE)
    drawing.draw_boxes(canvas, found, drawing.FOUND, texts)
    return canvas


def write_images(args: argparse.Namespace, count: int, image_of: Callable[[int], tuple[str, np.ndarray]]) -> None:
    """image_of(i) for some of `count` items, evenly spread: a name, and what to write under it."""
    with torch.no_grad():
        for i in np.unique(np.linspace(0, count - 1, args.images).round().astype(int)).tolist() if args.images else ():
            drawing.write(pathlib.Path(args.out, "images"), *image_of(i))
