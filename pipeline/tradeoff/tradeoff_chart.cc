#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "pipeline/tradeoff/tradeoff_report.h"
#include "stages/base/charts/svg_chart.h"

namespace eventgan {
namespace {

constexpr double kLeastError = 1e-4;  // what is nearer is drawn there

/// Method and weights, which share a colour.
std::string family_of(const Computation& computation) {
  return has_weights(computation.method) ? computation.weights
                                         : std::string(to_string(computation.method));
}

void add(ChartSeries& series, const TrialSummary& trial, const std::string& caption) {
  series.x.push_back(trial.speedup.median);
  const double error = trial.loss.relative_l2;
  series.y.push_back(std::isfinite(error) ? std::max(error, kLeastError) : error);
  series.captions.push_back(caption);
  series.tooltips.push_back(trial.name);
}

}  // namespace

std::string tradeoff_chart(const TradeoffReport& report) {
  Chart chart{
      "Speed and error of each configuration",
      "times the reference's speed (processor time of a pair)",
      "distance to the reference's volumes (relative L2, at least 0.0001), not to a camera"};
  chart.log_x = chart.log_y = true;
  chart.width = 820;
  chart.plot_height = 520;
  std::vector<TrialSummary> trials;
  for (const Trial& trial : report.trials) trials.push_back(summary_of(trial));
  const std::vector<std::size_t> front = pareto_front(trials);
  chart.series.push_back({"Pareto front", {}, ChartMark::kLine});
  for (std::size_t i = 0; i < front.size(); ++i) {
    const TrialSummary& trial = trials[front[i]];
    add(chart.series[0], trial, "");
    chart.notes.push_back(fmt::format("{}. {}: {:.2f} times, {:.2g}", i + 1, trial.name,
                                      trial.speedup.median, trial.loss.relative_l2));
  }
  for (std::size_t i = 0; i < trials.size(); ++i) {
    const std::string family = family_of(report.trials[i].configuration.computation);
    auto series =
        std::ranges::find(chart.series.begin() + 1, chart.series.end(), family, &ChartSeries::name);
    if (series == chart.series.end()) {
      series = chart.series.insert(series, {family, {}, ChartMark::kPoint});
    }
    const auto place = std::ranges::find(front, i);
    add(*series, trials[i], place == front.end() ? "" : std::to_string(place - front.begin() + 1));
  }
  return chart_file(report.job + ", against " + name_of(report.reference) + ", " + report.processor,
                    {chart}, 1);
}

}  // namespace eventgan
