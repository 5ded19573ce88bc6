#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/events.h"
#include "manifests/values/frames.h"
#include "manifests/values/training.h"

namespace eventgan {

/// Flow of one frame interval: where each pixel of frame i lies in frame i + 1.
struct FlowField {
  ImageSize size;
  std::vector<float> x_px;  ///< [y, x] float32, displacement to the right
  std::vector<float> y_px;  ///< [y, x] float32, displacement down
};

/// A recording of an event camera: the events, and frames with their times if it has any, all on
/// one clock and one pixel grid. Of tables, AEDAT4 and Prophesee's files the events read last are
/// kept, for all windows and threads: sixteen million of the whole process, or 220 MB. Of the
/// others nothing but the index is held in memory.
///
/// A frame that is not there is std::out_of_range. Thread safety: all may be called from several
/// threads (calls into HDF5 take turns).
class Recording {
 public:
  virtual ~Recording() = default;

  /// For messages: the path as it was opened.
  virtual const std::string& name() const = 0;
  virtual ImageSize size() const = 0;
  virtual std::int64_t frame_count() const = 0;

  /// Time of a frame in seconds, on the events' clock; strictly ascending.
  virtual double frame_time_s(std::int64_t index) const = 0;

  /// A frame in colour is made grey (ITU-R BT.601). Throws InputError (cause nested) if it cannot
  /// be read or is of another size.
  virtual GreyImage frame(std::int64_t index) const = 0;

  /// Events with t(first frame) < t ≤ t(last frame), in time order; none for one frame twice. A
  /// frame outside the time of the events is no error: there are fewer events then. Throws
  /// InputError where the data read are malformed: times that fall (by less than two milliseconds
  /// they are lifted, but of ECD's and AEDAT's files and of ROS bags), pixels outside the image,
  /// values that are not finite; std::out_of_range if the last frame is before the first.
  virtual std::vector<Event> events_between(std::int64_t first_frame,
                                            std::int64_t last_frame) const = 0;

  /// Events with after_s < t ≤ until_s, in time order; throws likewise.
  virtual std::vector<Event> events_in(double after_s, double until_s) const = 0;

  /// The last `before` events with t ≤ time_s and the first `after` ones behind them, fewer where
  /// the recording ends, or where rectifying moves some out of the image; throws likewise.
  virtual std::vector<Event> events_around(double time_s, std::int64_t before,
                                           std::int64_t after) const = 0;

  /// Times of the first and the last event; none if there is no event. Throws InputError.
  virtual std::optional<std::array<double, 2>> event_span() const = 0;

  /// The true flow from frame `index` to the next one, of recordings that know it (simulated ones);
  /// its values are finite. Throws InputError (cause nested) if it cannot be read.
  virtual std::optional<FlowField> flow(std::int64_t index) const = 0;

  /// What a user should know of the recording, a line each: what was found on opening it, and in
  /// the frames read since then.
  virtual std::vector<std::string> notes() const { return {}; }

  /// What had better be read before anything is made of it, a line each: not in the notes.
  virtual std::vector<std::string> warnings() const { return {}; }
};

/// What lies at `path`, told by what is in it: a folder with events.txt (or this file) is ECD's,
/// one with events/left/events.h5 DSEC's, an HDF5 file or an array tells by its fields' names, a
/// CSV by its header, AEDAT, a ROS bag and a file of Prophesee's by how they begin; none if it is
/// nothing of that. The first format of kRecordingFormats that fits counts.
std::optional<RecordingFormat> find_recording_format(const std::filesystem::path& path,
                                                     const RecordingOptions& options = {});

/// Why what lies at a path is no recording that can be read.
struct RecordingFault {
  std::string reason;         ///< "expected X, got Y, in PATH", and what helps
  bool is_recording = false;  ///< it is one, but damaged, locked, or of a kind that is not read
};

/// Of what find_recording_format gives none.
RecordingFault recording_fault(const std::filesystem::path& path,
                               const RecordingOptions& options = {});

/// The file with the events of the recording at `path`, which stands for it: of ECD's folder the
/// events.txt, of DSEC's the events.h5; of others it is `path`.
std::filesystem::path event_file(const std::filesystem::path& path,
                                 const RecordingOptions& options = {});

/// What decides, beside this file, the times of frames and the places of events: images.txt of ECD;
/// timestamps.txt and, with `rectify`, rectify_map.h5 of DSEC. Without a format it is found.
std::vector<std::filesystem::path> event_companions(
    const std::filesystem::path& event_file, std::optional<RecordingFormat> format = std::nullopt,
    const RecordingOptions& options = {});

/// Whether DSEC's rectify_map.h5 moves an event of any of the sensor's pixels to another one.
/// Throws InputError if it is damaged or of another size.
bool moves_events(const std::filesystem::path& rectify_map, ImageSize sensor);

/// Opens a recording of the format, or of what is found without one: reads the frames' times and
/// checks that everything is there and fits together; where a frame's events end is looked up when
/// first asked for. Throws InputError "expected X, got Y, in PATH" if it is absent or not of this
/// format.
std::unique_ptr<Recording> open_recording(const std::filesystem::path& path,
                                          std::optional<RecordingFormat> format = std::nullopt,
                                          const RecordingOptions& options = {});

}  // namespace eventgan
