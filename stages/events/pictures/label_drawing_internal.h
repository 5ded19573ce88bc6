#pragma once

#include <opencv2/core.hpp>

#include "stages/events/pictures/panel_scale.h"
#include "stages/events/pictures/preview_picture.h"

namespace eventgan {

/// Draws the boxes and poses of `content` onto a panel (CV_8UC3).
void draw_labels(const PreviewContent& content, PanelScale scale, cv::Mat& panel);

}  // namespace eventgan
