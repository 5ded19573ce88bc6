#pragma once

#include <array>
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

enum class BetterScore { kHigher, kLower, kLikeReal };

/// One score of RealismScores, as reports name it.
struct ScoreRow {
  const char* key;    ///< in JSON
  const char* label;  ///< in the table
  BetterScore better;
  double RealismScores::*member;
};

/// The polarity's correlation is a likeness too: the difference of log intensities has nearly 1 by
/// construction, and no camera has.
inline constexpr std::array<ScoreRow, 9> kScoreRows{{
    {"f1_raw", "F1, voxels", BetterScore::kHigher, &RealismScores::f1_raw},
    {"f1_time", "F1, summed over time", BetterScore::kHigher, &RealismScores::f1_time},
    {"f1_time_polarity", "F1, over time and polarity", BetterScore::kHigher,
     &RealismScores::f1_time_polarity},
    {"pool_mse_2", "PoolMSE 2", BetterScore::kLower, &RealismScores::pool_mse_2},
    {"pool_mse_4", "PoolMSE 4", BetterScore::kLower, &RealismScores::pool_mse_4},
    {"time_correlation", "correlation of mean times", BetterScore::kHigher,
     &RealismScores::time_correlation},
    {"polarity_correlation", "polarity ~ change of log I", BetterScore::kLikeReal,
     &RealismScores::polarity_correlation},
    {"events_per_pixel", "events per pixel", BetterScore::kLikeReal,
     &RealismScores::events_per_pixel},
    {"positive_share", "positive share", BetterScore::kLikeReal, &RealismScores::positive_share},
}};

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
