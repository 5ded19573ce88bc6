#pragma once

#include <cstdint>
#include <memory>

#include "pipeline/progress/progress.h"

namespace CLI {
class App;
}

namespace eventgan {

/// Adds `--progress STYLE` to a command; `style` must outlive its parsing.
void add_progress_option(CLI::App& command, ProgressStyle& style);

/// Progress on the standard error stream.
std::unique_ptr<Progress> show_progress(ProgressStyle style, std::int64_t total,
                                        const ProgressUnit& unit = {});

}  // namespace eventgan
