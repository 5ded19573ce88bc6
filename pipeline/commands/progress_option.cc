#include "pipeline/commands/progress_option.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <iostream>
#include <map>
#include <string>

namespace eventgan {
namespace {

const std::map<std::string, ProgressStyle> kProgressStyles = {{"auto", ProgressStyle::kAuto},
                                                              {"bar", ProgressStyle::kBar},
                                                              {"lines", ProgressStyle::kLines},
                                                              {"json", ProgressStyle::kJson},
                                                              {"none", ProgressStyle::kNone}};

}  // namespace

void add_progress_option(CLI::App& command, ProgressStyle& style) {
  command
      .add_option("--progress", style,
                  "auto, bar, lines, none; json prints machine-readable lines and report")
      ->transform(CLI::CheckedTransformer(kProgressStyles).description(""))
      ->option_text("STYLE");
}

std::unique_ptr<Progress> show_progress(ProgressStyle style, std::int64_t total,
                                        const ProgressUnit& unit) {
  return std::make_unique<Progress>(std::cerr, style, isatty(STDERR_FILENO) != 0, total,
                                    std::chrono::steady_clock::now, unit);
}

}  // namespace eventgan
