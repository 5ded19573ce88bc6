#include "stages/events/representation.h"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "manifests/values/faults.h"
#include "stages/events/event_volume.h"

namespace eventgan {
namespace {

constexpr int kHistogramCut = 10;
constexpr std::size_t kLanes = 16;  // of a vector of uint8
constexpr double kErosDecay = 0.3, kErosPeak = 255;

const RepresentationRow& row_of(RepresentationKind kind) {
  return *std::ranges::find(representations(), kind, &RepresentationRow::kind);
}

/// The least and the greatest number of a row.
std::array<double, 2> numbers_allowed(std::string_view symbol) {
  if (symbol == "TAU") return {1e-6, 1e6};
  return {1, symbol == "K" ? 49.0 : 64.0};
}

/// 1 / s; 0 of no time, and of so little that this is infinite.
double per(double duration_s) {
  const double frequency = 1 / duration_s;
  return std::isfinite(frequency) ? frequency : 0;
}

/// Over the voxels that are not 0: mean 0, standard deviation 1.
std::vector<float> normalized(std::vector<float> voxels) {
  double count = 0, sum = 0, squares = 0;
  for (const float value : voxels) {
    count += value != 0;
    sum += value;
    squares += double{value} * value;
  }
  if (count == 0) return voxels;
  const double mean = sum / count;
  const double variance = squares / count - mean * mean;
  // Of voxels that are alike rounding leaves a trace of a variance.
  const double scale = variance > 1e-12 * mean * mean ? 1 / std::sqrt(variance) : 1;
  for (float& value : voxels) {
    if (value != 0) value = static_cast<float>((value - mean) * scale);
  }
  return voxels;
}

std::vector<float> voxels(std::span<const Event> events, int bins, ImageSize size,
                          const std::array<double, 2>& times_s) {
  const std::size_t plane = size.pixel_count();
  const double last = bins - 1, duration_s = times_s[1] - times_s[0];
  const double scale = per(duration_s) * last;
  std::vector<float> voxels(static_cast<std::size_t>(bins) * plane);
  for (const Event& event : events) {
    const double star = std::min((event.t_s - times_s[0]) * scale, last);
    const auto bin = static_cast<std::size_t>(star);
    const auto above = static_cast<float>(star - static_cast<double>(bin));
    const float polarity = event.positive ? 1 : -1;
    float* const voxel = voxels.data() + bin * plane + pixel_of(event, size);
    voxel[0] += polarity * (1 - above);
    if (above > 0) voxel[plane] += polarity * above;
  }
  return voxels;
}

void count_in_bins(std::span<const Event> events, std::size_t bins, ImageSize size,
                   const std::array<double, 2>& times_s, std::span<std::uint8_t> histogram) {
  const std::size_t plane = size.pixel_count();
  const auto bin_count = static_cast<float>(bins);
  const double duration_s = times_s[1] - times_s[0];
  const double scale = per(duration_s);
  for (const Event& event : events) {
    // In float32, as RVT does, which also hides what seconds in double lack of microseconds.
    const auto share = static_cast<float>((event.t_s - times_s[0]) * scale);
    const std::size_t bin =
        std::min(static_cast<std::size_t>(static_cast<std::int64_t>(share * bin_count)), bins - 1);
    std::uint8_t& value =
        histogram[((event.positive ? bins : 0) + bin) * plane + pixel_of(event, size)];
    value = static_cast<std::uint8_t>(value + (value < kHistogramCut));
  }
}

std::vector<float> counts(std::span<const Event> events, ImageSize size) {
  const std::size_t plane = size.pixel_count();
  std::vector<float> counts(2 * plane);
  for (const Event& event : events) {
    counts[(event.positive ? 0 : plane) + pixel_of(event, size)] += 1;
  }
  return counts;
}

std::vector<float> time_surface(std::span<const Event> events, ImageSize size, double tau_s,
                                double end_s) {
  const std::size_t plane = size.pixel_count();
  std::vector<double> last_s(2 * plane, -std::numeric_limits<double>::infinity());
  for (const Event& event : events) {
    last_s[(event.positive ? 0 : plane) + pixel_of(event, size)] = event.t_s;
  }
  std::vector<float> surface(last_s.size());
  std::ranges::transform(last_s, surface.begin(), [&](double t_s) {
    return static_cast<float>(std::exp((t_s - end_s) / tau_s));
  });
  return surface;
}

/// Adds `one`, 0 or 1, to each of kLanes numbers that are below 255: one instruction of a vector.
inline void count_up(std::uint8_t* numbers, const std::uint8_t* one) {
  std::array<std::uint8_t, kLanes> sums;
  std::memcpy(sums.data(), numbers, kLanes);
  for (std::size_t i = 0; i < kLanes; ++i) {
    const std::uint8_t sum = static_cast<std::uint8_t>(sums[i] + one[i]);
    sums[i] = std::max(sum, sums[i]);
  }
  std::memcpy(numbers, sums.data(), kLanes);
}

}  // namespace

const std::vector<RepresentationRow>& representations() {
  using enum RepresentationKind;
  static const std::vector<RepresentationRow> kRows = {
      {kVolume, "volume", "B", "[2 B, H, W]", "float32",
       "sum of max(0, 1 - |b - t*|), t* = (B - 1)(t - t1)/(tN - t1), positive bins, then negative "
       "(EventGAN, Zhu et al. 2019)",
       "EventGAN's trainers, DAVIS detectors"},
      {kVoxel, "voxel", "B", "[B, H, W]", "float32",
       "sum of p max(0, 1 - |b - t*|), p = 1 or -1 (Zhu et al. 2018)", "E2VID, V2V, flow networks"},
      {kNormalizedVoxel, "voxel_normalized", "B", "[B, H, W]", "float32",
       "the same, its values that are not 0 with mean 0 and standard deviation 1 (E2VID, Rebecq et "
       "al. 2019)",
       "E2VID, E-RAFT"},
      {kHistogram, "histogram", "T", "[2 T, H, W]", "uint8",
       "events in bin floor(T (t - t1)/(tN - t1)), at most 10, negative bins, then positive (RVT, "
       "Gehrig and Scaramuzza 2023)",
       "RVT, SSMS, SAST, LEOD"},
      {kCount, "count", "", "[2, H, W]", "float32", "events, positive, then negative",
       "detectors of images"},
      {kTimeSurface, "time_surface", "TAU", "[2, H, W]", "float32",
       "exp(-(tN - t)/TAU) of the last event, positive, then negative, 0 without one; TAU in "
       "seconds (HOTS, Lagorce et al. 2017)",
       "heirs of HOTS and HATS"},
      {kEros, "eros", "K", "[H, W]", "uint8",
       "each event multiplies the K x K pixels around it by 0.3^(1/K) and sets its own to 255 "
       "(EROS, Glover et al.; an even K is the next odd one)",
       "MoveEnet, hpe-core"}};
  return kRows;
}

Representation parse_representation(std::string_view text) {
  const std::size_t colon = std::min(text.find(':'), text.size());
  const auto row =
      std::ranges::find(representations(), text.substr(0, colon), &RepresentationRow::word);
  const auto refuse = [&](const std::string& expected) {
    throw UsageError(fmt::format("expected {}, got \"{}\"", expected, text));
  };
  if (row == representations().end()) {
    std::vector<std::string> words;
    for (const RepresentationRow& each : representations()) {
      words.push_back(std::string(each.word) + (each.number.empty() ? "" : ":") +
                      std::string(each.number));
    }
    refuse(fmt::format("a representation of {}", fmt::join(words, ", ")));
  }
  Representation representation{row->kind, 0};
  if (row->number.empty()) {
    if (colon != text.size()) refuse(fmt::format("{} without a number", row->word));
    return representation;
  }
  const auto [least, most] = numbers_allowed(row->number);
  const std::string_view number = text.substr(std::min(colon + 1, text.size()));
  const auto [end, fault] =
      std::from_chars(number.data(), number.data() + number.size(), representation.number);
  const bool is_whole =
      row->number == "TAU" || std::nearbyint(representation.number) == representation.number;
  if (fault != std::errc() || end != number.data() + number.size() || !is_whole ||
      !(least <= representation.number && representation.number <= most)) {
    refuse(fmt::format("{}:{}, {} from {:g} to {:g}", row->word, row->number, row->number, least,
                       most));
  }
  return representation;
}

int channels_of(const Representation& representation) {
  const int number = static_cast<int>(representation.number);
  switch (representation.kind) {
    case RepresentationKind::kVolume:
    case RepresentationKind::kHistogram:
      return 2 * number;
    case RepresentationKind::kVoxel:
    case RepresentationKind::kNormalizedVoxel:
      return number;
    case RepresentationKind::kCount:
    case RepresentationKind::kTimeSurface:
      return 2;
    case RepresentationKind::kEros:
      return 0;
  }
  throw std::invalid_argument("expected a representation of the table, got another number");
}

std::size_t number_bytes(const Representation& representation) {
  return row_of(representation.kind).dtype == "uint8" ? 1 : sizeof(float);
}

void represent(std::span<const Event> events, const Representation& representation, ImageSize size,
               const std::optional<std::array<double, 2>>& times_s, std::span<std::byte> values) {
  const auto channels = static_cast<std::size_t>(std::max(channels_of(representation), 1));
  const std::size_t numbers = channels * size.pixel_count();
  if (values.size() != numbers * number_bytes(representation)) {
    throw std::invalid_argument(fmt::format("expected room for {} bytes, got {}",
                                            numbers * number_bytes(representation), values.size()));
  }
  std::ranges::fill(values, std::byte{0});
  if (events.empty()) return;
  const auto times = times_s.value_or(std::array{events.front().t_s, events.back().t_s});
  // event_volume checks its events itself.
  if (representation.kind != RepresentationKind::kVolume) check_events(events, size, times);
  const auto write = [&](const std::vector<float>& made) {
    std::memcpy(values.data(), made.data(), values.size());
  };
  const std::span bytes(reinterpret_cast<std::uint8_t*>(values.data()), values.size());
  const int number = static_cast<int>(representation.number);
  switch (representation.kind) {
    case RepresentationKind::kVolume:
      return write(event_volume(events, {number, size}, times));
    case RepresentationKind::kVoxel:
      return write(voxels(events, number, size, times));
    case RepresentationKind::kNormalizedVoxel:
      return write(normalized(voxels(events, number, size, times)));
    case RepresentationKind::kHistogram:
      return count_in_bins(events, static_cast<std::size_t>(number), size, times, bytes);
    case RepresentationKind::kCount:
      return write(counts(events, size));
    case RepresentationKind::kTimeSurface:
      return write(time_surface(events, size, representation.number, times[1]));
    case RepresentationKind::kEros: {
      ErosSurface surface(size, number);
      surface.add(events);
      return surface.write(bytes);
    }
  }
}

ErosSurface::ErosSurface(ImageSize size, int kernel)
    : size_(size),
      kernel_(static_cast<std::size_t>(kernel | 1)),
      stride_(static_cast<std::size_t>(size.width) + kernel_ - 1),
      since_(stride_ * (static_cast<std::size_t>(size.height) + kernel_ - 1) + kLanes, kNever) {
  // With the greatest kernel 255 events leave 0.3^(255 / 49) * 255 = 0.49.
  for (std::size_t i = 0; i < kNever; ++i) {
    const double share =
        std::pow(kErosDecay, static_cast<double>(i) / static_cast<double>(kernel_));
    greys_[i] = static_cast<std::uint8_t>(std::nearbyint(kErosPeak * share));
  }
}

void ErosSurface::add(std::span<const Event> events) {
  // Whole vectors: what lies beyond the kernel gets 0.
  std::array<std::uint8_t, 64> one{};
  std::fill_n(one.begin(), kernel_, std::uint8_t{1});
  const std::size_t centre = kernel_ / 2 * (stride_ + 1);
  for (const Event& event : events) {
    if (event.x < 0 || event.x >= size_.width || event.y < 0 || event.y >= size_.height) {
      throw std::invalid_argument(fmt::format("expected an event inside {} pixels, got x={} y={}",
                                              to_string(size_), event.x, event.y));
    }
    std::uint8_t* const corner =
        since_.data() + static_cast<std::size_t>(event.y) * stride_ + event.x;
    for (std::size_t y = 0; y < kernel_; ++y) {
      for (std::size_t x = 0; x < kernel_; x += kLanes) {
        count_up(corner + y * stride_ + x, one.data() + x);
      }
    }
    corner[centre] = 0;
  }
}

void ErosSurface::write(std::span<std::uint8_t> image) const {
  const std::size_t border = kernel_ / 2;
  for (std::size_t y = 0, i = 0; y < static_cast<std::size_t>(size_.height); ++y) {
    const std::uint8_t* const row = since_.data() + (y + border) * stride_ + border;
    for (std::size_t x = 0; x < static_cast<std::size_t>(size_.width); ++x) {
      image[i++] = greys_[row[x]];
    }
  }
}

}  // namespace eventgan
