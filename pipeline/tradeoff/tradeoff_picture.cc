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

/// A logarithmic axis over whole decades.
struct LogAxis {
  double first = 0, last = 1;  // decades

  static LogAxis around(const std::vector<double>& values) {
    const auto [low, high] = std::ranges::minmax(values);
    LogAxis axis{std::floor(std::log10(low)), std::ceil(std::log10(high))};
    if (axis.last == axis.first) axis.last += 1;
    return axis;
  }
  double share(double value) const { return (std::log10(value) - first) / (last - first); }
};

struct Plot {
  LogAxis speed, error;

  cv::Point at(double pairs_per_s, double relative_l2) const {
    return {
        kLeft + static_cast<int>(std::lround(speed.share(pairs_per_s) * kPlotWidth)),
        kTop + static_cast<int>(std::lround(
                   (1 - error.share(std::clamp(relative_l2, kLeastError, 1e6))) * kPlotHeight))};
  }

  void draw_axes(cv::Mat& canvas) const {
    for (int decade = static_cast<int>(speed.first); decade <= speed.last; ++decade) {
      for (int digit = 1; digit < 10; ++digit) {
        const double value = digit * std::pow(10.0, decade);
        if (std::log10(value) > speed.last + 1e-9) break;
        const int x = at(value, kLeastError).x;
        cv::line(canvas, {x, kTop}, {x, kTop + kPlotHeight}, kGrid);
        if (digit == 1 || digit == 2 || digit == 5) {
          write_text(canvas, fmt::format("{:g}", value), {x - 8, kTop + kPlotHeight + 16}, kInk);
        }
      }
    }
    for (int decade = static_cast<int>(error.first); decade <= error.last; ++decade) {
      const double value = std::pow(10.0, decade);
      const int y = at(std::pow(10.0, speed.first), value).y;
      cv::line(canvas, {kLeft, y}, {kLeft + kPlotWidth, y}, kGrid);
      write_text(canvas, fmt::format("{}{:g}", value <= kLeastError ? "<" : "", value), {6, y + 4},
                 kInk);
    }
    cv::rectangle(canvas, cv::Rect(kLeft, kTop, kPlotWidth, kPlotHeight), kInk);
    write_text(canvas, "pairs a second on all threads", {kLeft + 220, kTop + kPlotHeight + 40},
               kInk);
    write_text(canvas, "error: relative L2 from the reference", {6, kTop - 10}, kInk);
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
    speeds.push_back(summary.pairs_per_s.median);
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
      return plot.at(trials[i].pairs_per_s.median, trials[i].loss.relative_l2);
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
               fmt::format("{}  {}: {:.1f} pairs/s, {:.2g}", i + 1, trial.name,
                           trial.pairs_per_s.median, trial.loss.relative_l2),
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
