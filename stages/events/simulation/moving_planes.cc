#include "stages/events/simulation/moving_planes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <exception>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "manifests/values/gaussian_random.h"
#include "stages/events/simulation/sensor.h"

namespace eventgan {
namespace {

using Image = std::vector<float>;  ///< [y, x], C order: linear intensity

/// How far of its motion a plane has come at a time.
double progress(const PlaneMotion& motion, double u) {
  return u + motion.acceleration * u * (u - 1);
}

/// q(p, t) of PlaneMotion as a matrix for (x, y, 1).
cv::Matx33d plane_from_pixel(const PlaneMotion& motion, double u) {
  const double s = progress(motion, u);
  const auto& [cx, cy] = motion.centre;
  const cv::Matx33d moved(1 + s * motion.linear[0], s * motion.linear[1], -s * motion.shift_px.x,
                          s * motion.linear[2], 1 + s * motion.linear[3], -s * motion.shift_px.y,
                          s * motion.perspective_per_px.x, s * motion.perspective_per_px.y, 1);
  return cv::Matx33d(1, 0, cx, 0, 1, cy, 0, 0, 1) * moved *
         cv::Matx33d(1, 0, -cx, 0, 1, -cy, 0, 0, 1);
}

cv::Point2d mapped(const cv::Matx33d& matrix, double x, double y) {
  const cv::Vec3d place = matrix * cv::Vec3d(x, y, 1);
  return {place[0] / place[2], place[1] / place[2]};
}

/// A part of the plane: first column and row, and behind the last ones.
struct Extent {
  double left, top, right, bottom;

