#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/frames.h"
#include "pipeline/realism/real_interval.h"
#include "stages/events/realism/motion_direction.h"
#include "stages/events/realism/realism_scores.h"

namespace eventgan {

/// An interval that was compared.
struct IntervalSummary {
  FrameInterval interval;
  double duration_s = 0;
  std::int64_t event_count = 0;
};

/// How one method did on one interval: means over its draws, the direction's pixels summed.
struct IntervalScores {
  RealismScores scores;
  std::optional<DirectionScore> direction;  ///< where the recording knows the true flow
};

/// How one method did.
struct MethodSummary {
  std::string name;
  std::string settings;
  RealismScores mean;                       ///< over the intervals
  std::optional<DirectionScore> direction;  ///< summed over the intervals
  std::vector<IntervalScores> intervals;    ///< as many as the report's
};

struct RealismReport {
  std::string recording;
  ImageSize size;
  int bins = 0;
  std::uint64_t seed = 0;
  std::vector<IntervalSummary> intervals;
  MethodSummary real;  ///< the camera's volumes by the same measures; matches with itself are 1
  std::vector<MethodSummary> methods;
  double wall_seconds = 0;
};

/// A table for a person: a row for each score, a column for each method, the best one of a row
/// marked. UTF-8.
std::string to_text(const RealismReport& report);

/// JSON, indented, with the scores of each interval too; null for NaN.
std::string to_json(const RealismReport& report);

}  // namespace eventgan
