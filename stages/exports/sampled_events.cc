#include "stages/exports/sampled_events.h"

#include <fmt/core.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>

#include "manifests/values/faults.h"
#include "manifests/values/poisson_random.h"

namespace eventgan {
namespace {

/// The events of one volume on their way.
class Sampling {
 public:
  Sampling(const VolumeShape& shape, double duration_s, const CounterRandom& random)
      : shape_(shape), duration_s_(duration_s), offsets_(random.keyed("offsets")) {}

  /// `count_of(place)`: how many events the value there becomes.
  std::vector<Event> run(const auto& count_of) {
    constexpr std::size_t kTogether = 1024;  // pixels, so that memory is read in its order
    const std::size_t plane = shape_.size.pixel_count();
    std::vector<int> bins(static_cast<std::size_t>(shape_.bins));
    std::vector<int> counts(bins.size() * kTogether);
    for (std::size_t polarity = 0; polarity < 2; ++polarity) {
      for (std::size_t first = 0; first < plane; first += kTogether) {
        const std::size_t pixels = std::min(kTogether, plane - first);
        std::array<int, kTogether> any{};  // of a pixel's bins: most pixels are silent
        for (std::size_t bin = 0; bin < bins.size(); ++bin) {
          const std::size_t place = (polarity * bins.size() + bin) * plane + first;
          for (std::size_t i = 0; i < pixels; ++i) {
            any[i] |= counts[bin * kTogether + i] = count_of(place + i);
          }
        }
        for (std::size_t i = 0; i < pixels; ++i) {
          if (any[i] == 0) continue;
          for (std::size_t bin = 0; bin < bins.size(); ++bin) {
            bins[bin] = counts[bin * kTogether + i];
          }
          take_pixel(first + i, polarity == 0, bins);
        }
      }
    }
    std::ranges::stable_sort(events_, {}, &Event::t_s);
    return std::move(events_);
  }

 private:
  void add(std::size_t pixel, bool positive, double bin) {
    const auto width = static_cast<std::size_t>(shape_.size.width);
    const double share = shape_.bins > 1 ? bin / (shape_.bins - 1) : 0;
    events_.push_back({static_cast<int>(pixel % width), static_cast<int>(pixel / width),
                       share * duration_s_, positive});
  }

  /// `bins` are counts, and are used up.
  void take_pixel(std::size_t pixel, bool positive, std::vector<int>& bins) {
    const std::size_t last = bins.size() - 1;
    // The first pixel with events in an outermost bin leaves them there.
    const bool anchors_first = !has_first_ && bins.front() > 0;
    const bool anchors_last = !has_last_ && bins.back() > 0;
    has_first_ |= anchors_first;
    has_last_ |= anchors_last;
    // Every second pair of neighbours, then the others with what is left.
    const std::size_t begin = offsets_.bits(draws_++) & 1;
    for (const std::size_t parity : {begin, 1 - begin}) {
      for (std::size_t bin = parity; bin < last; bin += 2) {
        if ((bin == 0 && anchors_first) || (bin + 1 == last && anchors_last)) continue;
        const int pairs = std::min(bins[bin], bins[bin + 1]);
        for (int i = 0; i < pairs; ++i) {
          const double u = 1 - std::sqrt(1 - offsets_.uniform(draws_++));
          add(pixel, positive, static_cast<double>(bin) + u);
          add(pixel, positive, static_cast<double>(bin + 1) - u);
        }
        bins[bin] -= pairs;
        bins[bin + 1] -= pairs;
      }
    }
    for (std::size_t bin = 0; bin <= last; ++bin) {
      for (int i = 0; i < bins[bin]; ++i) add(pixel, positive, static_cast<double>(bin));
    }
  }

  const VolumeShape& shape_;
  double duration_s_;
  CounterRandom offsets_;
  std::uint64_t draws_ = 0;
  bool has_first_ = false;
  bool has_last_ = false;
  std::vector<Event> events_;
};

}  // namespace

std::vector<Event> sample_events(std::span<const float> volume, const VolumeShape& shape,
                                 double duration_s, EventCounts counts,
                                 const CounterRandom& random) {
  double sum = 0;
  for (const float value : volume) sum += value;
  if (!(sum <= kMostSampledEvents)) {
    throw UsageError(fmt::format("expected values of at most {:g} events altogether, got {:g}",
                                 kMostSampledEvents, sum));
  }
  const CounterRandom draws = random.keyed("counts");
  const auto count_of = [&](std::size_t i) {
    if (volume[i] == 0) return 0;
    return counts == EventCounts::kRounded
               ? static_cast<int>(std::lround(volume[i]))
               : static_cast<int>(poisson(volume[i], draws, i, volume.size()));
  };
  return Sampling(shape, duration_s, random).run(count_of);
}

std::string events_text(std::span<const Event> events) {
  std::string text;
  for (const Event& event : events) {
    fmt::format_to(std::back_inserter(text), "{:.9f} {} {} {}\n", event.t_s, event.x, event.y,
                   event.positive ? 1 : 0);
  }
  return text;
}

}  // namespace eventgan
