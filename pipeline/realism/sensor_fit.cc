#include "pipeline/realism/sensor_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <initializer_list>
#include <map>
#include <numeric>
#include <utility>

#include "pipeline/planning/spread.h"
#include "pipeline/realism/real_interval.h"
#include "pipeline/realism/volume_method.h"
#include "pipeline/runtime/threads.h"
#include "stages/events/simulation/sensor.h"

namespace eventgan {
namespace {

constexpr std::size_t kMostPairs = 64;

/// So many frames before a pair are of its video, too.
constexpr std::int64_t kFramesBefore = 8;

constexpr std::uint64_t kSeed = 0;

struct ChosenPairs {
  std::vector<FrameInterval> fitted;
  std::vector<FrameInterval> kept;
};

std::vector<FrameInterval> some_of(std::span<const FrameInterval> all, std::size_t most) {
  std::vector<FrameInterval> some;
  for (const std::size_t i : spread(most, all.size())) some.push_back(all[i]);
  return some;
}

ChosenPairs choose_pairs_of(const FitPart& part, const std::vector<int>& gaps, std::size_t most) {
  std::vector<FrameInterval> all =
      choose_intervals(*part.recording, part.first_frame, part.last_frame, gaps);
  // The first frames are only looked at before pairs, unless there are few.
  const std::int64_t skipped = std::min(kFramesBefore, std::ssize(all) / 4);
  const auto is_early = [&](const FrameInterval& interval) {
    return interval.first < part.first_frame + skipped;
  };
  if (!std::ranges::all_of(all, is_early)) std::erase_if(all, is_early);
  std::ranges::sort(all, {}, [](const FrameInterval& interval) {
    return std::pair(interval.last, interval.first);
  });
  const std::size_t fitted = all.size() - all.size() / 4;
  const std::int64_t end = all[fitted - 1].last;
  const auto rest = all.begin() + static_cast<std::ptrdiff_t>(fitted);
  const auto later = std::partition(
      rest, all.end(), [&](const FrameInterval& interval) { return interval.first >= end; });
  const std::size_t kept = static_cast<std::size_t>(later - rest);
  return {some_of(std::span(all).first(fitted), most),
          some_of(std::span(all).subspan(fitted, kept), most)};
}

/// Of pairs that share no time, so that no event counts twice.
std::vector<StillPixels> still_pixels_of(const Recording& recording,
                                         std::span<const FrameInterval> pairs) {
  std::vector<StillPixels> still;
  std::int64_t end = 0;
  for (const FrameInterval& pair : pairs) {
    if (pair.first < end) continue;
    end = pair.last;
    const auto events = recording.events_between(pair.first, pair.last);
    const IntervalFrames frames = frames_of(recording, pair, events);
    still.push_back(find_still_pixels(frames.previous, frames.next, events, frames.duration_s));
  }
  return still;
}

/// The pairs (again: which pixels are hot takes all of them) without the events of hot pixels;
/// `hot`: [y, x], or empty for none.
void read_pairs(const FitPart& part, std::span<const FrameInterval> pairs,
                std::span<const std::uint8_t> hot, std::vector<IntervalFrames>& frames) {
  const Recording& recording = *part.recording;
  for (const FrameInterval& pair : pairs) {
    std::vector<Event> events = recording.events_between(pair.first, pair.last);
    if (!hot.empty()) {
      const int width = recording.size().width;
      std::erase_if(events, [&](const Event& event) {
        return hot[static_cast<std::size_t>(event.y * width + event.x)] != 0;
      });
    }
    frames.push_back(frames_of(recording, pair, events));
  }
}

/// The frames of one part's pairs and those before them, as one video, cut where others lie
/// between. A level that is drawn, or that begins anew before each pair, is far off in scenes that
/// are slow or of little contrast: a pixel's level goes back to its last event, however long ago.
struct Video {
  std::vector<GreyImage> frames;
  std::vector<std::array<std::size_t, 2>> pairs;  ///< places of their first and last frames
};

Video read_video(const FitPart& part, std::span<const FrameInterval> pairs) {
  std::map<std::int64_t, std::size_t> places;
  for (const FrameInterval& pair : pairs) {
    const std::int64_t first = std::max(part.first_frame, pair.first - kFramesBefore);
    for (std::int64_t i = first; i <= pair.last; ++i) places[i] = 0;
  }
  Video video;
  for (auto& [frame, place] : places) {
    place = video.frames.size();
    video.frames.push_back(part.recording->frame(frame));
  }
  for (const FrameInterval& pair : pairs) {
    video.pairs.push_back({places.at(pair.first), places.at(pair.last)});
  }
  return video;
}

/// Adds for each pair of a video the events of `sensor`, which begins at level 0 with its first
/// frame. `goes_back_first`: it has seen the video before that, from its end to its beginning.
void add_video_events(const Video& video, const SensorSpec& sensor, bool goes_back_first,
                      int threads, std::vector<PolarityCounts>& counts) {
  const std::size_t steps = video.frames.size() - 1;
  const std::size_t steps_before = goes_back_first ? steps : 0;
  const ImageSize size = video.frames.front().size;
  const auto width = static_cast<std::size_t>(size.width);
  std::vector<double> times;
  for (std::size_t i = 0; i <= steps_before + steps; ++i) times.push_back(static_cast<double>(i));
  std::vector<std::vector<PolarityCounts>> rows(static_cast<std::size_t>(size.height));
  for_each_index(rows.size(), threads, [&](std::size_t y) {
    const auto intensity = [&](std::size_t image, int, std::span<float> row) {
      const std::size_t frame = image < steps_before ? steps_before - image : image - steps_before;
      std::ranges::transform(std::span(video.frames[frame].pixels).subspan(y * width, width),
                             row.begin(),
                             [](std::uint8_t u) { return static_cast<float>(u) / 255.0f; });
    };
    rows[y].resize(steps_before + steps);
    for (const Event& event : pixel_events(sensor, {1, size.width}, intensity, times,
                                           CounterRandom(kSeed).keyed(std::to_string(y)))) {
      ++rows[y][static_cast<std::size_t>(std::ceil(event.t_s)) - 1][event.positive ? 0 : 1];
    }
  });
  for (const auto& [first, last] : video.pairs) {
    PolarityCounts& of_pair = counts.emplace_back();
    for (const std::vector<PolarityCounts>& row : rows) {
      for (std::size_t step = steps_before + first; step < steps_before + last; ++step) {
        for (const std::size_t p : {0, 1}) of_pair[p] += row[step][p];
      }
    }
  }
}

double pixel_seconds(const IntervalFrames& frames) {
  return static_cast<double>(frames.previous.size.pixel_count()) * frames.duration_s;
}

/// The events that are not noise, as far as rates tell.
IntervalFrames without_noise(IntervalFrames frames, const NoiseFit& noise) {
  const auto less = [&](std::int64_t count, double rate_hz) {
    const double rest = static_cast<double>(count) - rate_hz * pixel_seconds(frames);
    return static_cast<std::int64_t>(std::llround(std::max(rest, 0.0)));
  };
  const std::int64_t negative = less(frames.event_count - frames.positive_count, noise.negative_hz);
  frames.positive_count = less(frames.positive_count, noise.positive_hz);
  frames.event_count = frames.positive_count + negative;
  return frames;
}

/// What is made of pairs with thresholds around one: how it would be fitted to some of them.
class Sensitivity {
 public:
  using Made = std::function<std::vector<PolarityCounts>(double factor)>;

