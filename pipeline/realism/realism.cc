#include "pipeline/realism/realism.h"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>

#include "manifests/files/own_file.h"
#include "manifests/values/faults.h"
#include "pipeline/realism/real_interval.h"
#include "pipeline/runtime/threads.h"
#include "stages/events/images/comparison_image.h"
#include "stages/frames/listing/image_folder.h"

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
  const std::filesystem::path image =
      folder / fmt::format("{:06}-{:06}.png", interval.first, interval.last);
  require_replaceable(image, OwnFile::kPicture);
  write_comparison_png({&pair, 1}, image);
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

std::vector<GeneratorKind> realism_methods() {
  std::vector<GeneratorKind> methods;
  for (const bool drawn : {false, true}) {
    for (const GeneratorRow& row : kGenerators) {
      if (row.needs_frames && row.moves_one_frame == drawn) methods.push_back(row.value);
    }
  }
  return methods;
}

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

namespace {

constexpr int kDefaultBins = 9;
constexpr std::size_t kMostFitted = 16;

void check_options(const RealismOptions& options) {
  const std::set<GeneratorKind> distinct(options.methods.begin(), options.methods.end());
  if (distinct.empty() || distinct.size() != options.methods.size()) {
    throw UsageError("--with: expected different methods, at least one, got " +
                     std::to_string(options.methods.size()) + ", " +
                     std::to_string(distinct.size()) + " of them different");
  }
  if (options.threshold && !(options.threshold->mean >= 0.01 && options.threshold->mean <= 5)) {
    throw UsageError("--threshold: expected fit or a number in 0.01..5, got " +
                     std::to_string(options.threshold->mean));
  }
  // Command lines can say "nan", which lies in no range and outside of none.
  if (!(options.log_epsilon >= 1e-6 && options.log_epsilon <= 1)) {
    throw UsageError("--log-epsilon: expected a number in 1e-6..1, got " +
                     std::to_string(options.log_epsilon));
  }
  if (!(options.esim_displacement_px >= 0.1 && options.esim_displacement_px <= 100)) {
    throw UsageError("--esim-displacement: expected a number in 0.1..100, got " +
                     std::to_string(options.esim_displacement_px));
  }
}

void check_learnt(const ContrastThreshold& threshold, const ThresholdRange& learnt) {
  if (learnt.contains(threshold)) return;
  throw UsageError(fmt::format(
      "--threshold: expected {:.3g}..{:.3g} as the weights have learnt, got {:.3g} of positive "
      "events, {:.3g} of negative ones",
      learnt.lowest, learnt.highest, threshold.positive(), threshold.negative()));
}

std::vector<IntervalFrames> frames_to_fit(const Recording& recording,
                                          const std::vector<FrameInterval>& intervals) {
  const std::size_t count = std::min(kMostFitted, intervals.size());
  std::vector<IntervalFrames> frames;
  for (std::size_t i = 0; i < count; ++i) {
    frames.push_back(read_frames(recording, intervals[i * intervals.size() / count]));
  }
  return frames;
}

/// Makes the methods in the order they were asked for; reads the frames for fitting at most once.
class MethodMaker {
 public:
  MethodMaker(const Recording& recording, const std::vector<FrameInterval>& intervals,
              const RealismOptions& options, int threads)
      : recording_(recording), intervals_(intervals), options_(options), threads_(threads) {}

  int bins() const { return bins_; }

  std::vector<std::unique_ptr<VolumeMethod>> make() {
    const auto& wanted = options_.methods;
    NamedNetwork opened;
    if (std::ranges::find(wanted, GeneratorKind::kNetwork) != wanted.end()) {
      opened = open_network(options_.weights);
      bins_ = opened.generator->bins();
    }
    std::vector<std::unique_ptr<VolumeMethod>> methods;
    for (const GeneratorKind method : wanted) {
      methods.push_back(method == GeneratorKind::kNetwork
                            ? network(opened)
                            : simulated(simulated_scene(method, options_.esim_displacement_px,
                                                        options_.esim_draws)));
    }
    return methods;
  }

 private:
  const std::vector<IntervalFrames>& fitted_frames() {
    if (frames_.empty()) frames_ = frames_to_fit(recording_, intervals_);
    return frames_;
  }

  /// Takes the generator.
  std::unique_ptr<VolumeMethod> network(NamedNetwork& opened) {
    const auto& told = options_.network_threshold;
    std::optional<ContrastThreshold> threshold;
    if (const auto learnt = opened.generator->thresholds()) {
      if (!options_.network_weights.empty() && options_.network_weights != opened.weights_hash) {
        throw UsageError("--sensor: expected the threshold of " + options_.weights +
                         ", got that of other weights");
      }
      threshold = told ? told : fitted_threshold(*opened.generator, fitted_frames(), threads_);
      check_learnt(*threshold, *learnt);
    }
    const bool ignored = told && !threshold;
    return make_network_method(std::move(opened.generator),
                               options_.weights + (ignored ? ", which take no threshold" : ""),
                               threshold, !told, options_.seed);
  }

  std::unique_ptr<VolumeMethod> simulated(SimulatedScene scene) {
    const ContrastThreshold threshold =
        options_.threshold
            ? *options_.threshold
            : ContrastThreshold{fitted_threshold(scene, fitted_frames(), options_.log_epsilon,
                                                 options_.seed, threads_)};
    return make_simulated_method(std::move(scene), realism_sensor(threshold, options_.log_epsilon),
                                 !options_.threshold, bins_, options_.seed);
  }

  const Recording& recording_;
  const std::vector<FrameInterval>& intervals_;
  const RealismOptions& options_;
  const int threads_;
  std::vector<IntervalFrames> frames_;
  int bins_ = kDefaultBins;
};

}  // namespace

RealismReport measure_realism(
    const Recording& recording, const RealismOptions& options,
    const std::function<std::unique_ptr<Progress>(std::int64_t)>& make_progress) {
  const auto start = std::chrono::steady_clock::now();
  check_options(options);
  const std::vector<FrameInterval> intervals =
      choose_intervals(recording, options.first_frame, options.last_frame, options.gaps);
  const int threads = thread_count(options.threads);
  MethodMaker maker(recording, intervals, options, threads);
  const std::vector<std::unique_ptr<VolumeMethod>> methods = maker.make();
  if (!options.images.empty()) {
    require_no_images(options.images);
    std::filesystem::create_directories(options.images);
  }

  const auto progress =
      make_progress ? make_progress(static_cast<std::int64_t>(intervals.size())) : nullptr;
  ComparisonRun run;
  run.bins = maker.bins();
  run.threads = threads;
  run.images = options.images;
  if (progress) run.on_interval = [&] { progress->advance(false, 0); };
  RealismReport report = compare_volumes(recording, intervals, methods, run);
  if (progress) progress->finish();
  report.seed = options.seed;
  report.wall_seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

}  // namespace eventgan
