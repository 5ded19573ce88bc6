#pragma once

#include <memory>
#include <utility>

#include "pipeline/training/training_recording.h"

namespace eventgan::testing {

/// A recording in memory as one that is open for training, all of it in use.
template <class SomeRecording>
TrainingRecording opened(SomeRecording recording, double weight = 1) {
  TrainingRecording result;
  result.last_frame = recording.frame_count() - 1;
  result.recording = std::make_shared<SomeRecording>(std::move(recording));
  result.weight = weight;
  return result;
}

}  // namespace eventgan::testing