  std::array<PlanePoint, 4> corners() const {
    return {PlanePoint{left, top}, {right, top}, {left, bottom}, {right, bottom}};
  }
};

template <typename Points>
Extent extent_of(const Points& points) {
  Extent extent{INFINITY, INFINITY, -INFINITY, -INFINITY};
  for (const auto& point : points) {
    extent.left = std::min(extent.left, point.x);
    extent.top = std::min(extent.top, point.y);
    extent.right = std::max(extent.right, point.x);
    extent.bottom = std::max(extent.bottom, point.y);
  }
  return extent;
}

Extent image_extent(ImageSize size) { return {0, 0, size.width - 1.0, size.height - 1.0}; }

/// What the image shows of the plane within [first, last] of u, at both ends.
Extent seen_extent(const PlaneMotion& motion, ImageSize size, double first, double last) {
  std::vector<cv::Point2d> places;
  for (const double u : {first, last}) {
    const cv::Matx33d matrix = plane_from_pixel(motion, u);
    for (const PlanePoint& corner : image_extent(size).corners()) {
      places.push_back(mapped(matrix, corner.x, corner.y));
    }
  }
  return extent_of(places);
}

/// The longest way of the plane's points from frame to frame were they always at their fastest.
double largest_way_px(const Plane& plane, ImageSize size) {
  const cv::Matx33d matrix = plane_from_pixel(plane.motion, 1);
  const Extent extent = plane.outline.empty() ? image_extent(size) : extent_of(plane.outline);
  double largest = 0;
  for (const PlanePoint& corner : extent.corners()) {
    largest = std::max(
        largest, cv::norm(mapped(matrix, corner.x, corner.y) - cv::Point2d(corner.x, corner.y)));
  }
  return largest * (1 + std::abs(plane.motion.acceleration));
}

int steps_for(const PlaneScene& scene) {
  constexpr double kStepPx = 0.7;
  constexpr double kStepRateHz = 500;  // for what changes without motion, where it is cheap
  constexpr double kCheapSteps = 16;
  constexpr double kMostPlaneSteps = 64;
  double steps = std::min(scene.duration_s * kStepRateHz, kCheapSteps);
  for (const Plane& plane : scene.planes) {
    steps = std::max(steps, largest_way_px(plane, scene.size) / kStepPx);
  }
  return static_cast<int>(std::clamp(std::ceil(steps), 1.0, kMostPlaneSteps));
}

/// Linear intensity by grey value, not scaled.
cv::Mat linear_part(const GreyImage& image, const cv::Rect& part, const PlaneTexture& texture) {
  std::array<float, 256> intensity;
  for (int value = 0; value < 256; ++value) {
    intensity[static_cast<std::size_t>(value)] = static_cast<float>(
        std::pow((texture.inverted ? 255 - value : value) / 255.0, texture.exponent));
  }
  cv::Mat result(part.size(), CV_32FC1);
  for (int y = 0; y < part.height; ++y) {
    const std::uint8_t* row =
        image.pixels.data() +
        static_cast<std::size_t>(part.y + y) * static_cast<std::size_t>(image.size.width) + part.x;
    std::transform(row, row + part.width, result.ptr<float>(y),
                   [&](std::uint8_t value) { return intensity[value]; });
  }
  return result;
}

/// The texture on a surface of that size: [y, x] CV_32FC1.
cv::Mat cut_texture(const GreyImage& image, const PlaneTexture& texture, cv::Size size,
                    double blur_px) {
  const double ratio =
      std::min({texture.pixel_ratio, static_cast<double>(image.size.width) / size.width,
                static_cast<double>(image.size.height) / size.height});
  const cv::Size part(std::max(cvRound(ratio * size.width), 1),
                      std::max(cvRound(ratio * size.height), 1));
  const cv::Point place(cvRound(texture.x_place * (image.size.width - part.width)),
                        cvRound(texture.y_place * (image.size.height - part.height)));
  cv::Mat result;
  cv::resize(linear_part(image, cv::Rect(place, part), texture), result, size, 0, 0,
             ratio > 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
  if (texture.flip_x) cv::flip(result, result, 1);
  if (texture.flip_y) cv::flip(result, result, 0);
  if (blur_px > 0) cv::GaussianBlur(result, result, cv::Size(), blur_px);
  constexpr double kDarkest = 0.01;  // a black texture stays dark
  return result * (texture.mean_intensity / std::max(cv::mean(result)[0], kDarkest));
}

/// The inside of a polygon, 0..1, [y, x] CV_32FC1; `origin` is the place of the first pixel.
cv::Mat draw_mask(const std::vector<PlanePoint>& outline, PlanePoint origin, cv::Size size,
                  double blur_px) {
  constexpr int kCornerBits = 4;  // corners in 1/16 px
  std::vector<cv::Point> corners;
  for (const PlanePoint& corner : outline) {
    corners.emplace_back(cvRound((corner.x - origin.x) * (1 << kCornerBits)),
                         cvRound((corner.y - origin.y) * (1 << kCornerBits)));
  }
  cv::Mat mask(size, CV_8UC1, cv::Scalar(0));
  cv::fillPoly(mask, std::vector{corners}, cv::Scalar(255), cv::LINE_AA, kCornerBits);
  cv::Mat result;
  mask.convertTo(result, CV_32F, 1 / 255.0);
  if (blur_px > 0) cv::GaussianBlur(result, result, cv::Size(), blur_px);
  return result;
}

/// A plane's surface, drawn once and looked at under its motion. Bilinear; what lies beyond the
/// surface is its border.
class Surface {
 public:
  Surface(const Plane& plane, std::span<const GreyImage> textures, ImageSize size, double blur_px,
          double first, double last)
      : motion_(plane.motion), is_background_(plane.outline.empty()) {
    const double edge_blur_px = std::hypot(blur_px, plane.softness_px);
    // A shape's border must be clear of it: OpenCV's kernel is 4 standard deviations wide.
    const double margin = is_background_ ? 2 : std::ceil(4 * edge_blur_px) + 3;
    const Extent extent =
        is_background_ ? seen_extent(motion_, size, first, last) : extent_of(plane.outline);
    origin_ = {std::floor(extent.left - margin), std::floor(extent.top - margin)};
    const cv::Size surface(static_cast<int>(std::ceil(extent.right + margin - origin_.x)) + 1,
                           static_cast<int>(std::ceil(extent.bottom + margin - origin_.y)) + 1);
    const cv::Mat intensity =
        cut_texture(textures[plane.texture.image], plane.texture, surface, blur_px);
    if (is_background_) {
      values_ = intensity;
      return;
    }
    const cv::Mat mask = draw_mask(plane.outline, origin_, surface, edge_blur_px);
    cv::merge(std::vector{cv::Mat(intensity.mul(mask)), mask}, values_);
  }

  /// Draws what is seen at u over what lies behind.
  void draw(double u, ImageSize size, Image& image) {
    const cv::Matx33d matrix =
        cv::Matx33d(1, 0, -origin_.x, 0, 1, -origin_.y, 0, 0, 1) * plane_from_pixel(motion_, u);
    const cv::Rect seen =
        is_background_ ? cv::Rect(0, 0, size.width, size.height) : seen_part(matrix, size);
    if (seen.empty()) return;
    places_.resize(seen.width);
    for (int y = seen.y; y < seen.y + seen.height; ++y) {
      find_places(matrix, seen, y);
      float* row = image.data() +
                   static_cast<std::size_t>(y) * static_cast<std::size_t>(size.width) + seen.x;
      is_background_ ? draw_row<1>(row) : draw_row<2>(row);
    }
  }

 private:
  /// Where a row of the image looks: the surface's pixel to the upper left, and how far from it.
  struct Places {
    std::vector<int> index;
    std::vector<float> x_part;
    std::vector<float> y_part;

    void resize(int count) {
      const auto size = static_cast<std::size_t>(count);
      index.resize(size);
      x_part.resize(size);
      y_part.resize(size);
    }
  };

  cv::Rect seen_part(const cv::Matx33d& matrix, ImageSize size) const {
    const cv::Matx33d back = matrix.inv();
    std::vector<cv::Point2d> places;
    for (const auto& corner : Extent{0, 0, values_.cols - 1.0, values_.rows - 1.0}.corners()) {
      places.push_back(mapped(back, corner.x, corner.y));
    }
    const Extent extent = extent_of(places);
    const int left = std::max(cvFloor(extent.left), 0);
    const int top = std::max(cvFloor(extent.top), 0);
    const int right = std::min(cvCeil(extent.right), size.width - 1);
    const int bottom = std::min(cvCeil(extent.bottom), size.height - 1);
    if (right < left || bottom < top) return {};
    return {left, top, right - left + 1, bottom - top + 1};
  }

  void find_places(const cv::Matx33d& m, const cv::Rect& seen, int y) {
    const auto x_start = static_cast<float>(m(0, 0) * seen.x + m(0, 1) * y + m(0, 2));
    const auto y_start = static_cast<float>(m(1, 0) * seen.x + m(1, 1) * y + m(1, 2));
    const auto w_start = static_cast<float>(m(2, 0) * seen.x + m(2, 1) * y + m(2, 2));
    const auto x_step = static_cast<float>(m(0, 0));
    const auto y_step = static_cast<float>(m(1, 0));
    const auto w_step = static_cast<float>(m(2, 0));
    // Just before the last pixel, so that there is one to the right and below.
    const float x_last = static_cast<float>(values_.cols - 1) - 1e-3f;
    const float y_last = static_cast<float>(values_.rows - 1) - 1e-3f;
    const int columns = values_.cols;
    int* index = places_.index.data();
    float* x_part = places_.x_part.data();
    float* y_part = places_.y_part.data();
    for (int i = 0; i < seen.width; ++i) {
      const auto step = static_cast<float>(i);
      const float scale = 1 / (w_start + step * w_step);
      const float x = std::min(std::max((x_start + step * x_step) * scale, 0.0f), x_last);
      const float place_y = std::min(std::max((y_start + step * y_step) * scale, 0.0f), y_last);
      const int column = static_cast<int>(x);
      const int row = static_cast<int>(place_y);
      index[i] = row * columns + column;
      x_part[i] = x - static_cast<float>(column);
      y_part[i] = place_y - static_cast<float>(row);
    }
  }

  template <int kChannels>
  void draw_row(float* target) const {
    const float* values = values_.ptr<float>();
    const int below = kChannels * values_.cols;
    for (std::size_t i = 0; i < places_.index.size(); ++i) {
      const float* place = values + kChannels * places_.index[i];
      const auto sampled = [&](int channel) {
        const float* v = place + channel;
        const float upper = v[0] + places_.x_part[i] * (v[kChannels] - v[0]);
        const float lower = v[below] + places_.x_part[i] * (v[below + kChannels] - v[below]);
        return upper + places_.y_part[i] * (lower - upper);
      };
      if constexpr (kChannels == 1) {
        target[i] = std::max(sampled(0), 0.0f);
      } else {
        target[i] = std::max(sampled(0) + (1 - sampled(1)) * target[i], 0.0f);
      }
    }
  }

  PlaneMotion motion_;
  bool is_background_;
  PlanePoint origin_;
  cv::Mat values_;  ///< [y, x] CV_32F: intensity; of a shape, intensity · mask and mask
  Places places_;
};

/// The scene's light at any time of [first, last], u.
class Renderer {
 public:
  Renderer(const PlaneScene& scene, std::span<const GreyImage> textures, double first, double last)
      : size_(scene.size), light_change_(scene.light_change) {
    for (const Plane& plane : scene.planes) {
      surfaces_.emplace_back(plane, textures, scene.size, scene.optics_blur_px, first, last);
    }
  }

  Image render(double u) {
    Image image(size_.pixel_count());
    for (Surface& surface : surfaces_) surface.draw(u, size_, image);
    if (light_change_ != 0) {
      const auto light = static_cast<float>(1 + light_change_ * u);
      for (float& value : image) value *= light;
    }
    return image;
  }

 private:
  ImageSize size_;
  double light_change_;
  std::vector<Surface> surfaces_;
};

/// dV/dt = (I - V) / τ for an intensity that is linear from one image to the next.
class LowPass {
 public:
  /// Starts at `image` with `late`, what was seen about τ before: V(t) = I(t - τ) for a steady
  /// change.
  LowPass(double cutoff_hz, Image image, Image late)
      : tau_s_(1 / (2 * std::numbers::pi * cutoff_hz)),
        image_(std::move(image)),
        value_(std::move(late)) {}

  const Image& value() const { return value_; }

  void step(const Image& image, double duration_s) {
    const double ratio = duration_s / tau_s_;
    const double kept = std::exp(-ratio);
    const double mean_kept = -std::expm1(-ratio) / ratio;
    const auto old_value = static_cast<float>(kept);
    const auto old_image = static_cast<float>(mean_kept - kept);
    const auto new_image = static_cast<float>(1 - mean_kept);
    for (std::size_t i = 0; i < image.size(); ++i) {
      value_[i] = old_value * value_[i] + old_image * image_[i] + new_image * image[i];
    }
    image_ = image;
  }

 private:
  double tau_s_;
  Image image_;
  Image value_;
};

/// What a pixel's level was set to last if now it sees `image`.
Image earlier_levels(Image image, const PlaneScene& scene, CounterRandom random) {
  const auto epsilon = static_cast<float>(scene.sensor.log_epsilon);
  for (std::size_t pixel = 0; pixel < image.size(); ++pixel) {
    const double part = random.uniform(2 * pixel) + random.uniform(2 * pixel + 1) - 1;
    const double threshold =
        part > 0 ? scene.sensor.positive_threshold : scene.sensor.negative_threshold;
    const auto change = static_cast<float>(part * threshold * scene.level_spread);
    image[pixel] = std::max((image[pixel] + epsilon) * std::exp(-change) - epsilon, 0.0f);
  }
  return image;
}

/// The mean over an exposure of images at steps -half..half, by the trapezoid rule.
class Exposure {
 public:
  Exposure(int half_steps, std::size_t pixel_count) : half_steps_(half_steps), sum_(pixel_count) {}

  /// Looks only at images within.
  void add(const Image& image, int step) {
    const int distance = std::abs(step);
    if (distance > half_steps_) return;
    const float weight = half_steps_ == 0 ? 1.0f
                                          : (distance == half_steps_ ? 0.5f : 1.0f) /
                                                (2 * static_cast<float>(half_steps_));
    for (std::size_t i = 0; i < sum_.size(); ++i) sum_[i] += weight * image[i];
  }

  GreyImage frame(const PlaneScene& scene, CounterRandom random) const {
    GreyImage frame{scene.size, std::vector<std::uint8_t>(sum_.size())};
    const auto gain = static_cast<float>(scene.gain);
    const auto gamma = static_cast<float>(scene.gamma);
    for (std::size_t pixel = 0; pixel < sum_.size(); ++pixel) {
      const double level = 255 * std::min(gain * std::pow(sum_[pixel], gamma), 1.0f) +
                           gaussian(random, pixel, scene.read_noise_levels);
      frame.pixels[pixel] = static_cast<std::uint8_t>(std::lround(std::clamp(level, 0.0, 255.0)));
    }
    return frame;
  }

 private:
  int half_steps_;
  Image sum_;
};

void check(const PlaneScene& scene, std::span<const GreyImage> textures) {
  if (scene.size.height < 1 || scene.size.width < 1 || !(scene.duration_s > 0) ||
      !std::isfinite(scene.duration_s) || scene.planes.empty() ||
      !scene.planes.front().outline.empty()) {
    throw std::invalid_argument("expected a scene with a background, got " + to_string(scene.size) +
                                ", " + std::to_string(scene.planes.size()) + " planes, " +
                                std::to_string(scene.duration_s) + " s");
  }
  for (const Plane& plane : scene.planes) {
    if (plane.texture.image >= textures.size()) {
      throw std::invalid_argument("expected a texture below " + std::to_string(textures.size()) +
                                  ", got " + std::to_string(plane.texture.image));
    }
    const GreyImage& image = textures[plane.texture.image];
    if (image.pixels.empty() || image.pixels.size() != image.size.pixel_count()) {
      throw std::invalid_argument("expected an image as texture, got " + to_string(image.size) +
                                  " with " + std::to_string(image.pixels.size()) + " pixels");
    }
  }
}

SimulatedPair simulate(const PlaneScene& scene, std::span<const GreyImage> textures,
                       CounterRandom random) {
  const int steps = steps_for(scene);
  const int half_exposure = static_cast<int>(std::lround(0.5 * scene.exposure * steps));
  const double step_s = scene.duration_s / steps;
  const double begin = -static_cast<double>(half_exposure) / steps;
  // Where the low-pass has been before: half a duration back at most, to stay on the surfaces.
  const double lag_s = scene.cutoff_hz > 0 ? 1 / (2 * std::numbers::pi * scene.cutoff_hz) : 0;
  const double first = std::min(std::max(begin - lag_s / scene.duration_s, -0.5), begin);
  Renderer renderer(scene, textures, first, 1 - begin);

  SimulatedPair pair{{}, {}, {}, scene.duration_s, 0};
  Exposure previous(half_exposure, scene.size.pixel_count());
  Exposure next(half_exposure, scene.size.pixel_count());
  Sensor sensor(scene.sensor, scene.size, random.keyed("sensor"));
  std::optional<LowPass> low_pass;
  for (int step = -half_exposure; step <= steps + half_exposure; ++step) {
    const Image image = renderer.render(static_cast<double>(step) / steps);
    previous.add(image, step);
    next.add(image, step - steps);
    if (step > steps) continue;
    const double t_s = step == steps ? scene.duration_s : step * step_s;
    if (step == -half_exposure) {
      if (scene.cutoff_hz > 0) low_pass.emplace(scene.cutoff_hz, image, renderer.render(first));
      const Image& seen = low_pass ? low_pass->value() : image;
      sensor.step(earlier_levels(seen, scene, random.keyed("levels")), t_s - step_s);
      sensor.step(seen, t_s);
      continue;
    }
    if (low_pass) low_pass->step(image, step_s);
    const std::vector<Event> events = sensor.step(low_pass ? low_pass->value() : image, t_s);
    if (step > 0) pair.events.insert(pair.events.end(), events.begin(), events.end());
  }
  pair.previous = previous.frame(scene, random.keyed("previous"));
  pair.next = next.frame(scene, random.keyed("next"));
  const double positive = scene.sensor.positive_threshold;
  const double negative = scene.sensor.negative_threshold;
  pair.threshold = {scene.gamma * std::sqrt(positive * negative), negative / positive};
  return pair;
}

}  // namespace

SimulatedPair simulate_plane_scene(const PlaneScene& scene, std::span<const GreyImage> textures,
                                   CounterRandom random) {
  check(scene, textures);
  try {
    return simulate(scene, textures, random);
  } catch (const cv::Exception&) {
    std::throw_with_nested(std::runtime_error("moving planes failed in OpenCV"));
  }
}

SimulatedPair simulate_planes(std::span<const GreyImage> textures, ImageSize size,
                              CounterRandom random) {
  return simulate_plane_scene(draw_plane_scene(textures.size(), size, random), textures,
                              random.keyed("simulation"));
}

}  // namespace eventgan
