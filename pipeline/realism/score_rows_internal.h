#pragma once

#include <array>

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

}  // namespace eventgan
