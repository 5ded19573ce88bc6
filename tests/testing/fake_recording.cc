#include "tests/testing/fake_recording.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace eventgan::testing {
namespace {

constexpr std::uint8_t kDark = 40;
constexpr std::uint8_t kBright = 200;

bool in_bar(int column, int left, int width) {
  return ((column - left) % width + width) % width < std::max(width / 4, 1);
}

GreyImage bar_frame(ImageSize size, int left) {
  GreyImage frame{size, std::vector<std::uint8_t>(size.pixel_count())};
  for (std::size_t i = 0; i < frame.pixels.size(); ++i) {
    const int column = static_cast<int>(i % static_cast<std::size_t>(size.width));
    frame.pixels[i] = in_bar(column, left, size.width) ? kBright : kDark;
  }
  return frame;
}

/// In column order; without times.
std::vector<Event> changes(const GreyImage& before, const GreyImage& after) {
  std::vector<Event> events;
  for (int x = 0; x < before.size.width; ++x) {
    for (int y = 0; y < before.size.height; ++y) {
      const auto i = static_cast<std::size_t>(y * before.size.width + x);
      if (before.pixels[i] == after.pixels[i]) continue;
      events.push_back({x, y, 0, after.pixels[i] > before.pixels[i]});
    }
  }
  return events;
}

}  // namespace

FakeRecording::FakeRecording(std::vector<GreyImage> frames, std::vector<double> times_s,
                             std::vector<Event> events, std::vector<FlowField> flows)
    : frames_(std::move(frames)),
      times_s_(std::move(times_s)),
      events_(std::move(events)),
      flows_(std::move(flows)) {
  const auto other_size = [&](const GreyImage& frame) { return frame.size != frames_[0].size; };
  if (frames_.empty() || frames_.size() != times_s_.size() ||
      std::ranges::any_of(frames_, other_size) ||
      (!flows_.empty() && flows_.size() + 1 != frames_.size())) {
    throw std::invalid_argument(
        "expected frames of one size, a time for each, a flow for each but the last");
  }
}

std::vector<Event> FakeRecording::events_between(std::int64_t first_frame,
                                                 std::int64_t last_frame) const {
  if (last_frame < first_frame) throw std::out_of_range("expected the earlier frame first");
  const auto begin = std::ranges::upper_bound(events_, frame_time_s(first_frame), {}, &Event::t_s);
  const auto end = std::ranges::upper_bound(events_, frame_time_s(last_frame), {}, &Event::t_s);
  return {begin, end};
}

std::vector<Event> FakeRecording::events_in(double after_s, double until_s) const {
  return {std::ranges::upper_bound(events_, after_s, {}, &Event::t_s),
          std::ranges::upper_bound(events_, until_s, {}, &Event::t_s)};
}

std::vector<Event> FakeRecording::events_around(double time_s, std::int64_t before,
                                                std::int64_t after) const {
  const auto middle = std::ranges::upper_bound(events_, time_s, {}, &Event::t_s);
  return {middle - std::min<std::int64_t>(before, middle - events_.begin()),
          middle + std::min<std::int64_t>(after, events_.end() - middle)};
}

std::optional<std::array<double, 2>> FakeRecording::event_span() const {
  if (events_.empty()) return std::nullopt;
  return std::array{events_.front().t_s, events_.back().t_s};
}

std::optional<FlowField> FakeRecording::flow(std::int64_t index) const {
  if (flows_.empty()) return std::nullopt;
  return flows_.at(at(index));
}

FakeRecording moving_bar_recording(ImageSize size, int frame_count, int step_px,
                                   double interval_s) {
  std::vector<GreyImage> frames;
  std::vector<double> times_s;
  std::vector<Event> events;
  std::vector<FlowField> flows;
  for (int i = 0; i < frame_count; ++i) {
    frames.push_back(bar_frame(size, i * step_px));
    times_s.push_back(i * interval_s);
    if (i == 0) continue;
    std::vector<Event> changed = changes(frames[frames.size() - 2], frames.back());
    for (std::size_t k = 0; k < changed.size(); ++k) {
      const double share = (static_cast<double>(k) + 0.5) / static_cast<double>(changed.size());
      changed[k].t_s = (i - 1 + share) * interval_s;
    }
    events.insert(events.end(), changed.begin(), changed.end());
    flows.push_back({size, std::vector<float>(size.pixel_count(), static_cast<float>(step_px)),
                     std::vector<float>(size.pixel_count(), 0.0f)});
  }
  return {std::move(frames), std::move(times_s), std::move(events), std::move(flows)};
}

}  // namespace eventgan::testing
