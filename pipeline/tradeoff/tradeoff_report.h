#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/tradeoff/tradeoff.h"

namespace eventgan {

/// A trial in the numbers that reports tell: medians with the middle half over the rounds.
struct TrialSummary {
  std::string name;
  Spread generator_s, conversion_s;   ///< processor time a pair
  Spread pairs_per_s;                 ///< on all threads
  Spread speedup;                     ///< the reference's conversion_s of the same round / its own
  double peak_bytes = 0;              ///< median; 0: not known
  double stored_bytes = 0;            ///< a pair
  PairLoss loss;                      ///< overall_loss
  std::optional<RealismScores> real;  ///< mean over the recordings, each counting alike
};

TrialSummary summary_of(const Trial& trial);

/// The Pareto front, by index, from the slowest to the fastest: those than which no faster one
/// (median of speedup: processor time, which other programs on the machine hardly change) is as
/// near to the reference (relative_l2), where a hundredth of the error is no difference. Of equals
/// the first. Trials without loss or cost are not on it. Pure.
std::vector<std::size_t> pareto_front(const std::vector<TrialSummary>& trials);

/// What a user asks of a configuration.
struct TradeoffDemand {
  std::optional<double> at_most_error = {};   ///< relative_l2
  std::optional<double> at_least_speed = {};  ///< pairs_per_s
  std::optional<double> at_least_times = {};  ///< speedup
};

/// The fastest (speedup) that is near enough; without `at_most_error` the nearest that is fast
/// enough. None if no trial is, or none has both loss and cost. Pure.
std::optional<std::size_t> best_trial(const std::vector<TrialSummary>& trials,
                                      const TradeoffDemand& demand);

/// A table for a person, not wider than 80 columns, the front marked; what could not be run with
/// the reasons; and with their lines for the manifest: the manifest's own, the next faster and the
/// next nearer on the front, the fastest within 3 % of the reference (else the nearest), the
/// nearest at twice its speed (else the fastest), and what serves the demand. UTF-8.
std::string to_text(const TradeoffReport& report, const TradeoffDemand& demand);

/// The same as Markdown, with all that was measured.
std::string to_markdown(const TradeoffReport& report, const TradeoffDemand& demand);

/// JSON, indented, with the spreads; null for what is no finite number.
std::string to_json(const TradeoffReport& report, const TradeoffDemand& demand);

/// Speed (in the reference's) against error, both logarithmic, as an SVG file: a point for each
/// trial, the front as a line with numbers, and below it their names. It says that the error is the
/// distance to the reference, not to a camera.
std::string tradeoff_chart(const TradeoffReport& report);

}  // namespace eventgan
