#pragma once

#include <filesystem>
#include <iterator>
#include <optional>
#include <string>
#include <vector>

#include "stages/recordings/readers/detail/ecd_event_file.h"
#include "stages/recordings/readers/detail/frame_intervals.h"
#include "stages/recordings/readers/detail/image_frames.h"
#include "stages/recordings/readers/recording.h"

namespace eventgan {

/// `images.txt` of an ECD recording: a line "t path" for each frame.
struct EcdImageList {
  std::vector<double> times_s;     ///< strictly ascending
  std::vector<std::string> paths;  ///< relative to the recording's folder, as written
};

/// Throws InputError "expected X, got Y, in FILE (line 3)", the line counted from 1.
EcdImageList read_ecd_image_list(const std::filesystem::path& file);

/// A folder as those of the Event Camera Dataset (ECD): `images.txt`, the images it names, and
/// `events.txt`. It knows no flow. The first image, which tells the size, is read on opening.
class EcdRecording final : public Recording {
 public:
  /// Throws InputError, also if an image is not there.
  explicit EcdRecording(const std::filesystem::path& folder);

  const std::string& name() const override { return name_; }
  ImageSize size() const override { return frames_.size(); }
  std::int64_t frame_count() const override { return std::ssize(frames_.times_s()); }
  double frame_time_s(std::int64_t index) const override;
  GreyImage frame(std::int64_t index) const override;
  std::vector<Event> events_between(std::int64_t first_frame,
                                    std::int64_t last_frame) const override;
  std::vector<Event> events_in(double after_s, double until_s) const override;
  std::vector<Event> events_around(double time_s, std::int64_t before,
                                   std::int64_t after) const override;
  std::optional<std::array<double, 2>> event_span() const override { return events_.span(); }
  std::optional<FlowField> flow(std::int64_t index) const override;
  std::vector<std::string> notes() const override { return frames_.notes(); }

 private:
  EcdRecording(const std::filesystem::path& folder, const EcdImageList& images);

  std::string name_;
  EcdEventFile events_;
  ImageFrames frames_;
};

}  // namespace eventgan
