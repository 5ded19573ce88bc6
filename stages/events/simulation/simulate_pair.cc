#include "stages/events/simulation/simulate_pair.h"

#include <span>
#include <stdexcept>
#include <utility>

#include "stages/events/simulation/affine_motion.h"
#include "stages/events/simulation/sensor.h"

namespace eventgan {

namespace {

/// When image `step` of an interval is seen.
double step_time_s(int step, int steps, double from_s, double to_s) {
  const double part = static_cast<double>(step) / steps;
  return step == steps ? to_s : from_s + (to_s - from_s) * part;
}

}  // namespace

void feed_interval(Sensor& sensor, const Interval& interval, double from_s, double to_s,
                   std::vector<Event>& events) {
  const int steps = interval.steps();
  for (int step = 1; step <= steps; ++step) {
    const std::vector<Event> seen =
        sensor.step(interval.render(step), step_time_s(step, steps, from_s, to_s));
    events.insert(events.end(), seen.begin(), seen.end());
  }
}

namespace {

class FadeInterval final : public Interval {
 public:
  FadeInterval(GreyImage previous, GreyImage next)
      : previous_(std::move(previous)), next_(std::move(next)) {}
  ImageSize size() const override { return previous_.size; }
  int steps() const override { return 1; }
  std::vector<float> render(int step) const override {
    return linear_intensity(step == 0 ? previous_ : next_);
  }
  FlowDisplacement flow() const override { return {}; }

 private:
  GreyImage previous_;
  GreyImage next_;
};

}  // namespace

std::unique_ptr<Interval> fade_between(GreyImage previous, GreyImage next) {
  return std::make_unique<FadeInterval>(std::move(previous), std::move(next));
}

std::vector<Event> simulate_affine(const GreyImage& image, double max_displacement_px,
                                   const SensorSpec& sensor, double duration_s,
                                   CounterRandom random) {
  const double displacement_px = max_displacement_px * random.keyed("displacement").uniform(0);
  const AffineInterval interval(
      image, random_affine_motion(image.size, displacement_px, random.keyed("motion")));
  std::vector<double> times_s;
  for (int step = 0; step <= interval.steps(); ++step) {
    times_s.push_back(step_time_s(step, interval.steps(), 0, duration_s));
  }
  const auto row = [&](std::size_t step, int y, std::span<float> intensity) {
    interval.render_row(static_cast<int>(step), y, intensity);
  };
  return pixel_events(sensor, image.size, row, times_s, random.keyed("sensor"));
}

std::vector<Event> simulate_images(const std::vector<GreyImage>& images, const SensorSpec& sensor,
                                   double duration_s, CounterRandom random) {
  const ImageSize size = images.at(0).size;
  const int steps = static_cast<int>(images.size()) - 1;
  std::vector<double> times_s;
  for (const GreyImage& image : images) {
    if (image.size != size) throw std::invalid_argument("expected frames of one size");
    times_s.push_back(step_time_s(static_cast<int>(times_s.size()), steps, 0, duration_s));
  }
  return pixel_events(sensor, images, times_s, random);
}

std::vector<Event> simulate_difference(const GreyImage& previous, const GreyImage& next,
                                       const SensorSpec& sensor, double duration_s,
                                       CounterRandom random) {
  return simulate_images({previous, next}, sensor, duration_s, random);
}

}  // namespace eventgan
