#include "stages/scenes/figure/figure_casting.h"

#include <cmath>

#include "manifests/counter_random.h"

namespace eventgan {

FigureMotion cast_figure(std::uint64_t seed, std::string_view role) {
  const CounterRandom random = CounterRandom(seed).keyed(role);
  const auto between = [&](int counter, double low, double high) {
    return low + (high - low) * random.uniform(static_cast<std::uint64_t>(counter));
  };
  FigureMotion motion;
  const double side = random.uniform(0) < 0.5 ? -1 : 1;  // the way it walks
  motion.start = {-side * between(1, 150, 450), between(2, 900, 980), between(3, 4400, 5000)};
  motion.step = {side * between(4, 8, 15), 0, between(5, -4, 4)};
  motion.heading = side * between(6, 0.3, 1.1);
  motion.phase = between(7, 0, 6.28);
  motion.pace = between(8, 0.09, 0.13);
  motion.waves = random.uniform(9) < 0.7;
  const auto tone = [&](int counter) { return static_cast<float>(between(counter, 60, 210)); };
  motion.clothes = {tone(10), tone(11), tone(12)};
  return motion;
}

FigureMotion seen_from(const FigureMotion& motion, const Vector3& pivot, double angle) {
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  const auto turned = [&](const Vector3& v) {
    return Vector3{c * v.x - s * v.z, v.y, s * v.x + c * v.z};
  };
  FigureMotion seen = motion;
  seen.start = pivot + turned(motion.start - pivot);
  seen.step = turned(motion.step);
  seen.heading = motion.heading + angle;
  return seen;
}

}  // namespace eventgan
