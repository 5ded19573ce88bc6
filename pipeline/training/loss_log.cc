#include "pipeline/training/loss_log.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "manifests/values/words.h"
#include "stages/base/charts/svg_chart.h"

namespace eventgan {
namespace {

constexpr std::size_t kFirstLoss = 3;  // after phase, step, seconds

CsvTable::Row columns() {
  CsvTable::Row names{"phase", "step", "seconds"};
  names.insert(names.end(), kLossNames.begin(), kLossNames.end());
  names.push_back("learning_rate");
  return names;
}

std::optional<LossRow> parse(const CsvTable::Row& cells) {
  const auto phase = value_of_word(kPhaseWords, cells[0]);
  const double step = csv_value(cells[1]);
  if (!phase || !(step >= 0)) return std::nullopt;
  LossRow row;
  row.position = {*phase, static_cast<std::int64_t>(step)};
  row.seconds = csv_value(cells[2]);
  for (std::size_t i = 0; i < row.losses.size(); ++i) {
    row.losses[i] = csv_value(cells[kFirstLoss + i]);
  }
  row.rate = csv_value(cells.back());
  return row;
}

CsvTable::Row cells_of(const LossRow& row) {
  CsvTable::Row cells{std::string(to_string(row.position.phase)), std::to_string(row.position.step),
                      csv_number(row.seconds)};
  for (const double loss : row.losses) cells.push_back(csv_number(loss));
  cells.push_back(csv_number(row.rate));
  return cells;
}

}  // namespace

LossLog::LossLog(const std::filesystem::path& file, const TrainingPosition& next)
    : table_(file, columns(), [&](const CsvTable::Row& cells) {
        const auto row = parse(cells);
        return row && row->position < next;
      }) {
  for (const CsvTable::Row& cells : table_.kept()) rows_.push_back(*parse(cells));
}

void LossLog::add(const TrainingPosition& position, double seconds,
                  const std::map<std::string, double>& losses, double rate) {
  LossRow row;
  row.position = position;
  row.seconds = seconds;
  row.rate = rate;
  for (std::size_t i = 0; i < kLossNames.size(); ++i) {
    const auto found = losses.find(std::string(kLossNames[i]));
    row.losses[i] =
        found == losses.end() ? std::numeric_limits<double>::quiet_NaN() : found->second;
  }
  const CsvTable::Row cells = cells_of(row);
  table_.add(cells);
  // As the file has it: then what is drawn and averaged does not depend on when the run was
  // resumed.
  rows_.push_back(*parse(cells));
}

std::map<std::string, double> mean_losses(std::span<const LossRow> rows, TrainingPhase phase,
                                          std::size_t count) {
  std::array<double, kLossNames.size()> sums{};
  std::array<std::size_t, kLossNames.size()> found{};
  for (auto last = rows.rbegin(); last != rows.rend(); ++last) {
    const LossRow& row = *last;
    if (row.position.phase != phase || count-- == 0) break;
    for (std::size_t i = 0; i < sums.size(); ++i) {
      if (std::isnan(row.losses[i])) continue;
      sums[i] += row.losses[i];
      ++found[i];
    }
  }
  std::map<std::string, double> means;
  for (std::size_t i = 0; i < sums.size(); ++i) {
    if (found[i] > 0) means[std::string(kLossNames[i])] = sums[i] / static_cast<double>(found[i]);
  }
  return means;
}

namespace {

std::vector<double> running_mean(std::span<const double> values) {
  const std::size_t window = std::max<std::size_t>(1, values.size() / 50);
  std::vector<double> means;
  double sum = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    sum += values[i];
    if (i >= window) sum -= values[i - window];
    means.push_back(sum / static_cast<double>(std::min(i + 1, window)));
  }
  return means;
}

}  // namespace

std::string loss_curves(std::span<const LossRow> rows) {
  std::vector<double> borders;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    if (rows[i].position.phase != rows[i - 1].position.phase) {
      borders.push_back(static_cast<double>(i));
    }
  }
  std::vector<Chart> charts;
  for (std::size_t loss = 0; loss < kLossNames.size(); ++loss) {
    std::vector<double> steps, values, means;
    double low = std::numeric_limits<double>::infinity(), high = -low;
    std::size_t begin = 0;  // of the phase's values: each phase has a line and a mean of its own
    const auto end_phase = [&] {
      const std::vector<double> of_phase = running_mean(std::span(values).subspan(begin));
      means.insert(means.end(), of_phase.begin(), of_phase.end());
    };
    for (std::size_t i = 0, last = 0; i < rows.size(); ++i) {
      const double value = rows[i].losses[loss];
      if (!std::isfinite(value)) continue;
      if (!values.empty() && rows[i].position.phase != rows[last].position.phase) {
        end_phase();
        for (auto* line : {&steps, &values, &means}) {
          line->push_back(std::numeric_limits<double>::quiet_NaN());
        }
        begin = values.size();
      }
      last = i;
      steps.push_back(static_cast<double>(i));
      values.push_back(value);
      low = std::min(low, value);
      high = std::max(high, value);
    }
    if (values.empty()) continue;
    end_phase();
    Chart chart{std::string(kLossNames[loss]), "steps of all phases", ""};
    chart.series = {{"each step", values, ChartMark::kFaintLine, steps},
                    {"running mean", means, ChartMark::kLine, steps}};
    chart.log_y = low > 0 && high > 100 * low;
    if (chart.log_y) chart.y_axis = "logarithmic";
    chart.rules = borders;
    charts.push_back(std::move(chart));
  }
  return chart_file(charts.empty() ? "No losses yet" : "Losses", charts, 2);
}

}  // namespace eventgan