  /// `made(factor)`: of each pair what is made with a threshold so many times the fitted one.
  explicit Sensitivity(const Made& made) {
    for (int step = -kSteps; step <= kSteps; ++step) {
      factors_.push_back(std::exp2(static_cast<double>(step) / kSteps));
      counts_.push_back(made(factors_.back()));
    }
  }

  /// The factor with which as many events of the polarities are made of the drawn pairs as wanted.
  double factor(std::span<const std::size_t> draw, double wanted,
                std::initializer_list<std::size_t> polarities) const {
    double last = 0;
    for (std::size_t step = 0; step < factors_.size(); ++step) {
      double made = 0;
      for (const std::size_t pair : draw) {
        for (const std::size_t polarity : polarities) made += counts_[step][pair][polarity];
      }
      if (made <= wanted) {
        if (step == 0) break;
        const double share = last > made ? (last - wanted) / (last - made) : 1;
        return factors_[step - 1] * std::pow(factors_[step] / factors_[step - 1], share);
      }
      last = made;
    }
    return last > wanted ? factors_.back() : factors_.front();
  }

 private:
  static constexpr int kSteps = 6;  // from half the threshold to twice of it
  std::vector<double> factors_;
  std::vector<std::vector<PolarityCounts>> counts_;  // by factor, then pair
};

/// Beyond this share of the threshold another past of the scene is worth a warning.
constexpr double kMostOfThePast = 0.1;

double event_sum(const std::vector<PolarityCounts>& counts) {
  double sum = 0;
  for (const auto& [positive, negative] : counts) sum += positive + negative;
  return sum;
}

class Fitter {
 public:
  Fitter(std::span<const IntervalFrames> frames, int threads, SensorFit& fit)
      : frames_(frames), threads_(threads), fit_(fit) {}

