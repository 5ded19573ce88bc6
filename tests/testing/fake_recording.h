#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stages/recordings/readers/recording.h"

namespace eventgan::testing {

/// A recording in memory, of the frames, times, events and flows it is given. Nothing about them is
/// checked but that there are as many times as frames and that frames have one size.
class FakeRecording final : public Recording {
 public:
  /// `events` in time order; `flows`: one for each interval between frames, or none at all.
  FakeRecording(std::vector<GreyImage> frames, std::vector<double> times_s,
                std::vector<Event> events, std::vector<FlowField> flows = {});

  void set_name(const std::string& name) { name_ = name; }

  const std::string& name() const override { return name_; }
  ImageSize size() const override { return frames_.front().size; }
  std::int64_t frame_count() const override { return static_cast<std::int64_t>(frames_.size()); }
  double frame_time_s(std::int64_t index) const override { return times_s_.at(at(index)); }
  GreyImage frame(std::int64_t index) const override { return frames_.at(at(index)); }
  std::vector<Event> events_between(std::int64_t first_frame,
                                    std::int64_t last_frame) const override;
  std::vector<Event> events_in(double after_s, double until_s) const override;
  std::vector<Event> events_around(double time_s, std::int64_t before,
                                   std::int64_t after) const override;
  std::optional<std::array<double, 2>> event_span() const override;
  std::optional<FlowField> flow(std::int64_t index) const override;

 private:
  static std::size_t at(std::int64_t index) { return static_cast<std::size_t>(index); }

  std::string name_ = "fake recording";
  std::vector<GreyImage> frames_;
  std::vector<double> times_s_;
  std::vector<Event> events_;
  std::vector<FlowField> flows_;
};

/// Frames `interval_s` apart of a bright bar on dark ground, `step_px` pixels to the right from one
/// to the next (around the border), starting at time 0. In each interval the pixels that turn
/// bright have one positive event and those that turn dark one negative event, in column order,
/// spread evenly over the interval; the flow is `step_px` to the right everywhere.
FakeRecording moving_bar_recording(ImageSize size, int frame_count, int step_px = 2,
                                   double interval_s = 0.05);

}  // namespace eventgan::testing
