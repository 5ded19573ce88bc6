#include "stages/events/simulation/simulate_pair.h"

#include <stdexcept>

#include "stages/events/simulation/affine_motion.h"
#include "stages/events/simulation/sensor.h"

namespace eventgan {

void feed_interval(Sensor& sensor, const Interval& interval, double from_s, double to_s,
                   std::vector<Event>& events) {
  const int steps = interval.steps();
  for (int step = 1; step <= steps; ++step) {
    const double part = static_cast<double>(step) / steps;
    const double t_s = step == steps ? to_s : from_s + (to_s - from_s) * part;
    const std::vector<Event> seen = sensor.step(interval.render(step), t_s);
    events.insert(events.end(), seen.begin(), seen.end());
  }
}

std::vector<Event> simulate_interval(const Interval& interval, const SensorSpec& spec,
                                     double duration_s, CounterRandom random) {
  Sensor sensor(spec, interval.size(), random);
  sensor.step(interval.render(0), 0);
  std::vector<Event> events;
  feed_interval(sensor, interval, 0, duration_s, events);
  return events;
}

std::vector<Event> simulate_affine(const GreyImage& image, double max_displacement_px,
                                   const SensorSpec& sensor, double duration_s,
                                   CounterRandom random) {
  const double displacement_px = max_displacement_px * random.keyed("displacement").uniform(0);
  const AffineMotion motion =
      random_affine_motion(image.size, displacement_px, random.keyed("motion"));
  return simulate_interval(AffineInterval(image, motion), sensor, duration_s,
                           random.keyed("sensor"));
}

std::vector<Event> simulate_difference(const GreyImage& previous, const GreyImage& next,
                                       const SensorSpec& spec, double duration_s,
                                       CounterRandom random) {
  if (previous.size != next.size) {
    throw std::invalid_argument("expected two frames of one size");
  }
  Sensor sensor(spec, previous.size, random);
  sensor.step(linear_intensity(previous), 0);
  return sensor.step(linear_intensity(next), duration_s);
}

}  // namespace eventgan
