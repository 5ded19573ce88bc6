#include "stages/training/check_trainable.h"

#include <string>

#include "manifests/faults.h"
#include "stages/training/networks/patch_discriminator_internal.h"

namespace eventgan {
namespace {

/// Batch norm divides by a spread, which a single value does not have: the deepest layers see one
/// pixel of a 16x16 crop.
void check_batch(const TrainingManifest& manifest) {
  const auto deepest = [](int side) { return (side + 15) / 16; };
  if (manifest.batch > 1 || deepest(manifest.crop.height) * deepest(manifest.crop.width) > 1)
    return;
  throw UsageError("expected a batch of at least 2 for a crop of " +
                   std::to_string(manifest.crop.width) + "x" +
                   std::to_string(manifest.crop.height) + ", got 1, in " + manifest.name);
}

/// The manifest's reader refuses these too; a manifest may also be made in code.
void check_generator_phase(const TrainingManifest& manifest) {
  const LossWeights& weights = manifest.losses;
  if (manifest.steps.generator == 0) return;
  if (weights.adversarial == 0 && weights.flow == 0 && weights.reconstruction == 0 &&
      weights.volume == 0 && weights.count == 0) {
    throw UsageError("expected a loss for the generator, got weight 0 for all, in " +
                     manifest.name);
  }
  if (weights.adversarial == 0) return;
  constexpr int kSmallest = PatchDiscriminatorImpl::smallest_side();
  if (manifest.crop.height < kSmallest || manifest.crop.width < kSmallest) {
    throw UsageError("expected a crop of at least " + std::to_string(kSmallest) +
                     " pixels a side for the adversarial loss, got " +
                     std::to_string(manifest.crop.width) + "x" +
                     std::to_string(manifest.crop.height) + ", in " + manifest.name);
  }
  if (manifest.batch % 2 != 0) {
    throw UsageError("expected an even batch for the adversarial loss, got " +
                     std::to_string(manifest.batch) + ", in " + manifest.name);
  }
}

}  // namespace

void check_trainable(const TrainingManifest& manifest) {
  check_batch(manifest);
  check_generator_phase(manifest);
}

}  // namespace eventgan
