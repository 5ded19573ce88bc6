"""The scores of `eventgan realism` in NumPy, for volumes that it has not made. v2e.py checks that both agree."""

import numpy as np
import torch

BINS = 9                # per polarity
EVENT_THRESHOLD = 0.01  # as stages/events/realism/realism_scores.h has it


def event_volume(events, size):
    """Rows of t, x, y, polarity as [2 bins, y, x] float32, as stages/events/event_volume.h says. By PyTorch,
    a third of the time of NumPy's bincount."""
    volume = torch.zeros(2 * BINS, *size)
    if len(events):
        events, plane = torch.from_numpy(events), size[0] * size[1]
        times = events[:, 0].double()
        star = ((BINS - 1) * (times - times[0]) / (times[-1] - times[0]) if times[-1] > times[0]
                else torch.zeros_like(times))
        bins = star.long()
        above = (star - bins).float()
        cells = ((events[:, 3] < 0).long() * BINS + bins) * plane + events[:, 2].long() * size[1] + events[:, 1].long()
        volume.view(-1).index_add_(0, cells, 1 - above)
        shared = above > 0
        volume.view(-1).index_add_(0, cells[shared] + plane, above[shared])
    return volume.numpy()


def normalized(counts):
    """Divided by its 98th percentile and clipped, as stages/events/volume_statistics.h says."""
    values = np.sort(counts[counts > 0])
    return np.minimum(counts / values[max(int(0.98 * len(values)), 1) - 1], 1) if len(values) else counts


def f1(values, real):
    here, there = values > EVENT_THRESHOLD, real > EVENT_THRESHOLD
    return 2 * np.sum(here & there) / max(np.sum(here) + np.sum(there), 1)


def pool_mse(difference, side):
    """Of the means of blocks of side x side pixels; one that the border cuts is the mean of what it has."""
    rows, columns = (np.arange(0, extent, side) for extent in difference.shape[1:])
    sums = np.add.reduceat(np.add.reduceat(difference, rows, 1, dtype=np.float64), columns, 2)
    counts = np.outer(*(np.diff(np.append(starts, extent))
                        for starts, extent in zip((rows, columns), difference.shape[1:])))
    return np.mean((sums / counts) ** 2)


def scores(volume, real, previous, following):
    """By their keys in realism's JSON; stages/events/realism/realism_scores.h has the equations. `volume`, `real`: [2
    bins, y, x] float32, from `normalized` or a network; `previous`, `following`: [y, x] uint8."""
    volume = np.minimum(volume, 1)
    sums, real_sums = (one.reshape(2, BINS, *one.shape[1:]).sum(1) for one in (volume, real))
    late = np.linspace(0.1, 1, BINS)[:, None, None]

    def mean_times(one, its_sums):
        weighted = (one.reshape(2, BINS, *one.shape[1:]) * late).sum(1) / (its_sums + 1e-5)
        return np.where(its_sums > EVENT_THRESHOLD, weighted, 0).ravel()

    change = np.log((following + 1.0) / (previous + 1.0))
    return {
        "f1_raw": f1(volume, real), "f1_time": f1(sums, real_sums),
        "f1_time_polarity": f1(sums.sum(0), real_sums.sum(0)),
        "pool_mse_2": pool_mse(volume - real, 2), "pool_mse_4": pool_mse(volume - real, 4),
        "time_correlation": np.corrcoef(mean_times(volume, sums), mean_times(real, real_sums))[0, 1],
        "polarity_correlation": np.corrcoef((sums[0] - sums[1]).ravel(), change.ravel())[0, 1],
        "events_per_pixel": sums.sum(dtype=np.float64) / change.size,
        "positive_share": sums[0].sum(dtype=np.float64) / sums.sum(dtype=np.float64),
    }
