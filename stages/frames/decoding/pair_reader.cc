#include "stages/frames/decoding/pair_reader.h"

#include <array>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>

#include "stages/frames/decoding/visible_part.h"

namespace eventgan {
namespace {

// Frames of a video kept besides one for each pair under way.
constexpr int kLongestGap = 6;
constexpr int kMargin = 2;

std::string text_of(ImageSize size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

cv::Mat as_grey(const cv::Mat& colour) {
  cv::Mat grey;
  cv::cvtColor(colour, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

/// Grey, resized and blurred, uncut.
cv::Mat prepare(ColourFrame& frame, const Placement& placement, const ImageSpec& spec) {
  cv::Mat picture(frame.size.height, frame.size.width, CV_8UC3, frame.bgr.data());
  if (spec.grey == GreyOrder::kBeforeResize) picture = as_grey(picture);
  cv::Mat resized;
  cv::resize(picture, resized, cv::Size(placement.scaled.width, placement.scaled.height), 0, 0,
             cv::INTER_LINEAR);
  if (spec.grey == GreyOrder::kAfterResize) resized = as_grey(resized);
  if (spec.blur == 0) return resized;
  cv::Mat blurred;
  cv::GaussianBlur(resized, blurred, cv::Size(spec.blur, spec.blur), 0);
  return blurred;
}

void append_input(const cv::Mat& grey, const VisiblePart& part, std::vector<float>& input) {
  for (int y = 0; y < part.size.height; ++y) {
    const std::uint8_t* row = grey.ptr<std::uint8_t>(part.scaled_y + y) + part.scaled_x;
    for (int x = 0; x < part.size.width; ++x) {
      input.push_back((static_cast<float>(row[x]) / 255.0f - 0.5f) * 2.0f);
    }
  }
}

}  // namespace

PairReader::PairReader(std::filesystem::path base, ImageSpec spec, int pairs_under_way)
    : decoder_(std::move(base), pairs_under_way + kLongestGap + kMargin), spec_(std::move(spec)) {}

Outcome<PreparedPair> PairReader::read(const FramePair& pair) const {
  auto outcome = decoder_.decode_both(pair.previous, pair.next);
  if (is_fault(outcome)) return std::get<SampleFault>(std::move(outcome));
  auto& [before, after] = std::get<std::array<ColourFrame, 2>>(outcome);
  if (before.size != after.size) {
    return SampleFault{"expected two frames of one size, got " + text_of(before.size) + " in " +
                       pair.previous.path + " and " + text_of(after.size) + ", in " +
                       pair.next.path};
  }

  PreparedPair prepared;
  prepared.placement = place(before.size, spec_);
  const VisiblePart part = visible_part(prepared.placement);
  prepared.content = part.size;
  prepared.content_x = part.volume_x;
  prepared.content_y = part.volume_y;
  prepared.input.reserve(2 * part.size.pixel_count());
  try {
    append_input(prepare(before, prepared.placement, spec_), part, prepared.input);
    append_input(prepare(after, prepared.placement, spec_), part, prepared.input);
  } catch (const cv::Exception& exception) {
    return SampleFault{"expected frames that can be resized, got " + exception.err + ", in " +
                       pair.next.path};
  }
  return prepared;
}

}  // namespace eventgan
