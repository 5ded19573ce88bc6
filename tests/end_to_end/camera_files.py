"""Recordings of event cameras in the layouts of their datasets, small and made up."""

import h5py
import numpy as np
import scipy.io

HEIGHT, WIDTH = 24, 32


def random_events(count, begin, end, seed, height=HEIGHT, width=WIDTH):
    """[count, 4] float64: x, y, t in seconds, p = -1 or +1; times ascend."""
    random = np.random.default_rng(seed)
    return np.stack([random.integers(0, width, count), random.integers(0, height, count),
                     np.sort(random.uniform(begin, end, count)),
                     random.choice([-1, 1], count)], axis=1).astype(np.float64)


def write_mvsec(path, events, frame_times):
    """MVSEC's layout, its left camera."""
    path.parent.mkdir(parents=True, exist_ok=True)
    frames = np.random.default_rng(1).integers(0, 256, (len(frame_times), HEIGHT, WIDTH), dtype=np.uint8)
    with h5py.File(path, "w") as file:
        file["davis/left/events"] = events
        file["davis/left/image_raw"] = frames
        file["davis/left/image_raw_ts"] = np.asarray(frame_times, np.float64)


def whole_microseconds(events):
    """The same rows with times of whole microseconds, and these times."""
    ticks = np.round(events[:, 2] * 1e6).astype(np.int64)
    rounded = events.copy()
    rounded[:, 2] = ticks / 1e6
    return rounded, ticks


