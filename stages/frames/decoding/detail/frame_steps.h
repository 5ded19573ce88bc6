#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "manifests/values/job.h"
#include "manifests/values/placement.h"
#include "stages/frames/decoding/prepared_frame.h"

namespace eventgan {

// The steps of prepare_frame.

/// Shared with `image`.
cv::Mat matrix_of(const ImageView& image);

/// An image of these channels as it is to be resized.
struct Resizable {
  cv::Mat image;
  ImageView::Channels channels;
};

/// Grey already where `spec` has it so; else shared with `frame`.
Resizable grey_if_first(const ImageView& frame, const ImageSpec& spec);

/// Resized and grey: [y, x] uint8 of placement.scaled.
cv::Mat scaled_grey(const Resizable& whole, const Placement& placement);

/// Of such a frame what the volume shows, blurred: PreparedFrame::grey.
std::vector<std::uint8_t> finished(cv::Mat scaled, const Placement& placement,
                                   const ImageSpec& spec);

}  // namespace eventgan
