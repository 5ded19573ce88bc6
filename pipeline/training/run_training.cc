#include "pipeline/training/run_training.h"

#include "pipeline/training/training_run.h"

namespace eventgan {

TrainingReport run_training(const TrainingManifest& manifest, const TrainingOptions& options) {
  return TrainingRun(manifest, options).run();
}

}  // namespace eventgan