  /// `videos`: those of the pairs.
  std::optional<FittedThreshold> difference(std::span<const Video> videos) const {
    const auto made = [&](const SensorSpec& sensor, bool goes_back_first = false) {
      std::vector<PolarityCounts> counts;
      for (const Video& video : videos) {
        add_video_events(video, sensor, goes_back_first, threads_, counts);
      }
      return counts;
    };
    const auto sensor_of = [](double threshold) {
      return realism_sensor({threshold}, kFrameLogEpsilon);
    };
    std::vector<std::size_t> all(frames_.size());
    std::iota(all.begin(), all.end(), std::size_t{0});
    const double camera = event_sum({wanted(all)});
    const double threshold =
        fitted_threshold(camera, [&](double tried) { return event_sum(made(sensor_of(tried))); });
    if (is_at_end(threshold, {kLeastFittedThreshold, kMostFittedThreshold})) {
      warn(fmt::format("no threshold of difference in {}..{} makes as many events as the camera",
                       kLeastFittedThreshold, kMostFittedThreshold));
      return std::nullopt;
    }
    const Sensitivity sensitivity(
        [&](double factor) { return made(sensor_of(factor * threshold)); });
    FittedThreshold fitted{{threshold}, {}, {}};
    fitted.mean = bootstrap_bounds(frames_.size(), [&](std::span<const std::size_t> draw) {
      return threshold * sensitivity.factor(draw, event_sum({wanted(draw)}), {0, 1});
    });
    // Not known are what the pixels saw before the first frame, and how much they differ.
    const double count = event_sum(made(sensor_of(threshold)));
    const auto refitted = [&](const std::vector<PolarityCounts>& counts) {
      return threshold * sensitivity.factor(all, camera * count / event_sum(counts), {0, 1});
    };
    SensorSpec alike = sensor_of(threshold);
    alike.threshold_spread = 0;
    const double of_another_past = refitted(made(sensor_of(threshold), true));
    const double unknown =
        std::abs(of_another_past - threshold) + std::abs(refitted(made(alike)) - threshold);
    fitted.mean.low -= unknown;
    fitted.mean.high += unknown;
    if (frames_.size() >= 3 && std::abs(of_another_past - threshold) > kMostOfThePast * threshold) {
      warn(
          fmt::format("the threshold of difference is {:.3g} if pixels saw nothing before the "
                      "first frame, {:.3g} if they saw the frames backwards: {:.2g} events a pixel "
                      "and pair are too few to decide; record longer, or more motion",
                      threshold, of_another_past, camera / pixels()));
    }
    return fitted;
  }

  /// None: no threshold makes as many.
  std::optional<double> difference_anew() const {
    const double threshold = fitted_threshold(simulated_scene(GeneratorKind::kDifference), frames_,
                                              kFrameLogEpsilon, kSeed, threads_);
    if (is_at_end(threshold, {kLeastFittedThreshold, kMostFittedThreshold})) return std::nullopt;
    return threshold;
  }

