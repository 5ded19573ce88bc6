#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/events.h"
#include "pipeline/exports/detail/exporter.h"

namespace eventgan {

/// The events of samples, the same in all formats. Of recordings they are the camera's own, read
/// again from where convert found them, unless ExportOptions::counts asks for drawn ones; else they
/// are drawn from the volume, by the options' seed, the dataset and the sample's id. Thread safe.
class SampleEvents {
 public:
  SampleEvents(const ExportInput& input, const ExportOptions& options);
  ~SampleEvents();

  bool are_recorded() const { return !counts_; }

  /// A line for the export's identity.
  std::string settings() const;

  /// Opens the recordings, if they are needed. Throws InputError if they cannot be.
  void open() const;

  /// In time order, in the volume's pixels, from the pair's previous time on, which is 0: drawn
  /// ones to `duration_s`, recorded ones as the window has them. Throws InputError for events that
  /// cannot be read, or are not as many as the volume has.
  std::vector<Event> of(const OutgoingSample& sample, double duration_s) const;

 private:
  struct Recordings;

  std::vector<Event> recorded(const OutgoingSample& sample) const;

  const ExportInput& input_;
  std::uint64_t seed_;
  std::optional<EventCounts> counts_;  ///< of drawn ones; none: recorded
  mutable std::once_flag opened_;
  mutable std::unique_ptr<const Recordings> recordings_;
};

/// Seconds from a pair's previous frame to its next one; 1 where that is not known.
double known_gap_s(const FramePair& pair);

}  // namespace eventgan
