#pragma once

#include <cstdint>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/frames.h"

namespace eventgan {

/// Light in the three channels, 0..255.
struct Colour {
  float blue = 0;
  float green = 0;
  float red = 0;

  Colour operator+(const Colour& other) const {
    return {blue + other.blue, green + other.green, red + other.red};
  }
  Colour operator*(float factor) const { return {blue * factor, green * factor, red * factor}; }
};

/// `share` of `to`, the rest of `from`.
inline Colour mix(const Colour& from, const Colour& to, float share) {
  return from * (1 - share) + to * share;
}

/// A rendered image: [y, x, 3] uint8, channels blue, green, red, C order.
struct Image {
  ImageSize size;
  std::vector<std::uint8_t> bgr;
  bool operator==(const Image&) const = default;
};

Image black_image(ImageSize size);

/// Rounds to 8 bit and stores.
void set_pixel(Image& image, int x, int y, const Colour& colour);

/// A surface pattern without end: random values on a grid of whole numbers, smooth between them. A
/// pure function of the place, so that a moving surface carries its pattern with it.
class Texture {
 public:
  explicit Texture(CounterRandom random) : random_(random) {}

  /// One value per cell of the grid, uniform in [0, 1).
  float cell(int x, int y) const;

  /// Smooth noise in [0, 1) that varies over a distance of about 1.
  float noise(double x, double y) const;

 private:
  CounterRandom random_;
};

}  // namespace eventgan
