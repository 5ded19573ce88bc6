#include "stages/synthetic/demo_dataset.h"

#include <fmt/core.h>

#include <algorithm>
#include <system_error>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/faults.h"
#include "stages/synthetic/layouts/layout_writers.h"
#include "stages/synthetic/layouts/output_files.h"

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

    // The labelled frame comes first. The last ones of a sequence have no paired frame.
    { "dataset": "human36m", "root": "h36m", "layout": "fetch",
      "pairs": { "gaps": [1, 2], "side": "after", "choose": "one" } })";

/// Each scene is either for training or for validation, by its name and the seed; for {} stands
/// what demo_manifest puts there.
constexpr char kSplitSources[] =
    R"(    // Cars; four fifths of the scenes are to train on, the others to validate.
{}
    // Persons, likewise.
{}
    {{ "dataset": "human36m", "root": "h36m", "layout": "fetch",
      "pairs": {{ "gaps": [1, 2], "side": "after", "choose": "one" }} }})";

/// Where between 0 and 1 the numbers that `fraction` gives the frames of these names are to be
/// parted, so that some are to train on and some to validate: at 0.8, unless so few frames all lie
/// on one side of it. 1 if there is one frame only.
double parting(const std::vector<std::string>& names, std::uint64_t seed) {
  constexpr double kUsual = 0.8;
  std::vector<double> places;  // as select_frames has them
  for (const std::string& name : names) {
    places.push_back(CounterRandom(seed).keyed("fraction").keyed(name).uniform(0));
  }
  std::ranges::sort(places);
  if (places.size() < 2) return 1;
  if (places.front() < kUsual && places.back() >= kUsual) return kUsual;
  const auto first_to_validate = places.end() - std::max<std::ptrdiff_t>(1, std::ssize(places) / 5);
  return (*first_to_validate + *(first_to_validate - 1)) / 2;
}

/// The lines of a source to train on, and of one to validate.
std::string split_source(const std::string& keys, const std::string& pairs, double parting) {
  const std::string start = "    { " + keys;
  const std::string end = ",\n      \"pairs\": { " + pairs + ", \"choose\": \"one\" } },\n";
  if (parting == 1) return start + end;
  return start + fmt::format(", \"fraction\": [0, {}]", parting) + end + start +
         fmt::format(", \"fraction\": [{}, 1], \"split\": \"val\"", parting) + end;
}

std::string split_sources(std::uint64_t seed, int sequences) {
  return fmt::format(
      kSplitSources,
      split_source(R"("dataset": "kitti_object", "root": "kitti/training")",
                   R"("gaps": [1, 2, 3], "side": "before")",
                   parting(kitti_layout_names(sequences), seed)),
      split_source(R"("dataset": "mpii", "root": "mpii")", R"("gaps": [2, 4], "side": "around")",
                   parting(mpii_layout_names(sequences), seed)));
}

}  // namespace

std::string demo_manifest(std::uint64_t seed, int sequences) {
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
)" + (sequences > 0 ? split_sources(seed, sequences) : kSources) +
         R"(
  ],

  // Images of any size are scaled to fit and laid into the middle of the volume.
  "image": { "width": 346, "height": 260, "fit": "letterbox", "preset": "mpii" },

  // The weights that come with the program. A file of your own may be here, of
  // eventgan import-weights CHECKPOINT eventgan.safetensors, or of eventgan train.
  "generator": { "weights": "shipped", "precision": "float32" },

  "volume": { "bins": 9, "normalize": "none" },
  "output": { "directory": "events", "samples_per_shard": )" +
         (sequences > 0 ? "64" : "8") + R"(, "dtype": "float16",
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

void write_demo_dataset(const std::filesystem::path& folder, std::uint64_t seed, int sequences,
                        int intermediate_count, const std::function<void()>& on_image) {
  require_new_or_empty(folder);
  const bool is_new = !std::filesystem::exists(folder);
  try {
    write_kitti_layout(folder / "kitti" / "training", seed, sequences, intermediate_count,
                       on_image);
    write_mpii_layout(folder / "mpii", seed, sequences, intermediate_count, on_image);
    write_human36m_layout(folder / "h36m", seed);
    // Last: where there is a manifest, all it speaks of is there.
    write_text(folder / "manifest.json", demo_manifest(seed, sequences));
  } catch (...) {  // else the next try would find a folder with files in it
    std::error_code unknown;
    for (const char* name : {"kitti", "mpii", "h36m", "manifest.json"}) {
      std::filesystem::remove_all(folder / name, unknown);
    }
    if (is_new) std::filesystem::remove(folder, unknown);
    throw;
  }
}

int demo_image_count(int sequences) {
  constexpr int kTestImages = 1;  // of MPII
  return static_cast<int>(kitti_layout_names(sequences).size() +
                          mpii_layout_names(sequences).size()) +
         kTestImages;
}

}  // namespace eventgan
