#include "stages/scenes/demo_dataset.h"

#include <system_error>

#include "manifests/faults.h"
#include "stages/scenes/demo_manifest.h"
#include "stages/scenes/layouts/human36m_layout_writer.h"
#include "stages/scenes/layouts/kitti_layout_writer.h"
#include "stages/scenes/layouts/mpii_layout_writer.h"
#include "stages/scenes/layouts/output_files.h"

namespace eventgan {
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

void write_demo_dataset(const std::filesystem::path& folder, std::uint64_t seed) {
  require_new_or_empty(folder);
  write_kitti_layout(folder / "kitti" / "training", seed);
  write_mpii_layout(folder / "mpii", seed);
  write_human36m_layout(folder / "h36m", seed);
  // Last: where there is a manifest, all it speaks of is there.
  write_text(folder / "manifest.json", demo_manifest(seed));
}

}  // namespace eventgan
