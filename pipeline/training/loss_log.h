#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/training.h"
#include "pipeline/training/csv_table.h"
#include "pipeline/training/training_checkpoint.h"

namespace eventgan {

/// The losses that a training reports, in the columns' order (see StepLosses): those of kLossTerms
/// that are not the paper's stand among the paper's own.
inline constexpr auto kLossNames = [] {
  constexpr std::array<std::string_view, 4> kCycle{"flow", "flow.photometric", "flow.smoothness",
                                                   "reconstruction"};
  constexpr std::array<std::string_view, 5> kAdversarial{
      "generator", "generator.total", "discriminator", "discriminator.real_accuracy",
      "discriminator.fake_accuracy"};
  constexpr std::size_t kOwn = std::ranges::count_if(
      kLossTerms, [](const LossTerm& term) { return term.kind != LossKind::kPaper; });
  std::array<std::string_view, kCycle.size() + kOwn + kAdversarial.size()> names{};
  auto end = std::ranges::copy(kCycle, names.begin()).out;
  for (const LossTerm& term : kLossTerms) {
    if (term.kind != LossKind::kPaper) *end++ = term.word;
  }
  std::ranges::copy(kAdversarial, end);
  return names;
}();

/// One step as it is logged. NaN: the step did not compute this loss.
struct LossRow {
  TrainingPosition position;
  double seconds = 0;  ///< trained so far, all runs together
  std::array<double, kLossNames.size()> losses{};
  double rate = 0;  ///< learning rate of the network that the step updated
};

/// training.csv: a row a step; columns phase, step, seconds, the losses, learning_rate. The rows
/// are also kept, for curves and means. Not thread safe.
class LossLog {
 public:
  /// Resumes FILE after the rows before `next`, which it cuts off with all behind it.
  LossLog(const std::filesystem::path& file, const TrainingPosition& next);

  /// Losses by name; names that have no column are left out.
  void add(const TrainingPosition& position, double seconds,
           const std::map<std::string, double>& losses, double rate);
  void flush() { table_.flush(); }

  std::span<const LossRow> rows() const { return rows_; }

 private:
  std::vector<LossRow> rows_;
  CsvTable table_;
};

/// Mean of each loss over the last `count` rows of the phase that have it; no entry if none has.
std::map<std::string, double> mean_losses(std::span<const LossRow> rows, TrainingPhase phase,
                                          std::size_t count);

/// The losses over the steps as an SVG file, a panel for each that has values: phases one after
/// another on the horizontal axis, from its first value to its last, the raw values faint and their
/// running mean (over a 50th of the values) in front. The vertical axis is logarithmic where all
/// values are above 0 and span more than two decades.
std::string loss_curves(std::span<const LossRow> rows);

}  // namespace eventgan
