#include "stages/scenes/demo_dataset.h"

#include <system_error>

#include "manifests/values/faults.h"
#include "stages/scenes/layouts/human36m_layout_writer.h"
#include "stages/scenes/layouts/kitti_layout_writer.h"
#include "stages/scenes/layouts/mpii_layout_writer.h"
#include "stages/scenes/layouts/output_files.h"

namespace eventgan {

namespace {

/// The small demo's sources, each explained.
constexpr char kSources[] =
    R"(    // Labels of cars belong to the later frame of a pair, 1 to 3 frames after the earlier one.
    { "dataset": "kitti_object", "root": "kitti/training",
      "pairs": { "gaps": [1, 2, 3], "side": "before", "choose": "one" } },

    // The labelled frame lies in the middle of a pair 2 or 4 frames apart.
    { "dataset": "mpii", "root": "mpii",
      "pairs": { "gaps": [2, 4], "side": "around", "choose": "one" } },

    // The labelled frame comes first. The last ones of a sequence have no partner.
    { "dataset": "human36m", "root": "h36m", "layout": "fetch",
      "pairs": { "gaps": [1, 2], "side": "after", "choose": "one" } })";

/// Each scene is either for training or for validation, by its name and the seed.
constexpr char kSplitSources[] =
    R"(    // Cars; four fifths of the scenes are to train on, the others to validate.
    { "dataset": "kitti_object", "root": "kitti/training", "fraction": [0, 0.8],
      "pairs": { "gaps": [1, 2, 3], "side": "before", "choose": "one" } },
    { "dataset": "kitti_object", "root": "kitti/training", "fraction": [0.8, 1], "split": "val",
      "pairs": { "gaps": [1, 2, 3], "side": "before", "choose": "one" } },

    // Persons, likewise.
    { "dataset": "mpii", "root": "mpii", "fraction": [0, 0.8],
      "pairs": { "gaps": [2, 4], "side": "around", "choose": "one" } },
    { "dataset": "mpii", "root": "mpii", "fraction": [0.8, 1], "split": "val",
      "pairs": { "gaps": [2, 4], "side": "around", "choose": "one" } },

    { "dataset": "human36m", "root": "h36m", "layout": "fetch",
      "pairs": { "gaps": [1, 2], "side": "after", "choose": "one" } })";

}  // namespace

std::string demo_manifest(std::uint64_t seed, int scenes) {
  return R"(// A job for `eventgan convert`. Relative paths start at this file's folder.
{
  "format": "eventgan-manifest",
  "version": 1,
  "name": "demo",

  // Everything random (which gap a pair gets) follows from this number.
  "seed": )" +
         std::to_string(seed) +
         R"(,

  "sources": [
)" + (scenes > 0 ? kSplitSources : kSources) +
         R"(
  ],

  // Pictures of any size are scaled to fit and laid into the middle of the volume.
  "image": { "width": 346, "height": 260, "fit": "letterbox", "preset": "mpii" },

  // The weights that come with the program. A file of your own may stand here, of
  // eventgan import-weights CHECKPOINT eventgan.safetensors, or of eventgan train.
  "generator": { "weights": "shipped", "precision": "float32" },

  "volume": { "bins": 9, "normalize": "none" },
  "output": { "directory": "events", "samples_per_shard": )" +
         (scenes > 0 ? "64" : "8") + R"(, "dtype": "float16",
              "deflate_level": 1 },
  "errors": { "policy": "quarantine", "max_count": 100, "max_fraction": 0.01 }
}
)";
}

namespace {

void require_new_or_empty(const std::filesystem::path& folder) {
  std::error_code error;
  if (!std::filesystem::exists(folder, error)) return;
  if (!std::filesystem::is_directory(folder, error)) {
    throw UsageError("expected a new or empty folder, got a file, at " + folder.string());
  }
  if (!std::filesystem::is_empty(folder, error) || error) {
    throw UsageError("expected a new or empty folder, got one with files in it, at " +
                     folder.string());
  }
}

}  // namespace

void write_demo_dataset(const std::filesystem::path& folder, std::uint64_t seed, int scenes,
                        int between) {
  require_new_or_empty(folder);
  write_kitti_layout(folder / "kitti" / "training", seed, scenes, between);
  write_mpii_layout(folder / "mpii", seed, scenes, between);
  write_human36m_layout(folder / "h36m", seed);
  // Last: where there is a manifest, all it speaks of is there.
  write_text(folder / "manifest.json", demo_manifest(seed, scenes));
}

}  // namespace eventgan
