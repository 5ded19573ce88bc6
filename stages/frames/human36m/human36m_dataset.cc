#include "stages/frames/human36m/human36m_dataset.h"

#include "manifests/faults.h"
#include "stages/frames/human36m/layouts_internal.h"

namespace eventgan {

std::unique_ptr<Dataset> open_human36m_dataset(const SourceSpec& spec,
                                               const std::filesystem::path& base) {
  if (!spec.layout) {
    throw UsageError(
        "expected a layout (fetch or extracted) for human36m, got none, in the source " +
        spec.root);
  }
  return *spec.layout == Human36mLayout::kFetch ? open_human36m_fetch(spec, base)
                                                : open_human36m_extracted(spec, base);
}

}  // namespace eventgan
