#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "manifests/values/recently_used.h"
#include "manifests/values/training.h"
#include "stages/recordings/readers/recording.h"
#include "stages/training/training_sample.h"

namespace eventgan {

/// A recording that is open, with the part of it that pairs are drawn from.
struct TrainingRecording {
  std::filesystem::path file;  ///< absolute
  std::shared_ptr<const Recording> recording;
  double weight = 1;             ///< relative chance of a sample to come from here
  std::int64_t first_frame = 0;  ///< of the part in use
  std::int64_t last_frame = 0;   ///< of the part in use, itself included; > first_frame
  std::optional<ContrastThreshold> threshold;  ///< its sensor's, for a network that knows it
};

/// Opens the recordings of a manifest; relative paths start at `directory`. Throws InputError if
/// one cannot be opened, and UsageError listing every one that is of no use: smaller than
/// `smallest`, or with a part in use that is not there or has no pair `smallest_gap` frames apart.
std::vector<TrainingRecording> open_training_recordings(std::span<const RecordingSpec> specs,
                                                        const std::filesystem::path& directory,
                                                        ImageSize smallest, int smallest_gap);

/// A rectangle of an image.
struct CropBox {
  int top = 0;
  int left = 0;
  ImageSize size;
};

/// The rectangle of this size in an image's middle, cut down to the image where it is larger.
CropBox centre_crop(ImageSize image, ImageSize size);

/// Reads frame pairs with the events between them, cut to a rectangle. What was read lately is
/// kept, so that a few recordings are not read again and again. Thread safe.
class CropReader {
 public:
  CropReader(std::vector<TrainingRecording> recordings, int bins);

  const std::vector<TrainingRecording>& recordings() const { return recordings_; }

  /// As the published code does, events are cut first, and the volume is made and normalised by the
  /// η98 of the events in the rectangle alone: its first and last event, not the image's, span
  /// the time bins. Of a recording with a threshold the volume counts events, and the frames' times
  /// span the bins. Frames are x = (u/255 - 0.5)·2; network_frames are the same. first_frame ==
  /// last_frame gives one frame twice and an empty volume. Throws InputError naming the recording
  /// if it cannot be read.
  TrainingSample read(std::size_t recording, std::int64_t first_frame, std::int64_t last_frame,
                      const CropBox& box) const;

  /// Events between a frame and the next one, in the whole image.
  std::size_t event_count(std::size_t recording, std::int64_t frame) const;

  /// The event before which the share `place`, 0..1 without 1, of those between two frames lies;
  /// none if there are none.
  std::optional<Event> event(std::size_t recording, std::int64_t first_frame,
                             std::int64_t last_frame, double place) const;

 private:
  using FrameKey = std::pair<std::size_t, std::int64_t>;  // recording, frame

  std::shared_ptr<const GreyImage> frame(std::size_t recording, std::int64_t index) const;
  std::shared_ptr<const std::vector<Event>> interval(std::size_t recording,
                                                     std::int64_t index) const;

  std::vector<TrainingRecording> recordings_;
  int bins_;
  mutable RecentlyUsed<FrameKey, std::shared_ptr<const GreyImage>> frames_;
  mutable RecentlyUsed<FrameKey, std::shared_ptr<const std::vector<Event>>> intervals_;
};

}  // namespace eventgan
