#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/events.h"
#include "manifests/values/frames.h"

namespace eventgan {

/// A place in an image or on a plane, in pixels; pixel centres are integers.
struct PlanePoint {
  double x = 0;
  double y = 0;
};

/// What is to be seen on a plane: a part of a photograph, u in 0..255, as linear intensity
///   I = scale (u/255)^exponent,  with the scale that gives the part the mean `mean_intensity`;
/// a part whose mean is below 0.01 before is scaled like one of 0.01, so that black stays dark.
struct PlaneTexture {
  std::size_t image = 0;   ///< which of the textures
  double x_place = 0.5;    ///< where in it the part lies, 0 = at its left end, 1 = at its right
  double y_place = 0.5;    ///< 0 = at its top
  double pixel_ratio = 1;  ///< the photograph's pixels along one of the plane's; less where the
                           ///< photograph is too small for that
  bool flip_x = false;
  bool flip_y = false;
  bool inverted = false;  ///< of 255 - u
  double exponent = 2.2;  ///< above 0; 2.2 undoes a camera's gamma
  double mean_intensity = 0.3;
};

/// A motion as one homography. At the pixel p the image shows the plane's place
///
///   q(p, t) = c + ((I + s G)(p - c) - s d) / (1 + s h·(p - c)),
///   s = u + a u (u - 1),  u = t / duration.
///
/// So it is where it was drawn at the previous frame's time, u = 0, and d px away at the next
/// one's, u = 1. The denominator must stay above 0 on the image. A background is rendered as far as
/// it is seen: memory grows with the way.
struct PlaneMotion {
  PlanePoint centre;                  ///< c
  PlanePoint shift_px;                ///< d
  std::array<double, 4> linear = {};  ///< G, row-major: rotation, zoom, stretch and shear
  PlanePoint perspective_per_px;      ///< h
  double acceleration = 0;            ///< a, -0.5..0.5: the speed is 1 - a at first, 1 + a at last
};

struct Plane {
  PlaneTexture texture;
  PlaneMotion motion;
  std::vector<PlanePoint> outline;  ///< a polygon's corners at u = 0; empty = covers the image
  double softness_px = 0;           ///< standard deviation of the outline's blur
};

/// A camera, frames and events, that looks at moving planes.
struct PlaneScene {
  ImageSize size;
  double duration_s = 0.05;   ///< from the previous frame to the next, above 0
  std::vector<Plane> planes;  ///< each covers those before it; the first one has no outline
  double light_change = 0;    ///< the light is 1 + light_change u, -0.5..1
  double optics_blur_px = 0;  ///< standard deviation of what the lens blurs

  SensorSpec sensor;
  double cutoff_hz = 0;     ///< of the low-pass before the sensor; 0 = none
  double level_spread = 0;  ///< how far from its level, in thresholds, a pixel may start, 0..1

  double exposure = 0;           ///< of a frame, centred on its time; share of the duration, 0..0.6
  double gain = 1;               ///< u = 255 clip(gain I^gamma)
  double gamma = 0.45;           ///< above 0
  double read_noise_levels = 0;  ///< standard deviation in grey levels
};

/// Draws a scene: a background and 0..4 shapes before it that move by about 0.3 to 25 px within
/// 5 to 200 ms; one in twenty shows nothing but noise. A function of its arguments alone: of the
/// textures, of their number. Throws std::invalid_argument if there are no textures or the size is
/// empty. Thread safe.
PlaneScene draw_plane_scene(std::size_t texture_count, ImageSize size, CounterRandom random);

}  // namespace eventgan
