#include "pipeline/realism/compare_volumes.h"

#include <fmt/core.h>

#include <filesystem>
#include <mutex>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "pipeline/realism/real_interval.h"
#include "pipeline/runtime/threads.h"
#include "stages/events/images/comparison_image.h"

namespace eventgan {
namespace {

/// Writes FIRST-LAST.png (six digits each) into `folder`, which must exist: the frames, the real
/// volume and the methods', all as they are compared. Throws std::runtime_error if it cannot be
/// written.
void write_realism_image(const RealInterval& real, std::vector<NamedVolume> volumes, int bins,
                         const std::string& recording, const std::filesystem::path& folder) {
  const FrameInterval interval = real.frames.interval;
  volumes.insert(volumes.begin(), {"real", real.volume});
  const ComparedPair pair{
      {bins, real.frames.previous.size},
      network_input(real.frames),
      std::move(volumes),
      fmt::format("{}, frames {} and {}", recording, interval.first, interval.last)};
  write_comparison_png({&pair, 1},
                       folder / fmt::format("{:06}-{:06}.png", interval.first, interval.last));
}

/// What one interval gives: the camera's scores, then each method's.
struct IntervalResult {
  IntervalSummary summary;
  IntervalScores real;
  std::vector<IntervalScores> methods;
};

IntervalScores scores_of(const std::vector<float>& volume, const RealInterval& real, int bins) {
  const VolumeShape shape{bins, real.frames.previous.size};
  IntervalScores result{
      realism_scores(volume, real.volume, shape, real.frames.previous, real.frames.next),
      std::nullopt};
  if (real.flow) {
    result.direction = motion_direction(volume, shape, real.flow->x_px, real.flow->y_px);
  }
  return result;
}

/// Both sums, where there is one.
void add_direction(std::optional<DirectionScore>& sum, const std::optional<DirectionScore>& more) {
  if (!more) return;
  if (!sum) sum.emplace();
  sum->pixels += more->pixels;
  sum->within += more->within;
}

IntervalScores mean_of(const std::vector<IntervalScores>& parts) {
  IntervalScores result;
  std::vector<RealismScores> scores;
  for (const IntervalScores& part : parts) {
    scores.push_back(part.scores);
    add_direction(result.direction, part.direction);
  }
  result.scores = mean_scores(scores);
  return result;
}

IntervalResult compare_interval(const Recording& recording, const FrameInterval& interval,
                                std::span<const std::unique_ptr<VolumeMethod>> methods,
                                const ComparisonRun& run) {
  const RealInterval real = read_interval(recording, interval, run.bins);
  IntervalResult result{{interval, real.frames.duration_s, real.frames.event_count},
                        scores_of(real.volume, real, run.bins),
                        {}};
  std::vector<NamedVolume> drawn;
  for (const auto& method : methods) {
    std::vector<IntervalScores> draws;
    for (int draw = 0; draw < method->draws(); ++draw) {
      std::vector<float> volume = method->volume(real.frames, draw);
      try {
        draws.push_back(scores_of(volume, real, run.bins));
      } catch (const std::invalid_argument&) {
        std::throw_with_nested(std::runtime_error(
            "the volume of \"" + method->name() + "\" cannot be compared, frames " +
            std::to_string(interval.first) + " and " + std::to_string(interval.last) + " of " +
            recording.name()));
      }
      if (draw == 0 && !run.images.empty()) {
        drawn.push_back({method->name(), std::move(volume)});
      }
    }
    result.methods.push_back(mean_of(draws));
  }
  if (!run.images.empty()) {
    write_realism_image(real, std::move(drawn), run.bins, recording.name(), run.images);
  }
  return result;
}

/// Gathers one column of the results: the camera's, or that of a method.
template <class Column>
MethodSummary summary_of(std::string name, std::string settings,
                         const std::vector<IntervalResult>& results, Column column) {
  MethodSummary summary;
  summary.name = std::move(name);
  summary.settings = std::move(settings);
  std::vector<RealismScores> scores;
  for (const IntervalResult& result : results) {
    summary.intervals.push_back(column(result));
    scores.push_back(summary.intervals.back().scores);
  }
  const IntervalScores mean = mean_of(summary.intervals);
  summary.mean = mean.scores;
  summary.bounds = mean_bounds(scores);
  summary.direction = mean.direction;
  summary.direction_bounds =
      bootstrap_bounds(results.size(), [&](std::span<const std::size_t> drawn) {
        std::optional<DirectionScore> sum;
        for (const std::size_t i : drawn) add_direction(sum, summary.intervals[i].direction);
        return direction_fraction(sum);
      });
  return summary;
}

}  // namespace

RealismReport compare_volumes(const Recording& recording, std::span<const FrameInterval> intervals,
                              std::span<const std::unique_ptr<VolumeMethod>> methods,
                              const ComparisonRun& run) {
  std::vector<IntervalResult> results(intervals.size());
  std::mutex telling;
  for_each_index(intervals.size(), run.threads, [&](std::size_t i) {
    results[i] = compare_interval(recording, intervals[i], methods, run);
    if (!run.on_interval) return;
    const std::lock_guard lock(telling);
    run.on_interval();
  });

  RealismReport report;
  report.recording = recording.name();
  report.size = recording.size();
  report.bins = run.bins;
  for (const IntervalResult& result : results) report.intervals.push_back(result.summary);
  report.real = summary_of("real", "the camera", results,
                           [](const IntervalResult& result) { return result.real; });
  for (std::size_t m = 0; m < methods.size(); ++m) {
    report.methods.push_back(
        summary_of(methods[m]->name(), methods[m]->settings(), results,
                   [m](const IntervalResult& result) { return result.methods[m]; }));
  }
  return report;
}

}  // namespace eventgan
