#pragma once

#include <filesystem>
#include <memory>

#include "manifests/job_manifest.h"
#include "stages/frames/dataset.h"

namespace eventgan {

/// open_human36m_dataset for one layout each.
std::unique_ptr<Dataset> open_human36m_fetch(const SourceSpec& spec,
                                             const std::filesystem::path& base);
std::unique_ptr<Dataset> open_human36m_extracted(const SourceSpec& spec,
                                                 const std::filesystem::path& base);

}  // namespace eventgan
