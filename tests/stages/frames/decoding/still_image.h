#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "manifests/values/counter_random.h"
#include "manifests/values/frames.h"
#include "manifests/values/labels.h"

/// What the tests of moving stills draw, and where its objects lie.
namespace eventgan {

/// Grey noise, by which one place is known from another.
inline cv::Mat noise(ImageSize size) {
  const CounterRandom random = CounterRandom(3).keyed("noise");
  cv::Mat image(size.height, size.width, CV_8UC1);
  for (int i = 0; i < size.height * size.width; ++i) {
    image.data[i] = static_cast<std::uint8_t>(random.below(static_cast<std::uint64_t>(i), 256));
  }
  return image;
}

inline Outline outline_around(const Rectangle& box) {
  return {{{{box.left, box.top},
            {box.right, box.top},
            {box.right, box.bottom},
            {box.left, box.bottom}}}};
}

inline Box object_at(const Rectangle& box) {
  return {.class_id = 0, .xyxy = box, .outline = outline_around(box)};
}

/// Whether the pixel's centre lies in the box, made larger on all sides.
inline bool inside(const Rectangle& box, double x, double y, double larger = 0) {
  return x + 0.5 > box.left - larger && x + 0.5 < box.right + larger &&
         y + 0.5 > box.top - larger && y + 0.5 < box.bottom + larger;
}

}  // namespace eventgan
