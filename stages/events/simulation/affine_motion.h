#pragma once

#include <array>
#include <span>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/frames.h"

namespace eventgan {

/// A random affine motion of a flat image, as the EventGAN paper uses ESIM: every point moves
/// steadily on a straight line from its place at u = 0 to where the matrix takes it at u = 1:
///   x(u) = A(u) x,  A(u) = I + u (A₁ - I);  points outside the image are mirrored (reflect-101).
struct AffineMotion {
  /// A₁, row-major 2x3, previous → next, pixel centres integers:
  /// x' = m0 x + m1 y + m2, y' = m3 x + m4 y + m5.
  std::array<double, 6> matrix = {1, 0, 0, 0, 1, 0};
};

/// Draws a motion whose largest displacement over the image is `displacement_px`: rotation, zoom,
/// stretch and shear about the image's centre, which take a uniformly drawn share of it, and a
/// translation in a uniformly drawn direction, which takes the rest. The linear part is held to
/// ‖A₁ - I‖ ≤ 1/2, so that A(u) is invertible on the smallest image too. Throws
/// std::invalid_argument if the displacement is not finite or below 0. Thread safe.
AffineMotion random_affine_motion(ImageSize size, double displacement_px, CounterRandom random);

/// Largest displacement |A₁ x - x| in pixels over the image, which an affine motion has at one of
/// the corner pixels' centres.
double largest_displacement(const AffineMotion& motion, ImageSize size);

/// The image at u in [0, 1], bilinear with places rounded to 1/32 px, bit for bit as OpenCV 4.6 to
/// 4.10 have it in cv::warpAffine on x86-64. Intensity: [y, x] float32 in [0, 1], C order. Throws
/// std::invalid_argument if the image is empty. Thread safe.
std::vector<float> render_affine(const GreyImage& image, const AffineMotion& motion, double u);

/// Where the pixels of a moved image come from, in 1/1024 px of the still one: column + row, of x
/// and of y.
class AffinePlaces {
 public:
  AffinePlaces(ImageSize size, const AffineMotion& motion, double u);

  /// The moved image, [y, x], or its row y, [x], of the intensity at u = 0. Thread safe.
  std::vector<float> image(std::span<const float> still) const;
  void row(std::span<const float> still, int y, std::span<float> intensity) const;

 private:
  ImageSize size_;
  std::array<double, 6> inverse_;  ///< A(u)⁻¹, as AffineMotion::matrix
  std::vector<int> column_x_;
  std::vector<int> column_y_;
};

/// Motion of one image as images of which no point moves more than 1 px from one to the next.
class AffineInterval {
 public:
  /// Throws std::invalid_argument if the image is empty.
  AffineInterval(const GreyImage& image, const AffineMotion& motion);
  /// Images after the first: max(1, ceil(largest displacement)).
  int steps() const { return static_cast<int>(places_.size()) - 1; }
  /// Row y, [x], of the image at u = step / steps(). Thread safe.
  void render_row(int step, int y, std::span<float> intensity) const;

 private:
  std::vector<float> still_;          ///< intensity at u = 0
  std::vector<AffinePlaces> places_;  ///< of images 0..steps()
};

}  // namespace eventgan
