#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "pipeline/training/samples/lru_cache.h"
#include "pipeline/training/samples/training_recording.h"
#include "stages/training/training_sample.h"

namespace eventgan {

/// A rectangle of a picture.
struct CropBox {
  int top = 0;
  int left = 0;
  ImageSize size;
};

/// The rectangle of this size in a picture's middle, cut down to the picture where it is larger.
CropBox centre_crop(ImageSize picture, ImageSize size);

/// Reads frame pairs with the events between them, cut to a rectangle. What was read lately is
/// kept, so that a few recordings are not read again and again. Thread safe.
class CropReader {
 public:
  CropReader(std::vector<TrainingRecording> recordings, int bins);

  const std::vector<TrainingRecording>& recordings() const { return recordings_; }

  /// As the published code does, events are cut first, and the volume is made and normalised by the
  /// η98 of the events in the rectangle alone: its first and last event, not the picture's, span
  /// the time bins. Frames are x = (u/255 - 0.5)·2; network_frames are the same. first_frame ==
  /// last_frame gives one frame twice and an empty volume. Throws InputError naming the recording
  /// if it cannot be read.
  TrainingSample read(std::size_t recording, std::int64_t first_frame, std::int64_t last_frame,
                      const CropBox& box) const;

  /// Events between a frame and the next one, in the whole picture.
  std::size_t event_count(std::size_t recording, std::int64_t frame) const;

 private:
  using FrameKey = std::pair<std::size_t, std::int64_t>;  // recording, frame

  std::shared_ptr<const GreyImage> frame(std::size_t recording, std::int64_t index) const;
  std::shared_ptr<const std::vector<Event>> interval(std::size_t recording,
                                                     std::int64_t index) const;

  std::vector<TrainingRecording> recordings_;
  int bins_;
  mutable LruCache<FrameKey, GreyImage> frames_;
  mutable LruCache<FrameKey, std::vector<Event>> intervals_;
};

}  // namespace eventgan