def write_columns(path, events, group="events", index="ms_to_idx", offset=None, size=None, **filters):
    """Events as DSEC and M3ED have them, a dataset a column; `size`: of RVT's files, height and width."""
    path.parent.mkdir(parents=True, exist_ok=True)
    ticks = whole_microseconds(events)[1] - (offset or 0)
    with h5py.File(path, "w") as file:
        for name, values in {"x": events[:, 0].astype(np.uint16), "y": events[:, 1].astype(np.uint16),
                             "t": ticks.astype(np.int64 if size or group != "events" else np.uint32),
                             "p": (events[:, 3] > 0).astype(np.uint8)}.items():
            file.create_dataset(f"{group}/{name}", data=values, chunks=(min(1000, len(values)),), **filters)
        if size:
            file["events/height"], file["events/width"] = size
            return
        ms = np.arange(0, ticks[-1] // 1000 + 1) * 1000
        file[index] = np.searchsorted(ticks, ms).astype(np.uint64)
        if offset is not None:
            file["t_offset"] = np.int64(offset)


def write_v2e(path, events, frames=None, frame_times=()):
    """v2e's --dvs_h5: rows grow a frame at a time, and frames are there if it was told to keep them."""
    ticks = whole_microseconds(events)[1]
    rows = np.stack([ticks, events[:, 0], events[:, 1], events[:, 3] > 0], 1).astype(np.uint32)
    with h5py.File(path, "w") as file:
        table = file.create_dataset(name="events", shape=(0, 4), maxshape=(None, 4), dtype="uint32",
                                    compression="gzip")
        for part in np.array_split(rows, 7):
            table.resize(table.shape[0] + len(part), axis=0)
            table[-len(part):] = part
        if frames is not None:
            file.create_dataset("frame", data=frames, dtype="uint8", compression="gzip")
            file.create_dataset("frame_ts", data=np.round(np.asarray(frame_times) * 1e6).astype(np.uint32),
                                dtype="uint32", compression="gzip")
            file.create_dataset("frame_idx", data=np.searchsorted(events[:, 2], frame_times).astype(np.uint64),
                                dtype="uint64", compression="gzip")


def write_event_utils(path, events, images=(), image_times=(), resolution=(HEIGHT, WIDTH), polarity=np.bool_):
    """event_utils' hdf5_packager: columns that grow, an image a dataset with its time as an attribute."""
    with h5py.File(path, "w") as file:
        columns = {"xs": (events[:, 0], np.int16), "ys": (events[:, 1], np.int16), "ts": (events[:, 2], np.float64),
                   "ps": (events[:, 3] > 0, polarity)}
        for name, (values, kind) in columns.items():
            column = file.create_dataset(f"events/{name}", (0,), dtype=np.dtype(kind), maxshape=(None,), chunks=True)
            column.resize(len(values), axis=0)
            column[-len(values):] = values.astype(kind)
        for k, (image, time) in enumerate(zip(images, image_times)):
            dataset = file.create_dataset(f"images/image{k:09d}", data=image, dtype=np.uint8)
            dataset.attrs["size"] = image.shape
            dataset.attrs["timestamp"] = time
            dataset.attrs["type"] = "greyscale" if image.ndim == 2 else "color_bgr"
            dataset.attrs["event_idx"] = max(np.searchsorted(events[:, 2], time) - 1, 0)
        file.attrs["num_events"] = len(events)
        file.attrs["t0"], file.attrs["tk"] = events[0, 2], events[-1, 2]
        file.attrs["sensor_resolution"] = resolution


def write_dat(path, events, size=(HEIGHT, WIDTH)):
    """Prophesee's DAT of version 2."""
    x, y, positive = (events[:, column].astype(int) for column in (0, 1, 3))
    header = f"% Data file containing CD events\n% Version 2\n% Height {size[0]}\n% Width {size[1]}\n".encode()
    words = np.stack([whole_microseconds(events)[1], x | y << 14 | (positive > 0) << 28], 1).astype("<u4")
    path.write_bytes(header + b"\x0c\x08" + words.tobytes())


def write_evt3(path, events, size=(HEIGHT, WIDTH), begin_us=0, padding=0, form="EVT3"):
    """Prophesee's RAW in EVT 3.0, a camera whose clock is at `begin_us` when the events' times are 0; each `padding`
    events a word that means nothing."""
    words = []
    for number, (x, y, time, positive) in enumerate(zip(*events.T.astype(int)[:2], whole_microseconds(events)[1],
                                                        events[:, 3] > 0)):
        time = int(time) + begin_us
        if padding and number % padding == 0:
            words.append(0x9999)
        words += [8 << 12 | time >> 12 & 0xfff, 6 << 12 | time & 0xfff, y, 2 << 12 | int(positive) << 11 | x]
    header = f"% evt {'2.1' if form == 'EVT21' else '3.0'}\n% format {form};height={size[0]};width={size[1]}\n% end\n"
    path.write_bytes(header.encode() + np.array(words, "<u2").tobytes())


BBOX = [("t", "<u8"), ("x", "<f4"), ("y", "<f4"), ("w", "<f4"), ("h", "<f4"), ("class_id", "u1"), ("track_id", "<u4"),
        ("class_confidence", "<f4")]

DHP19_JOINTS = ["head", "shoulderR", "shoulderL", "elbowR", "elbowL", "hipR", "hipL", "handR", "handL", "kneeR",
                "kneeL", "footR", "footL"]
DHP19_MATRICES = {camera: np.array([[200.0 + camera, 0, 173, 346000], [0, 200, 130, 260000], [0, 0, 1, 2000]])
                  for camera in range(4)}


def write_dhp19(root, recordings=("S1_1_1", "S13_2_3"), events=20000, seconds=1.0):
    """Some recordings as the dataset has them, but events in HDF5; [T, 3] mm of each joint by recording and name."""
    matrices = root / "P_matrices"
    matrices.mkdir(parents=True)
    for camera, name in enumerate(["P4", "P1", "P3", "P2"]):
        np.save(matrices / f"{name}.npy", DHP19_MATRICES[camera])
    poses = {}
    for number, recording in enumerate(recordings):
        subject, session, movement = recording.split("_")
        folder = root / "DVS_movies" / subject / f"session{session}"
        folder.mkdir(parents=True, exist_ok=True)
        with h5py.File(folder / f"mov{movement}.h5", "w") as file:
            for camera in range(4):
                rows = random_events(events, 0, seconds * 1e6, 10 * number + camera, 260, 346)
                rows[0, 2] = 0
                for column, name in enumerate(["x", "y", "timeStamp"]):
                    file[f"cam{camera}/{name}"] = rows[None, :, column].astype(np.int64)
                file[f"cam{camera}/polarity"] = (rows[None, :, 3] > 0).astype(np.uint8)
        random = np.random.default_rng(100 + number)
        steps = int(seconds * 100)
        poses[recording] = {joint: random.uniform(-600, 600, 3) + random.normal(0, 5, (steps, 3)).cumsum(0)
                            for joint in DHP19_JOINTS}
        (root / "Vicon_data").mkdir(exist_ok=True)
        scipy.io.savemat(root / "Vicon_data" / f"{recording}.mat", {"XYZPOS": poses[recording]})
    return poses


def volume_of(events, bins=9, height=HEIGHT, width=WIDTH):
    """[2 bins, height, width]: the volume of rows x, y, t, p as the published code has it, built here again."""
    volume = np.zeros((2 * bins, height, width))
    if not len(events):
        return volume
    x, y, polarity = events[:, 0].astype(int), events[:, 1].astype(int), events[:, 3]
    span = events[-1, 2] - events[0, 2]
    times = (bins - 1) * (events[:, 2] - events[0, 2]) / (span or 1)
    for k in range(bins):
        np.add.at(volume, (np.where(polarity > 0, k, bins + k), y, x), np.maximum(0, 1 - abs(times - k)))
    return volume
