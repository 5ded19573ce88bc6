#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <opencv2/imgproc.hpp>
#include <string>

#include "stages/events/pictures/label_drawing_internal.h"
#include "stages/events/pictures/skeleton.h"

namespace eventgan {
namespace {

// OpenCV draws between pixels with fixed-point coordinates of this many binary digits.
constexpr int kShift = 4;

const cv::Scalar kIgnored(235, 235, 235);
const cv::Scalar kHeadBox(0, 215, 255);
const cv::Scalar kShadow(0, 0, 0);

cv::Scalar class_colour(int class_id) {
  static const std::array<cv::Scalar, 8> colours{
      cv::Scalar(80, 220, 60),  cv::Scalar(255, 160, 30), cv::Scalar(60, 170, 255),
      cv::Scalar(60, 80, 255),  cv::Scalar(255, 90, 220), cv::Scalar(80, 230, 240),
      cv::Scalar(230, 220, 60), cv::Scalar(190, 130, 160)};
  return colours[static_cast<std::size_t>(std::max(class_id, 0)) % colours.size()];
}

cv::Scalar side_colour(BodySide side) {
  switch (side) {
    case BodySide::kLeft:
      return {255, 170, 40};
    case BodySide::kRight:
      return {40, 120, 255};
    case BodySide::kMiddle:
      break;
  }
  return {80, 230, 120};
}

/// Far points are drawn at the edge of what fixed-point numbers hold.
cv::Point fixed(Point point) {
  const auto coordinate = [](double value) {
    return static_cast<int>(std::lround(std::clamp(value, -1e6, 1e6) * (1 << kShift)));
  };
  return {coordinate(point.x), coordinate(point.y)};
}

void draw_line(cv::Mat& panel, Point from, Point to, const cv::Scalar& colour, int thickness) {
  cv::line(panel, fixed(from), fixed(to), colour, thickness, cv::LINE_AA, kShift);
}

void draw_dashes(cv::Mat& panel, Point from, Point to, const cv::Scalar& colour) {
  constexpr double kDash = 7;
  draw_line(panel, from, to, kShadow, 1);  // dashes alone are lost on a ground of their own colour
  const double length = std::hypot(to.x - from.x, to.y - from.y);
  for (double start = 0; start < length; start += 2 * kDash) {
    const double end = std::min(start + kDash, length);
    const auto along = [&](double at) {
      return Point{from.x + (to.x - from.x) * at / length, from.y + (to.y - from.y) * at / length};
    };
    draw_line(panel, along(start), along(end), colour, 1);
  }
}

void draw_rectangle(cv::Mat& panel, const Rectangle& box, PanelScale scale,
                    const cv::Scalar& colour, bool dashed) {
  // The right and lower edge of a box that fills the volume lie one pixel outside the panel.
  const auto corner = [&](double x, double y) {
    const Point at = scale.corner(x, y);
    return Point{std::min(at.x, panel.cols - 1.0), std::min(at.y, panel.rows - 1.0)};
  };
  const std::array<Point, 4> corners{corner(box.left, box.top), corner(box.right, box.top),
                                     corner(box.right, box.bottom), corner(box.left, box.bottom)};
  for (std::size_t i = 0; i < 4; ++i) {
    if (dashed) {
      draw_dashes(panel, corners[i], corners[(i + 1) % 4], colour);
    } else {
      draw_line(panel, corners[i], corners[(i + 1) % 4], colour, 2);
    }
  }
}

void draw_caption(cv::Mat& panel, const Rectangle& box, PanelScale scale, const std::string& text,
                  const cv::Scalar& colour) {
  constexpr double kSize = 0.4;
  int baseline = 0;
  const cv::Size size = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, kSize, 1, &baseline);
  const Point corner = scale.corner(box.left, box.top);
  const int height = size.height + 6;
  // Above the box, or inside it at the panel's upper edge.
  const int x = std::clamp(static_cast<int>(corner.x), 0, std::max(0, panel.cols - size.width - 4));
  const int y = corner.y >= height ? static_cast<int>(corner.y) - height
                                   : std::max(static_cast<int>(corner.y), 0);
  cv::rectangle(panel, cv::Rect(x, y, size.width + 4, height), colour, cv::FILLED);
  cv::putText(panel, text, {x + 2, y + height - 3}, cv::FONT_HERSHEY_SIMPLEX, kSize, kShadow, 1,
              cv::LINE_AA);
}

void draw_box(const PreviewContent& content, std::size_t i, PanelScale scale, cv::Mat& panel) {
  const VolumeBox& box = content.labels.boxes[i];
  const int class_id = content.annotation.boxes[i].class_id;
  const cv::Scalar colour = box.ignore ? kIgnored : class_colour(class_id);
  draw_rectangle(panel, box.clipped, scale, colour, box.ignore);
  const auto& names = content.schema.class_names;
  const bool named = class_id >= 0 && static_cast<std::size_t>(class_id) < names.size();
  if (named && !box.ignore) draw_caption(panel, box.clipped, scale, names[class_id], colour);
}

void draw_joint(cv::Mat& panel, Point at, bool hidden, const cv::Scalar& colour) {
  constexpr int kRadius = 4 << kShift;
  cv::circle(panel, fixed(at), kRadius + (1 << kShift), kShadow, cv::FILLED, cv::LINE_AA, kShift);
  cv::circle(panel, fixed(at), kRadius, colour, hidden ? 1 : cv::FILLED, cv::LINE_AA, kShift);
}

void draw_person(const PreviewContent& content, std::size_t i, const std::vector<Limb>& limbs,
                 PanelScale scale, cv::Mat& panel) {
  const std::vector<Point>& joints = content.labels.persons[i].joints;
  const std::vector<Joint>& annotated = content.annotation.persons[i].joints;
  const auto known = [&](std::size_t j) {
    return j < joints.size() && j < annotated.size() && joints[j] != kMissingPoint;
  };

  std::vector<BodySide> sides(joints.size(), BodySide::kMiddle);
  for (const Limb& limb : limbs) {
    if (!known(limb.from) || !known(limb.to)) continue;
    sides[limb.to] = limb.side;
    const Point from = scale.point(joints[limb.from]);
    const Point to = scale.point(joints[limb.to]);
    draw_line(panel, from, to, kShadow, 4);
    draw_line(panel, from, to, side_colour(limb.side), 2);
  }
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (known(j)) {
      draw_joint(panel, scale.point(joints[j]), annotated[j].visible == 0, side_colour(sides[j]));
    }
  }
  const auto& head_box = content.labels.persons[i].head_box;
  if (head_box) draw_rectangle(panel, *head_box, scale, kHeadBox, /*dashed=*/true);
}

}  // namespace

void draw_labels(const PreviewContent& content, PanelScale scale, cv::Mat& panel) {
  // Ignored regions first, so that they never cover an object.
  for (const bool ignored : {true, false}) {
    for (std::size_t i = 0; i < content.labels.boxes.size(); ++i) {
      if (content.labels.boxes[i].ignore == ignored) draw_box(content, i, scale, panel);
    }
  }
  const std::vector<Limb> limbs = limbs_of(content.schema.joint_names);
  for (std::size_t i = 0; i < content.labels.persons.size(); ++i) {
    draw_person(content, i, limbs, scale, panel);
  }
}

}  // namespace eventgan
