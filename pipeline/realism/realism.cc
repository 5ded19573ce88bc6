#include "pipeline/realism/realism.h"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <set>
#include <string>

#include "manifests/values/faults.h"
#include "pipeline/realism/compare_volumes.h"
#include "pipeline/realism/volume_method.h"
#include "pipeline/runtime/threads.h"

namespace eventgan {
namespace {

constexpr int kDefaultBins = 9;
constexpr std::size_t kMostFitted = 16;

void check_options(const RealismOptions& options) {
  const std::set<RealismMethod> distinct(options.methods.begin(), options.methods.end());
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
    std::unique_ptr<Generator> generator;
    if (std::ranges::find(wanted, RealismMethod::kNetwork) != wanted.end()) {
      generator = open_realism_generator(options_.weights);
      bins_ = generator->bins();
    }
    std::vector<std::unique_ptr<VolumeMethod>> methods;
    for (const RealismMethod method : wanted) {
      switch (method) {
        case RealismMethod::kNetwork:
          methods.push_back(network(std::move(generator)));
          break;
        case RealismMethod::kDifference:
          methods.push_back(simulated(difference_scene()));
          break;
        case RealismMethod::kEsim:
          methods.push_back(
              simulated(esim_scene(options_.esim_displacement_px, options_.esim_draws)));
          break;
      }
    }
    return methods;
  }

 private:
  const std::vector<IntervalFrames>& fitted_frames() {
    if (frames_.empty()) frames_ = frames_to_fit(recording_, intervals_);
    return frames_;
  }

  std::unique_ptr<VolumeMethod> network(std::unique_ptr<Generator> generator) {
    std::optional<ContrastThreshold> threshold;
    if (const auto learnt = generator->thresholds()) {
      threshold = options_.threshold;
      if (!threshold) threshold = fitted_threshold(*generator, fitted_frames(), threads_);
      check_learnt(*threshold, *learnt);
    }
    const bool ignored = options_.threshold && !threshold;
    return make_network_method(std::move(generator),
                               options_.weights + (ignored ? ", which take no threshold" : ""),
                               threshold, !options_.threshold, options_.seed);
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
  if (!options.images.empty()) std::filesystem::create_directories(options.images);

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
