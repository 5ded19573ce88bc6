#include "tests/pipeline/training/bar_training.h"

#include <stdexcept>

#include "manifests/documents/training_manifest.h"
#include "stages/recordings/writers/mvsec_writer.h"
#include "tests/testing/fake_recording.h"

namespace eventgan::testing {

std::string small_training_text() {
  return R"({
  "format": "eventgan-training", "version": 1, "name": "small", "seed": 3,
  "recordings": [{"path": "bar.hdf5", "format": "mvsec"}],
  "validation": [{"path": "bar.hdf5", "format": "mvsec", "first_frame": 6}],
  "gaps": [1, 2],
  "crop": {"height": 48, "width": 48},
  "batch": 2,
  "network": {"generator_channels": 2, "discriminator_channels": 2, "cycle_channels": 2, "bins": 3},
  "optimizer": {"generator_rate": 1e-3},
  "steps": {"flow": 2, "reconstruction": 2, "generator": 4},
  "output": {"directory": "out", "checkpoint_minutes": 1000, "image_minutes": 1000}
})";
}

void write_bar_recording(const std::filesystem::path& folder) {
  const FakeRecording bar = moving_bar_recording({56, 64}, 9);
  MvsecWriter writer(folder / "bar.hdf5", bar.size(), "{}");
  for (std::int64_t i = 0; i < bar.frame_count(); ++i) {
    if (i > 0) writer.add_events(bar.events_between(i - 1, i));
    writer.add_frame(bar.frame(i), bar.frame_time_s(i), nullptr);
  }
  writer.commit();
}

TrainingManifest small_training(const std::filesystem::path& folder, const std::string& replace,
                                const std::string& with) {
  if (!std::filesystem::exists(folder / "bar.hdf5")) write_bar_recording(folder);
  std::string text = small_training_text();
  if (!replace.empty()) {
    const auto at = text.find(replace);
    if (at == std::string::npos) throw std::invalid_argument("not in the manifest: " + replace);
    text.replace(at, replace.size(), with);
  }
  return parse_training_manifest(text, folder, "small.json");
}

}  // namespace eventgan::testing
