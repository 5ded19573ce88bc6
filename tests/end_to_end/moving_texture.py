"""Folders of images, and videos, of one texture that moves by whole pixels, so that its true motion is known."""

import cv2
import numpy as np
import PIL.Image

DARKEST, BRIGHTEST = 30, 225
COARSEST_PX, FINEST_PX = 64, 2  # patches of the texture


def texture(height, width, seed):
    """Noise of as much contrast at every scale, as images of scenes have it: uint8 [height, width]."""
    random = np.random.default_rng(seed)
    total = np.zeros((height, width))
    patch_px = COARSEST_PX
    while patch_px >= FINEST_PX:
        cells = random.standard_normal((height // patch_px + 2, width // patch_px + 2)).astype(np.float32)
        smooth = PIL.Image.fromarray(cells).resize((cells.shape[1] * patch_px, cells.shape[0] * patch_px),
                                                   PIL.Image.BICUBIC)
        total += np.asarray(smooth)[:height, :width]
        patch_px //= 2
    total = (total - total.min()) / (total.max() - total.min())
    return np.round(DARKEST + total * (BRIGHTEST - DARKEST)).astype(np.uint8)


def write_images(folder, shifts_px, height, width, seed):
    """One image a shift, which moves the texture to the right; returns them, uint8 [frame, y, x]."""
    folder.mkdir(parents=True)
    most = max(shifts_px)
    world = texture(height, width + most, seed)
    images = [world[:, most - shift:most - shift + width] for shift in shifts_px]
    for index, image in enumerate(images):
        PIL.Image.fromarray(image).save(folder / f"frame_{index:02d}.png")
    return np.stack(images)


def write_video(path, frames, height=48, width=64, frames_per_second=25):
    path.parent.mkdir(parents=True, exist_ok=True)
    video = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), frames_per_second, (width, height))
    image = cv2.cvtColor(texture(height, width + frames, 7), cv2.COLOR_GRAY2BGR)
    for shift in range(frames):
        video.write(image[:, shift:shift + width])
    video.release()
