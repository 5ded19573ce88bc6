#include "pipeline/simulation/scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "stages/events/simulation/flow_interval.h"

namespace eventgan {
namespace {

using Matrix = std::array<double, 6>;  // row-major 2x3

/// A(u) = I + u (A₁ - I).
Matrix motion_at(const AffineMotion& motion, double u) {
  constexpr Matrix kIdentity = {1, 0, 0, 0, 1, 0};
  Matrix at = kIdentity;
  for (std::size_t i = 0; i < at.size(); ++i) at[i] += u * (motion.matrix[i] - kIdentity[i]);
  return at;
}

std::array<double, 2> moved(const Matrix& m, double x, double y) {
  return {m[0] * x + m[1] * y + m[2], m[3] * x + m[4] * y + m[5]};
}

/// AffineMotion keeps the linear part near the identity, so that it has an inverse.
Matrix inverse(const Matrix& m) {
  const double det = m[0] * m[4] - m[1] * m[3];
  const double a = m[4] / det, b = -m[1] / det, c = -m[3] / det, d = m[0] / det;
  return {a, b, -(a * m[2] + b * m[5]), c, d, -(c * m[2] + d * m[5])};
}

/// The motion from `from` to `to`, both in [0, 1].
class AffinePart final : public Interval {
 public:
  AffinePart(const GreyImage& image, const AffineMotion& motion, double from, double to)
      : image_(image),
        motion_(motion),
        from_(from),
        to_(to),
        steps_(std::max(1, static_cast<int>(std::ceil(
                               (to - from) * largest_displacement(motion, image.size))))) {}

  ImageSize size() const override { return image_.size; }
  int steps() const override { return steps_; }

  std::vector<float> render(int step) const override {
    const double part = static_cast<double>(step) / steps_;
    return render_affine(image_, motion_, from_ + (to_ - from_) * part);
  }

  /// A point seen at y at the start is the image's point x = A(from)⁻¹ y, seen at A(to) x later.
  FlowDisplacement flow() const override {
    const Matrix back = inverse(motion_at(motion_, from_));
    const Matrix forth = motion_at(motion_, to_);
    FlowDisplacement flow{image_.size, {}, {}};
    flow.x_px.reserve(image_.size.pixel_count());
    flow.y_px.reserve(image_.size.pixel_count());
    for (int y = 0; y < image_.size.height; ++y) {
      for (int x = 0; x < image_.size.width; ++x) {
        const auto source = moved(back, x, y);
        const auto target = moved(forth, source[0], source[1]);
        flow.x_px.push_back(static_cast<float>(target[0] - x));
        flow.y_px.push_back(static_cast<float>(target[1] - y));
      }
    }
    return flow;
  }

 private:
  GreyImage image_;
  AffineMotion motion_;
  double from_;
  double to_;
  int steps_;
};

GreyImage rounded(ImageSize size, const std::vector<float>& intensity) {
  GreyImage image{size, std::vector<std::uint8_t>(intensity.size())};
  std::ranges::transform(intensity, image.pixels.begin(), [](float value) {
    return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0f, 1.0f) * 255.0f));
  });
  return image;
}

}  // namespace

AffineScene::AffineScene(GreyImage image, const AffineMotion& motion, int frame_count,
                         double interval_s)
    : image_(std::move(image)),
      motion_(motion),
      frame_count_(frame_count),
      interval_s_(interval_s),
      frame_(rounded(image_.size, render_affine(image_, motion_, 1.0 / frame_count_))) {}

std::unique_ptr<Interval> AffineScene::advance() {
  if (position_ + 1 == frame_count_) return nullptr;
  const double from = static_cast<double>(position_ + 1) / frame_count_;
  const double to = static_cast<double>(position_ + 2) / frame_count_;
  ++position_;
  frame_ = rounded(image_.size, render_affine(image_, motion_, to));
  return std::make_unique<AffinePart>(image_, motion_, from, to);
}

ClipScene::ClipScene(ClipFrames& clip, Between between)
    : clip_(clip), between_(between), frame_(clip.frame(0)) {}

std::unique_ptr<Interval> ClipScene::advance() {
  if (position_ + 1 == clip_.count()) return nullptr;
  GreyImage previous = std::exchange(frame_, clip_.frame(position_ + 1));
  ++position_;
  if (between_ != nullptr) return between_(std::move(previous), frame_);
  return std::make_unique<FlowInterval>(std::move(previous), frame_);
}

}  // namespace eventgan
