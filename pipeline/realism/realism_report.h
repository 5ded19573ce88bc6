#pragma once

#include <cstdint>
#include <optional>
#include <span>
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
  std::optional<ScoreBounds> bounds;        ///< of the means; none: not told
  std::optional<DirectionScore> direction;  ///< summed over the intervals
  Bounds direction_bounds;                  ///< of its fraction
  std::vector<IntervalScores> intervals;    ///< as many as the report's
};

/// NaN where no pixel tells the direction.
double direction_fraction(const std::optional<DirectionScore>& direction);

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

/// A table for a person, a column for each method, the best one of a row marked: of one recording a
/// row for each score, with half the width of its bounds; of several, which must have the same
/// methods, for each score a row for each recording and one for the mean over the recordings.
/// UTF-8.
std::string to_text(std::span<const RealismReport> reports);

/// JSON, indented: {"recordings": [...], "mean": ...}, with the bounds, and the scores of each
/// interval too; null for NaN. The mean is over the recordings, each counting alike.
std::string to_json(std::span<const RealismReport> reports);

}  // namespace eventgan