  std::optional<FittedThreshold> network(const Generator& generator) const {
    const ThresholdRange range = generator.thresholds().value();
    const ContrastThreshold threshold = fitted_threshold(generator, frames_, threads_);
    if (is_at_end(threshold.positive(), range) || is_at_end(threshold.negative(), range)) {
      warn(
          fmt::format("no threshold in {:.3g}..{:.3g}, which the network has learnt, makes as "
                      "many events as the camera: the document can only have that of difference",
                      range.lowest, range.highest));
      return std::nullopt;
    }
    const auto [least, most] = ThresholdSpec::kRatios;
    if (threshold.ratio < least || threshold.ratio > most) {
      warn(fmt::format(
          "no threshold through the network, since the negative one is {:.3g} times "
          "the positive one, expected {}..{}: the document can only have that of difference",
          threshold.ratio, least, most));
      return std::nullopt;
    }
    const Sensitivity sensitivity([&](double factor) {
      return made_events(generator, frames_, {factor * threshold.mean, threshold.ratio}, threads_);
    });
    const auto factors = [&](std::span<const std::size_t> draw) {
      const auto [positive, negative] = wanted(draw);
      return std::pair(sensitivity.factor(draw, positive, {0}),
                       sensitivity.factor(draw, negative, {1}));
    };
    FittedThreshold fitted{threshold, {}, {}};
    fitted.mean = bootstrap_bounds(frames_.size(), [&](std::span<const std::size_t> draw) {
      const auto [positive, negative] = factors(draw);
      return threshold.mean * std::sqrt(positive * negative);
    });
    fitted.ratio = bootstrap_bounds(frames_.size(), [&](std::span<const std::size_t> draw) {
      const auto [positive, negative] = factors(draw);
      return threshold.ratio * negative / positive;
    });
    return fitted;
  }

 private:
  PolarityCounts wanted(std::span<const std::size_t> draw) const {
    PolarityCounts counts{};
    for (const std::size_t pair : draw) {
      counts[0] += static_cast<double>(frames_[pair].positive_count);
      counts[1] += static_cast<double>(frames_[pair].event_count - frames_[pair].positive_count);
    }
    return counts;
  }

  double pixels() const {
    double pixels = 0;
    for (const IntervalFrames& frames : frames_) {
      pixels += static_cast<double>(frames.previous.size.pixel_count());
    }
    return pixels;
  }

  void warn(std::string text) const { fit_.warnings.push_back(std::move(text)); }

  std::span<const IntervalFrames> frames_;
  int threads_;
  SensorFit& fit_;
};

/// The camera's events of the kept pairs beside those that are made of them, a pixel.
std::vector<EventRow> compare(const std::vector<IntervalFrames>& kept, const Generator* network,
                              const SensorFit& fit, int threads) {
  double pixels = 0, camera = 0, noise = 0;
  for (const IntervalFrames& frames : kept) {
    pixels += static_cast<double>(frames.previous.size.pixel_count());
    camera += static_cast<double>(frames.event_count);
    if (fit.noise) {
      noise += (fit.noise->positive_hz + fit.noise->negative_hz) * pixel_seconds(frames);
    }
  }
  std::vector<EventRow> rows{{"camera", camera / pixels}};
  const auto difference = [&](double threshold) {
    return event_sum(made_events(simulated_scene(GeneratorKind::kDifference), kept,
                                 realism_sensor({threshold}, kFrameLogEpsilon), kSeed, threads));
  };
  const auto through_network = [&](const ContrastThreshold& threshold) {
    return event_sum(made_events(*network, kept, threshold, threads));
  };
  if (fit.difference_anew) {
    rows.push_back({"difference, fitted", (difference(*fit.difference_anew) + noise) / pixels});
  }
  rows.push_back({"difference, default", difference(SensorSpec().positive_threshold) / pixels});
  if (!network) return rows;
  if (fit.network) {
    rows.push_back({"network, fitted", (through_network(fit.network->threshold) + noise) / pixels});
  }
  const double middle = network->thresholds()->geometric_mean();
  rows.push_back({"network, default", through_network({middle}) / pixels});
  return rows;
}

double mean_level(const GreyImage& image) {
  return std::accumulate(image.pixels.begin(), image.pixels.end(), 0.0) /
         static_cast<double>(image.pixels.size());
}

void describe_light(const std::vector<IntervalFrames>& frames, SensorFit& fit) {
  std::vector<double> levels;
  for (const IntervalFrames& pair : frames) levels.push_back(mean_level(pair.previous));
  fit.grey_level =
      std::accumulate(levels.begin(), levels.end(), 0.0) / static_cast<double>(levels.size());
  std::ranges::sort(levels);
  fit.grey_levels = {quantile(levels, 0.1), quantile(levels, 0.9)};
}

/// Noise that a document can tell, or none and why.
std::optional<NoiseFit> checked_noise(std::optional<NoiseFit> noise,
                                      std::vector<std::string>& warnings) {
  if (!noise) {
    warnings.emplace_back("no noise, since no pair of frames has 100 pixels that stay still");
    return noise;
  }
  const double most_hz = std::max(noise->noise.shot_hz[1], noise->noise.leak_hz[1]);
  if (most_hz <= kMostNoise_hz) return noise;
  warnings.push_back(fmt::format(
      "no noise, since pixels that stay still have {:.3g} events a second, expected at most {}",
      most_hz, kMostNoise_hz));
  return std::nullopt;
}

}  // namespace

SensorFit fit_sensor(std::span<const FitPart> parts, const Generator* network,
                     const std::vector<int>& gaps, int threads) {
  SensorFit fit;
  std::vector<ChosenPairs> pairs;
  std::vector<std::vector<StillPixels>> still;
  const std::size_t most = std::max<std::size_t>(kMostPairs / parts.size(), 1);
  for (const FitPart& part : parts) {
    pairs.push_back(choose_pairs_of(part, gaps, most));
    still.push_back(still_pixels_of(*part.recording, pairs.back().fitted));
  }
  fit.noise = checked_noise(fit_noise(still), fit.warnings);
  std::vector<IntervalFrames> fitted, kept;
  std::vector<Video> videos;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const std::span<const std::uint8_t> hot = fit.noise
                                                  ? std::span<const std::uint8_t>(fit.noise->hot[i])
                                                  : std::span<const std::uint8_t>();
    read_pairs(parts[i], pairs[i].fitted, hot, fitted);
    videos.push_back(read_video(parts[i], pairs[i].fitted));
    read_pairs(parts[i], pairs[i].kept, hot, kept);
  }
  const auto has_events = [&] {
    return std::ranges::any_of(fitted, [](const auto& pair) { return pair.event_count > 0; });
  };
  // Not one in all that time: a camera that was covered or off, or a file that lost them.
  if (fit.noise && fit.noise->hot_pixels == 0 && !has_events()) {
    fit.noise.reset();
    fit.warnings.emplace_back("no noise, since the recordings have no events between these frames");
  }
  fit.fitted_pairs = fitted.size();
  fit.kept_pairs = kept.size();
  describe_light(fitted, fit);
  if (fit.noise) {
    for (IntervalFrames& frames : fitted) frames = without_noise(std::move(frames), *fit.noise);
  }
  if (has_events()) {
    const Fitter fitter(fitted, threads, fit);
    fit.difference = fitter.difference(videos);
    if (fit.difference) fit.difference_anew = fitter.difference_anew();
    if (network) fit.network = fitter.network(*network);
    if (fitted.size() < 3) {
      fit.warnings.emplace_back("fewer than 3 pairs of frames do not tell how sure a threshold is");
    }
  } else {
    fit.warnings.emplace_back("no threshold, since the camera has no events that are no noise");
  }
  if (!kept.empty()) fit.rows = compare(kept, network, fit, threads);
  return fit;
}

