#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace eventgan {

/// One recording made.
struct RecordingSummary {
  std::string name;
  std::int64_t frames = 0;
  std::int64_t events = 0;
  std::int64_t pixels = 0;     ///< of a frame
  double duration_s = 0;       ///< from first to last frame
  double displacement_px = 0;  ///< from a frame to the next: the largest 99.5th percentile over the
                               ///< pixels; 0 where the flow is not known

  double events_per_pixel_second() const;
};

/// What a simulation did.
struct SimulationReport {
  std::string folder;
  std::vector<RecordingSummary> made;  ///< in the order of the manifest
  std::vector<std::string> kept;       ///< names of recordings that an earlier run had made
  double wall_seconds = 0;
};

/// A few lines for a person: a table of the recordings, and their sum.
std::string to_text(const SimulationReport& report);

/// One line of JSON.
std::string to_json(const SimulationReport& report);

}  // namespace eventgan
