#include "stages/events/pictures/preview_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "stages/base/files/atomic_file.h"
#include "stages/events/pictures/skeleton.h"
#include "stages/events/pictures/time_panel_internal.h"

namespace eventgan {

PanelScale panel_scale(ImageSize volume) {
  constexpr int kPanelSide = 720;
  constexpr int kLargest = 8;
  const int longest = std::max({volume.height, volume.width, 1});
  return {std::clamp(kPanelSide / longest, 1, kLargest)};
}

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

/// Draws the boxes and poses of `content` onto a panel (CV_8UC3).
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

constexpr int kTitleHeight = 24;
constexpr int kCaptionHeight = 20;
constexpr int kTileGap = 6;
constexpr double kCaptionSize = 0.45;
const cv::Scalar kBackground(32, 28, 26);
const cv::Scalar kCaptionColour(235, 235, 235);

void check(const PreviewContent& content) {
  const std::size_t bytes = 3 * content.shape.size.pixel_count();
  const auto fits = [](std::size_t got, std::size_t expected) {
    return got == 0 || got == expected;
  };
  if (content.shape.size.pixel_count() == 0 || !fits(content.previous_bgr.size(), bytes) ||
      !fits(content.next_bgr.size(), bytes) ||
      !fits(content.volume.size(), content.shape.value_count()) ||
      content.labels.boxes.size() != content.annotation.boxes.size() ||
      content.labels.persons.size() != content.annotation.persons.size()) {
    throw std::invalid_argument(
        "expected frames, volume and labels of one sample, got sizes that differ");
  }
}

void write_text(cv::Mat& canvas, std::string text, cv::Point at, int room) {
  const auto width = [&] {
    int baseline = 0;
    return cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, kCaptionSize, 1, &baseline).width;
  };
  if (width() > room) {
    text += "...";
    while (text.size() > 3 && width() > room) text.erase(text.size() - 4, 1);
  }
  cv::putText(canvas, text, at, cv::FONT_HERSHEY_SIMPLEX, kCaptionSize, kCaptionColour, 1,
              cv::LINE_AA);
}

/// A panel that says why there is no picture.
cv::Mat blank_panel(cv::Size size, const std::string& why) {
  cv::Mat panel(size, CV_8UC3, cv::Scalar(70, 66, 64));
  write_text(panel, why, {8, size.height / 2}, size.width - 16);
  return panel;
}

cv::Mat enlarged(const cv::Mat& picture, PanelScale scale) {
  cv::Mat panel;
  cv::resize(picture, panel, {}, scale.factor, scale.factor, cv::INTER_NEAREST);
  return panel;
}

cv::Mat frame_panel(const std::vector<std::uint8_t>& bgr, ImageSize size, PanelScale scale) {
  if (bgr.empty()) {
    return blank_panel({size.width * scale.factor, size.height * scale.factor}, "frame not found");
  }
  return enlarged(cv::Mat(size.height, size.width, CV_8UC3, const_cast<std::uint8_t*>(bgr.data())),
                  scale);
}

cv::Mat events_panel(const PreviewContent& content, PanelScale scale) {
  const ImageSize size = content.shape.size;
  if (content.volume.empty()) {
    return blank_panel({size.width * scale.factor, size.height * scale.factor}, "no event volume");
  }
  return enlarged(time_panel(content.volume, content.shape), scale);
}

/// "early [colours] late" and what brightness means.
void draw_time_legend(cv::Mat& canvas, cv::Point at, int room) {
  constexpr int kBarWidth = 90;
  constexpr int kBarStart = 42;
  write_text(canvas, "early", at, room);
  for (int x = 0; x < kBarWidth && kBarStart + x < room; ++x) {
    const cv::Vec3b colour = time_colour(0.1f + 0.9f * static_cast<float>(x) / (kBarWidth - 1));
    cv::line(canvas, {at.x + kBarStart + x, at.y - 9}, {at.x + kBarStart + x, at.y},
             cv::Scalar(colour[0], colour[1], colour[2]));
  }
  const int after = kBarStart + kBarWidth + 6;
  write_text(canvas, "late;  bright: many events, 1-exp(-sum)", {at.x + after, at.y}, room - after);
}

cv::Mat compose(const PreviewContent& content) {
  const PanelScale scale = panel_scale(content.shape.size);
  std::array<cv::Mat, 3> panels{frame_panel(content.previous_bgr, content.shape.size, scale),
                                frame_panel(content.next_bgr, content.shape.size, scale),
                                events_panel(content, scale)};
  const cv::Size size = panels[0].size();
  cv::Mat canvas(kTitleHeight + size.height + kCaptionHeight, 3 * size.width + 4 * kTileGap,
                 CV_8UC3, kBackground);
  write_text(canvas, content.title, {kTileGap, kTitleHeight - 8}, canvas.cols - 2 * kTileGap);
  const int captions = kTitleHeight + size.height + kCaptionHeight - 6;
  for (int i = 0; i < 3; ++i) {
    const int left = kTileGap + i * (size.width + kTileGap);
    draw_labels(content, scale, panels[i]);
    panels[i].copyTo(canvas(cv::Rect({left, kTitleHeight}, size)));
    if (i == 2) {
      draw_time_legend(canvas, {left, captions}, size.width);
    } else {
      write_text(canvas, i == 0 ? "previous frame" : "next frame", {left, captions}, size.width);
    }
  }
  return canvas;
}

std::string png_of(const cv::Mat& picture) {
  std::vector<unsigned char> png;
  cv::imencode(".png", picture, png);
  return {png.begin(), png.end()};
}

}  // namespace

void write_preview_png(const PreviewContent& content, const std::filesystem::path& path) {
  check(content);
  try {
    write_file_atomically(path, png_of(compose(content)));
  } catch (const cv::Exception& exception) {
    throw std::runtime_error("cannot draw " + path.string() + ": " + exception.err);
  }
}

std::string time_picture_png(std::span<const float> volume, const VolumeShape& shape) {
  try {
    return png_of(time_panel(volume, shape));
  } catch (const cv::Exception& exception) {
    throw std::runtime_error("cannot draw a picture of times: " + exception.err);
  }
}

}  // namespace eventgan
