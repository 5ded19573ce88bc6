#include "pipeline/training/loss_log.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <ranges>
#include <stdexcept>
#include <string>
#include <vector>

#include "stages/base/files/atomic_file.h"

namespace eventgan {
namespace {

constexpr std::size_t kFirstLoss = 3;  // after phase, step, seconds

CsvTable::Row columns() {
  CsvTable::Row names{"phase", "step", "seconds"};
  names.insert(names.end(), kLossNames.begin(), kLossNames.end());
  names.push_back("learning_rate");
  return names;
}

std::optional<TrainingPhase> phase_of(const std::string& word) {
  for (const auto phase :
       {TrainingPhase::kFlow, TrainingPhase::kReconstruction, TrainingPhase::kGenerator}) {
    if (word == to_string(phase)) return phase;
  }
  return std::nullopt;
}

std::optional<LossRow> parse(const CsvTable::Row& cells) {
  const auto phase = phase_of(cells[0]);
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
  for (const LossRow& row : rows | std::views::reverse) {
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

constexpr int kColumns = 2;
const cv::Size kPanel(520, 240);
constexpr int kLeft = 70, kRight = 16, kTop = 30, kBottom = 26;
constexpr double kTextSize = 0.42;
const cv::Scalar kPaper(255, 255, 255), kInk(40, 40, 40), kFrame(190, 190, 190);
const cv::Scalar kRaw(235, 205, 170), kMean(180, 90, 20), kPhase(150, 190, 150);

/// Values of a loss within one phase.
struct CurvePart {
  TrainingPhase phase = TrainingPhase::kFlow;
  std::vector<double> at;  // row index: steps of all phases, one after another
  std::vector<double> values;
};

/// One loss.
struct LossCurve {
  std::string name;
  std::vector<CurvePart> parts;
};

/// The vertical axis: value → 0 (bottom) .. 1 (top).
struct LossAxis {
  double low = 0, high = 1;
  bool logarithmic = false;

  double place(double value) const {
    const double share =
        logarithmic ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
    return std::clamp(share, 0.0, 1.0);
  }
  double value(double share) const {
    return logarithmic ? low * std::pow(high / low, share) : low + share * (high - low);
  }
};

std::vector<LossCurve> curves_of(std::span<const LossRow> rows) {
  std::vector<LossCurve> curves;
  for (std::size_t loss = 0; loss < kLossNames.size(); ++loss) {
    LossCurve curve{std::string(kLossNames[loss]), {}};
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (!std::isfinite(rows[i].losses[loss])) continue;
      const TrainingPhase phase = rows[i].position.phase;
      if (curve.parts.empty() || curve.parts.back().phase != phase) {
        curve.parts.push_back({phase, {}, {}});
      }
      curve.parts.back().at.push_back(static_cast<double>(i));
      curve.parts.back().values.push_back(rows[i].losses[loss]);
    }
    if (!curve.parts.empty()) curves.push_back(std::move(curve));
  }
  return curves;
}

LossAxis axis_of(const LossCurve& curve) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const CurvePart& part : curve.parts) {
    const auto [least, most] = std::minmax_element(part.values.begin(), part.values.end());
    low = std::min(low, *least);
    high = std::max(high, *most);
  }
  if (high > low) return {low, high, low > 0 && high > 100 * low};
  const double room = std::max(std::abs(low) * 0.1, 1e-9);  // a constant: in the middle
  return {low - room, high + room, false};
}

std::vector<double> running_mean(const std::vector<double>& values) {
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

void write_text(cv::Mat& picture, const std::string& text, cv::Point at) {
  cv::putText(picture, text, at, cv::FONT_HERSHEY_SIMPLEX, kTextSize, kInk, 1, cv::LINE_AA);
}

class CurvePanel {
 public:
  CurvePanel(cv::Mat picture, double row_count, const LossAxis& axis)
      : picture_(std::move(picture)), row_count_(row_count), axis_(axis) {}

  void draw_frame(const std::string& name) {
    cv::rectangle(picture_, area(), kFrame);
    write_text(picture_, name + (axis_.logarithmic ? " (log)" : ""), {kLeft, kTop - 10});
    for (const double share : {0.0, 0.5, 1.0}) {
      const int y = area().y + area().height - cvRound(share * area().height);
      write_text(picture_, fmt::format("{:.3g}", axis_.value(share)), {4, y + 4});
    }
    write_text(picture_, std::to_string(static_cast<long>(row_count_)) + " steps",
               {kPanel.width - 110, kPanel.height - 8});
  }

  void draw_phase_border(double row) {
    const int x = point(row, axis_.low).x;
    cv::line(picture_, {x, area().y}, {x, area().y + area().height}, kPhase);
  }

  void draw(const std::vector<double>& at, const std::vector<double>& values,
            const cv::Scalar& colour) {
    std::vector<cv::Point> points;
    for (std::size_t i = 0; i < at.size(); ++i) points.push_back(point(at[i], values[i]));
    cv::polylines(picture_, points, false, colour, 1, cv::LINE_AA);
    if (points.size() == 1) cv::circle(picture_, points[0], 2, colour, cv::FILLED);
  }

 private:
  static cv::Rect area() {
    return {kLeft, kTop, kPanel.width - kLeft - kRight, kPanel.height - kTop - kBottom};
  }
  cv::Point point(double row, double value) const {
    const double x = row / std::max(row_count_ - 1, 1.0);
    return {area().x + cvRound(x * area().width),
            area().y + area().height - cvRound(axis_.place(value) * area().height)};
  }

  cv::Mat picture_;
  double row_count_;
  LossAxis axis_;
};

cv::Mat compose(std::span<const LossRow> rows) {
  const std::vector<LossCurve> curves = curves_of(rows);
  const int lines = std::max(1, static_cast<int>(curves.size() + kColumns - 1) / kColumns);
  cv::Mat picture(lines * kPanel.height, kColumns * kPanel.width, CV_8UC3, kPaper);
  for (std::size_t i = 0; i < curves.size(); ++i) {
    const int column = static_cast<int>(i) % kColumns, line = static_cast<int>(i) / kColumns;
    const cv::Rect place({column * kPanel.width, line * kPanel.height}, kPanel);
    CurvePanel panel(picture(place), static_cast<double>(rows.size()), axis_of(curves[i]));
    for (std::size_t row = 1; row < rows.size(); ++row) {
      if (rows[row].position.phase != rows[row - 1].position.phase) {
        panel.draw_phase_border(static_cast<double>(row));
      }
    }
    panel.draw_frame(curves[i].name);
    for (const CurvePart& part : curves[i].parts) {
      panel.draw(part.at, part.values, kRaw);
      panel.draw(part.at, running_mean(part.values), kMean);
    }
  }
  return picture;
}

}  // namespace

void write_loss_curves(std::span<const LossRow> rows, const std::filesystem::path& file) {
  std::vector<unsigned char> png;
  try {
    cv::imencode(".png", compose(rows), png);
  } catch (const cv::Exception& exception) {
    throw std::runtime_error("cannot draw " + file.string() + ": " + exception.err);
  }
  write_file_atomically(file, {reinterpret_cast<const char*>(png.data()), png.size()});
}

}  // namespace eventgan
