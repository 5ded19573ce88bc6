#include "stages/frames/decoding/source_flow.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "manifests/values/still_motion.h"
#include "stages/base/images/image_file.h"
#include "stages/frames/decoding/prepared_frame.h"

namespace eventgan {

SourceFlow read_flow_image(const std::filesystem::path& file, const std::string& place,
                           double steps_per_px) try {
  const WideFrame image = decode_wide_image(open_image_file(file));
  const std::size_t pixels = image.size.pixel_count();
  SourceFlow flow{
      place, image.size, {std::vector<float>(2 * pixels), std::vector<std::uint8_t>(pixels)}};
  for (std::size_t i = 0; i < pixels; ++i) {
    const std::uint16_t* const bgr = &image.bgr[3 * i];
    if (bgr[0] == 0) continue;
    flow.flow.valid[i] = 1;
    flow.flow.px[i] = static_cast<float>((bgr[2] - 32768) / steps_per_px);
    flow.flow.px[pixels + i] = static_cast<float>((bgr[1] - 32768) / steps_per_px);
  }
  return flow;
} catch (const std::runtime_error& error) {
  throw std::runtime_error(fmt::format("{}, in {}", error.what(), place));
}

namespace {

PixelFlow placed(const SourceFlow& flow, const Placement& placement) {
  const VisiblePart part = visible_part(placement);
  const AffineMap to_source = inverse(placement.source_to_volume());
  const std::size_t pixels = placement.volume.pixel_count();
  const std::size_t source_pixels = flow.size.pixel_count();
  PixelFlow placed{std::vector<float>(2 * pixels), std::vector<std::uint8_t>(pixels)};
  const auto nearest = [](double place, int count) {
    return static_cast<std::size_t>(std::clamp(place, 0.0, count - 1.0) + 0.5);
  };
  const int right = part.volume_x + part.size.width, bottom = part.volume_y + part.size.height;
  for (int y = part.volume_y; y < bottom; ++y) {
    for (int x = part.volume_x; x < right; ++x) {
      const Point at = mapped(to_source, {double(x), double(y)});
      const std::size_t from =
          nearest(at.y, flow.size.height) * flow.size.width + nearest(at.x, flow.size.width);
      const auto scaled = [](double scale, float px) {
        constexpr double kLargestHalf = 65504;
        return static_cast<float>(std::clamp(scale * px, -kLargestHalf, kLargestHalf));
      };
      const float dx = scaled(placement.scale_x(), flow.flow.px[from]);
      const float dy = scaled(placement.scale_y(), flow.flow.px[source_pixels + from]);
      const std::size_t pixel = static_cast<std::size_t>(y) * placement.volume.width + x;
      placed.px[pixel] = dx;
      placed.px[pixels + pixel] = dy;
      const double to_x = double(x) + dx, to_y = double(y) + dy;
      placed.valid[pixel] = flow.flow.valid[from] != 0 && to_x >= part.volume_x &&
                            to_x <= right - 1 && to_y >= part.volume_y && to_y <= bottom - 1;
    }
  }
  return placed;
}

}  // namespace

Outcome<PixelFlow> true_flow(const Dataset& dataset, const std::string& label_key,
                             const Placement& placement) {
  const Outcome<SourceFlow> flow = dataset.flow(label_key);
  if (is_fault(flow)) return flow.fault();
  if (flow->flow.empty()) return PixelFlow();
  if (flow->size == placement.source) return placed(*flow, placement);
  return SampleFault{fmt::format("expected flow of {}, as the image is, got {}, in {}",
                                 to_string(placement.source), to_string(flow->size), flow->place)};
}

}  // namespace eventgan
