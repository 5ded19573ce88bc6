#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

#include "pipeline/tradeoff/tradeoff_report.h"
#include "stages/base/files/atomic_file.h"

namespace eventgan {
namespace {

constexpr int kLeft = 70, kTop = 50, kBottom = 56, kPlotWidth = 640, kPlotHeight = 460;
constexpr int kNames = 520;  // room for the front's names
constexpr int kLine = 20;
constexpr double kTextSize = 0.42;
constexpr double kLeastError = 1e-4;  // what is nearer is drawn there
const cv::Scalar kPaper(255, 255, 255), kInk(40, 40, 40), kGrid(225, 225, 225);
/// By method and weights, in the order in which they come.
const std::vector<cv::Scalar> kColours{{200, 110, 30}, {40, 130, 230}, {90, 160, 60},
                                       {150, 60, 160}, {60, 60, 200},  {130, 130, 130}};

void write_text(cv::Mat& canvas, const std::string& text, cv::Point at, const cv::Scalar& colour) {
  cv::putText(canvas, text, at, cv::FONT_HERSHEY_SIMPLEX, kTextSize, colour, 1, cv::LINE_AA);
}

/// A logarithmic axis around some values.
struct LogAxis {
  double first = 0, last = 1;  // decades

  static LogAxis around(const std::vector<double>& values) {
    constexpr double kMargin = 0.1;
    const auto [low, high] = std::ranges::minmax(values);
    return {std::log10(low) - kMargin, std::log10(high) + kMargin};
  }
  double share(double value) const { return (std::log10(value) - first) / (last - first); }

  /// 1, 2, ... 9 times each power of ten that lies on it.
  std::vector<double> ticks() const {
    std::vector<double> values;
    for (int decade = static_cast<int>(std::floor(first)); decade <= last; ++decade) {
      for (int digit = 1; digit < 10; ++digit) {
        const double value = digit * std::pow(10.0, decade);
        if (share(value) >= 0 && share(value) <= 1) values.push_back(value);
      }
    }
    return values;
  }
};

/// Whether a tick has room for its number: 1, 2 and 5 of a decade.
bool is_labelled(double value) {
  const double digit = value / std::pow(10.0, std::floor(std::log10(value) + 1e-9));
  return digit < 2.5 || (digit > 4.5 && digit < 5.5);
}

struct Plot {
  LogAxis speed, error;

  cv::Point at(double times, double relative_l2) const {
    return {
        kLeft + static_cast<int>(std::lround(speed.share(times) * kPlotWidth)),
        kTop + static_cast<int>(std::lround(
                   (1 - error.share(std::clamp(relative_l2, kLeastError, 1e6))) * kPlotHeight))};
  }

  void draw_axes(cv::Mat& canvas) const {
    for (const double value : speed.ticks()) {
      const int x = at(value, kLeastError).x;
      cv::line(canvas, {x, kTop}, {x, kTop + kPlotHeight}, kGrid);
      if (!is_labelled(value)) continue;
      write_text(canvas, fmt::format("{:g}", value), {x - 8, kTop + kPlotHeight + 16}, kInk);
    }
    for (const double value : error.ticks()) {
      const int y = at(1, value).y;
      cv::line(canvas, {kLeft, y}, {kLeft + kPlotWidth, y}, kGrid);
      if (!is_labelled(value)) continue;
      write_text(canvas, fmt::format("{}{:g}", value <= kLeastError ? "<" : "", value), {6, y + 4},
                 kInk);
    }
    cv::rectangle(canvas, cv::Rect(kLeft, kTop, kPlotWidth, kPlotHeight), kInk);
    write_text(canvas, "times the reference's speed (processor time of a pair)",
               {kLeft + 140, kTop + kPlotHeight + 40}, kInk);
    write_text(canvas, "error: distance to the reference's volumes (relative L2), not to a camera",
               {6, kTop - 10}, kInk);
  }
};

/// Method and weights, which share a colour.
std::string family_of(const Computation& computation) {
  return computation.method == GeneratorKind::kNetwork ? computation.weights
                                                       : std::string(to_string(computation.method));
}

}  // namespace

void write_tradeoff_png(const TradeoffReport& report, const std::filesystem::path& path) {
  std::vector<TrialSummary> trials;
  std::vector<std::string> families;
  std::vector<double> speeds, errors;
  for (const Trial& trial : report.trials) {
    const TrialSummary& summary = trials.emplace_back(summary_of(trial));
    const std::string family = family_of(trial.configuration.computation);
    if (std::ranges::find(families, family) == families.end()) families.push_back(family);
    if (!std::isfinite(summary.loss.relative_l2)) continue;
    speeds.push_back(summary.speedup.median);
    errors.push_back(std::max(summary.loss.relative_l2, kLeastError));
  }
  const std::vector<std::size_t> front = pareto_front(trials);
  const int height = kTop + std::max(kPlotHeight + kBottom,
                                     kLine * static_cast<int>(front.size() + families.size() + 4));
  cv::Mat canvas(height, kLeft + kPlotWidth + kNames, CV_8UC3, kPaper);
  write_text(canvas,
             report.job + ", against " + name_of(report.reference) + ", " + report.processor,
             {6, 20}, kInk);
  const auto colour = [&](std::size_t trial) {
    const auto found =
        std::ranges::find(families, family_of(report.trials[trial].configuration.computation));
    return kColours[static_cast<std::size_t>(found - families.begin()) % kColours.size()];
  };
  if (!speeds.empty()) {
    const Plot plot{LogAxis::around(speeds), LogAxis::around(errors)};
    plot.draw_axes(canvas);
    const auto place = [&](std::size_t i) {
      return plot.at(trials[i].speedup.median, trials[i].loss.relative_l2);
    };
    for (std::size_t i = 1; i < front.size(); ++i) {
      cv::line(canvas, place(front[i - 1]), place(front[i]), kInk, 1, cv::LINE_AA);
    }
    for (std::size_t i = 0; i < trials.size(); ++i) {
      if (std::isfinite(trials[i].loss.relative_l2)) {
        cv::circle(canvas, place(i), 4, colour(i), cv::FILLED, cv::LINE_AA);
      }
    }
    for (std::size_t i = 0; i < front.size(); ++i) {
      write_text(canvas, std::to_string(i + 1), place(front[i]) + cv::Point(6, -6), kInk);
    }
  }
  const int left = kLeft + kPlotWidth + 24;
  int y = kTop;
  write_text(canvas, "Pareto front", {left, y}, kInk);
  for (std::size_t i = 0; i < front.size(); ++i) {
    const TrialSummary& trial = trials[front[i]];
    write_text(canvas,
               fmt::format("{}  {}: {:.2f} times, {:.2g}", i + 1, trial.name, trial.speedup.median,
                           trial.loss.relative_l2),
               {left, y += kLine}, colour(front[i]));
  }
  y += kLine;
  for (std::size_t i = 0; i < families.size(); ++i) {
    cv::circle(canvas, {left + 4, (y += kLine) - 4}, 4, kColours[i % kColours.size()], cv::FILLED,
               cv::LINE_AA);
    write_text(canvas, families[i], {left + 14, y}, kInk);
  }
  std::vector<unsigned char> png;
  if (!cv::imencode(".png", canvas, png)) {
    throw std::runtime_error("cannot draw " + path.string());
  }
  write_file_atomically(path, {reinterpret_cast<const char*>(png.data()), png.size()});
}

}  // namespace eventgan
