#include "stages/shards/volume_words_internal.h"

namespace eventgan {

std::string unit_text(VolumeUnit unit, Normalization normalization) {
  if (unit == VolumeUnit::kLearned) return "dimensionless, >= 0; not a count of events";
  return normalization == Normalization::kNone
             ? "events, >= 0; each spread over the two bins nearest to it in time"
             : "share of eta98 events, 0..1";
}

std::string time_axis_text(VolumeUnit unit) {
  const std::string bins = "bin b of a polarity is centred at time b / (bins - 1), where 0 is the ";
  return bins + (unit == VolumeUnit::kLearned ? "previous frame and 1 the next one"
                                              : "first event and 1 the last one");
}

}  // namespace eventgan