namespace {

double three_digits(double number) { return std::stod(fmt::format("{:.3g}", number)); }

std::array<double, 2> three_digits(const std::array<double, 2>& range) {
  return {three_digits(range[0]), three_digits(range[1])};
}

}  // namespace

std::optional<bool> SensorFit::is_better(const std::string& method) const {
  const auto off = [&](const char* which) -> std::optional<double> {
    const auto row = std::ranges::find(rows, method + which, &EventRow::name);
    if (row == rows.end() || !(row->events_per_pixel > 0)) return std::nullopt;
    return std::abs(std::log(row->events_per_pixel / rows.front().events_per_pixel));
  };
  const auto fitted = off(", fitted"), usual = off(", default");
  if (!fitted || !usual || !std::isfinite(*fitted)) return std::nullopt;
  return *fitted < *usual;
}

CameraSensor SensorFit::sensor(const std::string& name, const std::string& origin,
                               const std::string& weights) const {
  const auto told = [](const FittedThreshold& fitted) {
    const double mean = three_digits(fitted.threshold.mean);
    return ThresholdSpec{{mean, mean}, three_digits(fitted.threshold.ratio)};
  };
  CameraSensor sensor{.name = name, .threshold = {}, .network = {}, .noise = {}, .origin = origin};
  if (difference_anew && is_better("difference") != false) {
    sensor.threshold = told({{*difference_anew}, {}, {}});
  }
  if (network && is_better("network") != false)
    sensor.network = NetworkThreshold{weights, told(*network)};
  if (noise) {
    sensor.noise = NoiseSpec{three_digits(noise->noise.shot_hz), three_digits(noise->noise.leak_hz),
                             three_digits(noise->noise.hot_pixels)};
  }
  return sensor;
}

}  // namespace eventgan
