#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/frames.h"
#include "stages/recordings/order/event_check.h"
#include "stages/recordings/order/time_order.h"
#include "stages/recordings/readers/recording.h"

namespace eventgan {

/// Pixels, as the manifest's `sensor` may have.
inline constexpr int kMostSensorSide = 8192;

/// The events of a file by their positions 0..count-1, in the file's order. Thread safe.
class EventStore {
 public:
  virtual ~EventStore() = default;
  virtual std::int64_t count() const = 0;

  /// Events first..first + count - 1, which must be there; nothing is known of their values but
  /// that they were stored. Throws InputError "expected X, got Y, in PATH (event 12)".
  virtual std::vector<StoredEvent> read(std::int64_t first, std::int64_t count) const = 0;

  /// Their times alone, in seconds; throws likewise.
  virtual std::vector<double> times_s(std::int64_t first, std::int64_t count) const;

  /// What all times tell, lifted by up to kMostLift_s; places are events' positions. Reads them
  /// once, which takes as long as the file is large; what cannot be read is told by it, not thrown.
  virtual TimeOrder order() const;
};

/// The frames of a recording. Thread safe.
class FrameStore {
 public:
  virtual ~FrameStore() = default;
  /// Strictly ascending, seconds on the events' clock.
  virtual const std::vector<double>& times_s() const = 0;
  /// Frame 0..size-1 of the recording's size. Throws InputError.
  virtual GreyImage read(std::int64_t index) const = 0;

  /// As Recording::notes.
  virtual std::vector<std::string> notes() const { return {}; }

  /// Recording::flow of an index of times_s() but the last. Throws InputError.
  virtual std::optional<FlowField> flow(std::int64_t) const { return std::nullopt; }
};

/// What a recording is made of.
struct StoredParts {
  std::string name;  ///< Recording::name
  ImageSize size;
  std::unique_ptr<EventStore> events;
  std::unique_ptr<FrameStore> frames = nullptr;  ///< null: there are none
  /// Moves an event; false where it leaves the image and is left out. Null: events stay.
  std::function<bool(Event&)> move = nullptr;
  std::vector<std::string> notes = {};
  std::vector<std::string> warnings = {};  ///< Recording::warnings
  /// Under which EventStore::order is known (event_index_key); empty: not at all.
  std::string index_key = {};
};

/// The sensor's size: what the manifest gives, else what the file tells. Where they differ,
/// `parts`, which must have its name, gets a warning. Throws InputError if there is neither.
ImageSize sensor_size(const std::optional<ImageSize>& told, const std::optional<ImageSize>& given,
                      StoredParts& parts);

/// The recording of these parts, with the checks that Recording promises: times that, once they are
/// lifted as the EventStore's order has it, never decrease, pixels inside the image, finite values.
/// Where the events of a time lie is told by the order of all times, which is looked at when the
/// first events are asked for; a file's own index is not used, since its meaning differs among
/// files.
std::unique_ptr<Recording> make_stored_recording(StoredParts parts);

}  // namespace eventgan
