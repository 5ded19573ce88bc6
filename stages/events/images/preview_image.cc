#include "stages/events/images/preview_image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "stages/events/images/detail/time_panel.h"
#include "stages/events/images/skeleton.h"

namespace eventgan {

namespace {

constexpr int kTitleHeight = 24;
constexpr int kCaptionHeight = 20;
constexpr int kTileGap = 6;
constexpr int kPanels = 4;  // previous frame, next frame, times, polarities

}  // namespace

PreviewLayout preview_layout(ImageSize volume) {
  constexpr int kSide = 1420;
  constexpr int kLargest = 8;
  PreviewLayout best{{1}, 1};
  int largest = 0;
  for (const int columns : {4, 2, 1}) {
    const int rows = kPanels / columns;
    const int in_width = (kSide - (columns + 1) * kTileGap) / columns / std::max(volume.width, 1);
    const int in_height =
        ((kSide - kTitleHeight) / rows - kCaptionHeight) / std::max(volume.height, 1);
    const int factor = std::min({in_width, in_height, kLargest});
    if (factor > largest) {
      largest = factor;
      best = {{static_cast<double>(factor)}, columns};
    }
  }
  return best;
}

namespace {

// OpenCV draws between pixels with fixed-point coordinates of this many binary digits.
constexpr int kShift = 4;

const cv::Scalar kIgnored(235, 235, 235);
const cv::Scalar kHeadBox(0, 215, 255);
const cv::Scalar kShadow(0, 0, 0);

/// No colour of times or polarities. The class's name is beside the box.
cv::Scalar class_colour(int class_id) {
  return class_id % 2 == 0 ? cv::Scalar(255, 60, 255) : cv::Scalar(255, 255, 255);
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
  const double length = std::hypot(to.x - from.x, to.y - from.y);
  // What lies far outside the panel is not worth millions of dashes.
  const double step = std::max(2 * kDash, length / 1000);
  for (double start = 0; start < length; start += step) {
    const double end = std::min(start + step / 2, length);
    const auto along = [&](double at) {
      return Point{from.x + (to.x - from.x) * at / length, from.y + (to.y - from.y) * at / length};
    };
    draw_line(panel, along(start), along(end), colour, 1);
  }
}

/// kShadowedDashes: dashes alone are lost on a ground of their own colour, and so are lines without
/// a dark edge.
enum class LineStyle { kSolid, kThin, kShadowedDashes, kDashes };

void draw_rectangle(cv::Mat& panel, const Rectangle& box, PanelScale scale,
                    const cv::Scalar& colour, LineStyle style) {
  // The right and lower edge of a box that fills the volume lie one pixel outside the panel.
  const auto corner = [&](double x, double y) {
    const Point at = scale.corner(x, y);
    return Point{std::min(at.x, panel.cols - 1.0), std::min(at.y, panel.rows - 1.0)};
  };
  const std::array<Point, 4> corners{corner(box.left, box.top), corner(box.right, box.top),
                                     corner(box.right, box.bottom), corner(box.left, box.bottom)};
  const auto draw_sides = [&](const cv::Scalar& line, int thickness) {
    for (std::size_t i = 0; i < 4; ++i) {
      draw_line(panel, corners[i], corners[(i + 1) % 4], line, thickness);
    }
  };
  if (style == LineStyle::kSolid || style == LineStyle::kThin) {
    const int thickness = style == LineStyle::kSolid ? 2 : 1;
    draw_sides(kShadow, thickness + 2);
    draw_sides(colour, thickness);
    return;
  }
  if (style == LineStyle::kShadowedDashes) draw_sides(kShadow, 1);
  for (std::size_t i = 0; i < 4; ++i) draw_dashes(panel, corners[i], corners[(i + 1) % 4], colour);
}

/// Thin, in contrast to its box, and on a shadow, since ignored ones are nearly white.
void draw_outline(cv::Mat& panel, const Outline& outline, PanelScale scale,
                  const cv::Scalar& colour) {
  for (const auto& ring : outline.rings) {
    std::vector<cv::Point> corners;
    for (const Point& corner : ring) corners.push_back(fixed(scale.corner(corner.x, corner.y)));
    cv::polylines(panel, corners, /*isClosed=*/true, kShadow, 3, cv::LINE_AA, kShift);
    cv::polylines(panel, corners, /*isClosed=*/true, colour, 1, cv::LINE_AA, kShift);
  }
}

cv::Rect panel_rectangle(const Rectangle& box, PanelScale scale) {
  const cv::Point first = fixed(scale.corner(box.left, box.top)) / (1 << kShift);
  const cv::Point last = fixed(scale.corner(box.right, box.bottom)) / (1 << kShift);
  return {first, last};
}

/// Where a box's name hides least: of the places around the box, and inside it, the one that covers
/// the smallest share of any box and of any name in `taken`; of equals the first. None if even that
/// one would hide half of one: the box's colour tells its class, too.
std::optional<cv::Rect> caption_place(const cv::Rect& box, cv::Size caption, cv::Size panel,
                                      const std::vector<cv::Rect>& taken) {
  const int left = box.x, right = box.x + box.width - caption.width;
  const int above = box.y - caption.height, below = box.y + box.height + 1;
  const std::array<cv::Point, 7> places{{{left, above},
                                         {left, below},
                                         {right, above},
                                         {right, below},
                                         {box.x + box.width + 1, box.y},
                                         {box.x - caption.width, box.y},
                                         {left, box.y}}};
  const cv::Rect all({0, 0}, panel);
  cv::Rect best;
  double least = 0;
  for (const cv::Point& place : places) {
    const cv::Rect at(std::clamp(place.x, 0, std::max(0, panel.width - caption.width)),
                      std::clamp(place.y, 0, std::max(0, panel.height - caption.height)),
                      caption.width, caption.height);
    double cost = 0;
    for (const cv::Rect& other : taken) {
      const cv::Rect shown = other & all;
      if (!shown.empty()) cost += static_cast<double>((at & shown).area()) / shown.area();
    }
    if (best.empty() || cost < least) {
      best = at;
      least = cost;
    }
  }
  return least < 0.5 ? std::optional(best) : std::nullopt;
}

constexpr int kNameBorder = 2;

/// The names of the boxes that are no ignored regions, when all boxes are drawn; on a small panel,
/// of those alone that are as wide as their names.
void draw_names(const PreviewContent& content, PanelScale scale, bool small, cv::Mat& panel) {
  const double font_size = small ? 0.3 : 0.4;
  const auto& names = content.schema.class_names;
  std::vector<cv::Rect> taken;
  for (const VolumeBox& box : content.labels.boxes) {
    if (!box.ignore) taken.push_back(panel_rectangle(box.clipped, scale));
  }
  std::size_t drawn = 0;
  for (std::size_t i = 0; i < content.labels.boxes.size(); ++i) {
    if (content.labels.boxes[i].ignore) continue;
    const cv::Rect box = taken[drawn++];
    const int class_id = content.annotation.boxes[i].class_id;
    if (class_id < 0 || static_cast<std::size_t>(class_id) >= names.size()) continue;
    int baseline = 0;
    const cv::Size text =
        cv::getTextSize(names[class_id], cv::FONT_HERSHEY_SIMPLEX, font_size, 1, &baseline);
    if (small && text.width > box.width) continue;
    const auto at = caption_place(
        box, {text.width + 2 * kNameBorder, text.height + 3 * kNameBorder}, panel.size(), taken);
    if (!at) continue;
    cv::rectangle(panel, *at, class_colour(class_id), cv::FILLED);
    cv::putText(panel, names[class_id], {at->x + kNameBorder, at->y + at->height - 3},
                cv::FONT_HERSHEY_SIMPLEX, font_size, kShadow, 1, cv::LINE_AA);
    taken.push_back(*at);
  }
}

void draw_joint(cv::Mat& panel, Point at, int radius_px, bool hidden, const cv::Scalar& colour) {
  const int radius = radius_px << kShift;
  cv::circle(panel, fixed(at), radius + (1 << kShift), kShadow, cv::FILLED, cv::LINE_AA, kShift);
  cv::circle(panel, fixed(at), radius, colour, hidden ? 1 : cv::FILLED, cv::LINE_AA, kShift);
}

/// kSmall: thin, for tiles. kHint: thin dashes, of a frame that the labels do not
/// belong to.
enum class LabelStyle { kFull, kSmall, kHint };

void draw_person(const PreviewContent& content, std::size_t i, const std::vector<Limb>& limbs,
                 PanelScale scale, LabelStyle style, cv::Mat& panel) {
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
    if (style == LabelStyle::kHint) {
      draw_dashes(panel, from, to, side_colour(limb.side));
    } else {
      const int thickness = style == LabelStyle::kFull ? 2 : 1;
      draw_line(panel, from, to, kShadow, 2 * thickness);
      draw_line(panel, from, to, side_colour(limb.side), thickness);
    }
  }
  if (style == LabelStyle::kHint) return;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (known(j)) {
      draw_joint(panel, scale.point(joints[j]), style == LabelStyle::kFull ? 4 : 1,
                 annotated[j].visible == 0, side_colour(sides[j]));
    }
  }
  const auto& head_box = content.labels.persons[i].head_box;
  if (head_box) draw_rectangle(panel, *head_box, scale, kHeadBox, LineStyle::kShadowedDashes);
}

/// Draws the boxes and poses of `content` onto a panel (CV_8UC3).
void draw_labels(const PreviewContent& content, PanelScale scale, LabelStyle style,
                 cv::Mat& panel) {
  const bool is_hint = style == LabelStyle::kHint;
  // Ignored regions first, so that they never cover an object; a hint needs none.
  for (const bool ignored : {true, false}) {
    if (ignored && is_hint) continue;
    for (std::size_t i = 0; i < content.labels.boxes.size(); ++i) {
      const VolumeBox& box = content.labels.boxes[i];
      if (box.ignore != ignored) continue;
      const cv::Scalar colour =
          ignored ? kIgnored : class_colour(content.annotation.boxes[i].class_id);
      if (!is_hint) draw_outline(panel, box.outline, scale, colour);
      draw_rectangle(panel, box.clipped, scale, colour,
                     ignored                      ? LineStyle::kShadowedDashes
                     : is_hint                    ? LineStyle::kDashes
                     : style == LabelStyle::kFull ? LineStyle::kSolid
                                                  : LineStyle::kThin);
    }
  }
  if (!is_hint) draw_names(content, scale, style == LabelStyle::kSmall, panel);
  const std::vector<Limb> limbs = limbs_of(content.schema.joint_names);
  for (std::size_t i = 0; i < content.labels.persons.size(); ++i) {
    draw_person(content, i, limbs, scale, style, panel);
  }
}

/// Red to the right, yellow-green down, cyan to the left, blue-violet up.
cv::Scalar direction_colour(Point by) {
  const double half_turns = std::atan2(by.y, by.x) / std::numbers::pi;  // -1..1
  const auto hue = static_cast<std::uint8_t>(std::lround(90 * (half_turns + 2)) % 180);
  const cv::Mat hsv(1, 1, CV_8UC3, cv::Scalar(hue, 255, 255));
  cv::Mat bgr;
  cv::cvtColor(hsv, bgr, cv::COLOR_HSV2BGR);
  const cv::Vec3b colour = bgr.at<cv::Vec3b>(0, 0);
  return {double(colour[0]), double(colour[1]), double(colour[2])};
}

/// Draws the flow of `content` onto its labelled frame.
void draw_flow(const PreviewContent& content, PanelScale scale, cv::Mat& panel) {
  constexpr double kBetween_px = 20;  // two arrows
  constexpr double kTip = 0.3, kMoves_px = 0.25;
  const ImageSize size = content.shape.size;
  const int step = std::max(1, static_cast<int>(std::lround(kBetween_px / scale.factor)));
  for (int y = step / 2; y < size.height; y += step) {
    for (int x = step / 2; x < size.width; x += step) {
      const auto pixel = static_cast<std::size_t>(y) * size.width + static_cast<std::size_t>(x);
      if (content.flow.valid[pixel] == 0) continue;
      const Point by{content.flow.px[pixel], content.flow.px[size.pixel_count() + pixel]};
      const Point at{double(x), double(y)};
      if (std::hypot(by.x, by.y) < kMoves_px) {
        draw_joint(panel, scale.point(at), 1, false, kIgnored);
        continue;
      }
      const double before = content.label_position;  // of the motion
      const cv::Point from = fixed(scale.point({at.x - before * by.x, at.y - before * by.y}));
      const cv::Point to =
          fixed(scale.point({at.x + (1 - before) * by.x, at.y + (1 - before) * by.y}));
      cv::arrowedLine(panel, from, to, kShadow, 3, cv::LINE_AA, kShift, kTip);
      cv::arrowedLine(panel, from, to, direction_colour(by), 1, cv::LINE_AA, kShift, kTip);
    }
  }
}

constexpr double kCaptionSize = 0.45;
const cv::Scalar kBackground(32, 28, 26);
const cv::Scalar kCaptionColour(235, 235, 235);
const cv::Scalar kLabelled(90, 215, 255);  // the border and the caption of the labelled frame

void check(const PreviewContent& content) {
  const std::size_t bytes = 3 * content.shape.size.pixel_count();
  const auto fits = [](std::size_t got, std::size_t expected) {
    return got == 0 || got == expected;
  };
  if (content.shape.size.pixel_count() == 0 || !fits(content.previous_bgr.size(), bytes) ||
      !fits(content.next_bgr.size(), bytes) ||
      !fits(content.volume.size(), content.shape.value_count()) ||
      !fits(content.flow.px.size(), 2 * content.shape.size.pixel_count()) ||
      2 * content.flow.valid.size() != content.flow.px.size() ||
      content.labels.boxes.size() != content.annotation.boxes.size() ||
      content.labels.persons.size() != content.annotation.persons.size()) {
    throw std::invalid_argument(
        "expected frames, volume and labels of one sample, got sizes that differ");
  }
}

void write_text(cv::Mat& canvas, std::string text, cv::Point at, int room,
                const cv::Scalar& colour = kCaptionColour) {
  const auto width = [&] {
    int baseline = 0;
    return cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, kCaptionSize, 1, &baseline).width;
  };
  if (width() > room) {
    text += "...";
    while (text.size() > 3 && width() > room) text.erase(text.size() - 4, 1);
  }
  cv::putText(canvas, text, at, cv::FONT_HERSHEY_SIMPLEX, kCaptionSize, colour, 1, cv::LINE_AA);
}

/// A panel that says why there is no image.
cv::Mat blank_panel(cv::Size size, const std::string& why) {
  cv::Mat panel(size, CV_8UC3, cv::Scalar(70, 66, 64));
  write_text(panel, why, {8, size.height / 2}, size.width - 16);
  return panel;
}

cv::Size panel_size(ImageSize volume, PanelScale scale) {
  const auto side = [&](int pixels) {
    return std::max(1, static_cast<int>(std::lround(pixels * scale.factor)));
  };
  return {side(volume.width), side(volume.height)};
}

cv::Mat scaled(const cv::Mat& image, ImageSize volume, PanelScale scale) {
  cv::Mat panel;
  cv::resize(image, panel, panel_size(volume, scale), 0, 0,
             scale.factor < 1 ? cv::INTER_AREA : cv::INTER_NEAREST);
  return panel;
}

cv::Mat frame_panel(const std::vector<std::uint8_t>& bgr, ImageSize size, PanelScale scale) {
  if (bgr.empty()) return blank_panel(panel_size(size, scale), "no frame");
  return scaled(cv::Mat(size.height, size.width, CV_8UC3, const_cast<std::uint8_t*>(bgr.data())),
                size, scale);
}

cv::Mat events_panel(const PreviewContent& content, int number, PanelScale scale) {
  const ImageSize size = content.shape.size;
  if (content.volume.empty()) return blank_panel(panel_size(size, scale), "no event volume");
  const auto draw = number == 2 ? time_panel : polarity_panel;
  return scaled(draw(content.volume, content.shape), size, scale);
}

/// Panel 0 is the previous frame, 1 the next one, 2 the events by time, 3 by polarity; with their
/// labels.
cv::Mat labelled_panel(const PreviewContent& content, int number, PanelScale scale,
                       LabelStyle style) {
  cv::Mat panel = number >= 2 ? events_panel(content, number, scale)
                              : frame_panel(number == 0 ? content.previous_bgr : content.next_bgr,
                                            content.shape.size, scale);
  const bool has_labels = number >= 2 || content.label_position == number;
  draw_labels(content, scale, has_labels ? style : LabelStyle::kHint, panel);
  if (number == content.label_position && style == LabelStyle::kFull && !content.flow.empty()) {
    draw_flow(content, scale, panel);
  }
  return panel;
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
  write_text(canvas, "late;  bright: many events", {at.x + after, at.y}, room - after);
}

std::string frame_caption(const PreviewContent& content, int number) {
  const std::string name = number == 0 ? "previous frame" : "next frame";
  if (content.label_position == number) {
    return name + (content.flow.empty() ? ", labelled" : ", labelled, with the flow");
  }
  return name + (content.label_position == 1 - number ? "" : " (the labelled one lies between)");
}

cv::Mat compose(const PreviewContent& content) {
  const PreviewLayout layout = preview_layout(content.shape.size);
  const cv::Size size = panel_size(content.shape.size, layout.scale);
  const int rows = kPanels / layout.columns;
  cv::Mat canvas(kTitleHeight + rows * (size.height + kCaptionHeight),
                 layout.columns * (size.width + kTileGap) + kTileGap, CV_8UC3, kBackground);
  write_text(canvas, content.title, {kTileGap, kTitleHeight - 8}, canvas.cols - 2 * kTileGap);
  for (int i = 0; i < kPanels; ++i) {
    const cv::Rect place({kTileGap + i % layout.columns * (size.width + kTileGap),
                          kTitleHeight + i / layout.columns * (size.height + kCaptionHeight)},
                         size);
    labelled_panel(content, i, layout.scale, LabelStyle::kFull).copyTo(canvas(place));
    const cv::Point caption(place.x, place.br().y + kCaptionHeight - 6);
    const bool is_labelled = i < 2 && content.label_position == i;
    if (is_labelled) {
      cv::rectangle(canvas, place + cv::Point(-2, -2) + cv::Size(4, 4), kLabelled, 2);
    }
    if (i == 2) {
      draw_time_legend(canvas, caption, size.width);
    } else if (i == 3) {
      write_text(canvas, "red: brighter, blue: darker;  strong: many events", caption, size.width);
    } else {
      write_text(canvas, frame_caption(content, i), caption, size.width,
                 is_labelled ? kLabelled : kCaptionColour);
    }
  }
  return canvas;
}

/// A tile's panels lie below each other where volumes are wider than this, as height times it.
constexpr double kWide = 2;

cv::Mat compose_tile(const PreviewContent& content, int width) {
  const ImageSize volume = content.shape.size;
  const bool is_wide = volume.width > kWide * volume.height;
  const int room = is_wide ? width - 2 * kTileGap : (width - 3 * kTileGap) / 2;
  const PanelScale scale{static_cast<double>(room) / volume.width};
  const cv::Size size = panel_size(volume, scale);
  cv::Mat tile(kTitleHeight + (is_wide ? 2 : 1) * (size.height + kTileGap), width, CV_8UC3,
               kBackground);
  write_text(tile, content.title, {kTileGap, kTitleHeight - 8}, width - 2 * kTileGap);
  const cv::Point first(kTileGap, kTitleHeight);
  const cv::Point second = first + (is_wide ? cv::Point(0, size.height + kTileGap)
                                            : cv::Point(size.width + kTileGap, 0));
  labelled_panel(content, content.label_position == 0 ? 0 : 1, scale, LabelStyle::kSmall)
      .copyTo(tile(cv::Rect(first, size)));
  labelled_panel(content, 2, scale, LabelStyle::kSmall).copyTo(tile(cv::Rect(second, size)));
  return tile;
}

ColourFrame image_of(const cv::Mat& canvas) {
  return {{canvas.rows, canvas.cols},
          {canvas.data, canvas.data + 3 * static_cast<std::size_t>(canvas.rows) * canvas.cols}};
}

}  // namespace

ColourFrame draw_preview(const PreviewContent& content) {
  check(content);
  try {
    return image_of(compose(content));
  } catch (const cv::Exception& exception) {
    throw std::runtime_error("cannot draw a preview: " + exception.err);
  }
}

ColourFrame draw_tile(const PreviewContent& content, int width) {
  check(content);
  try {
    return image_of(compose_tile(content, width));
  } catch (const cv::Exception& exception) {
    throw std::runtime_error("cannot draw a preview: " + exception.err);
  }
}

ColourFrame draw_sheet(std::span<const ColourFrame> tiles, int columns) {
  if (tiles.empty() || columns < 1) throw std::invalid_argument("expected tiles, got none");
  std::vector<cv::Mat> rows;
  int width = 0;
  for (std::size_t first = 0; first < tiles.size(); first += static_cast<std::size_t>(columns)) {
    const auto row =
        tiles.subspan(first, std::min(tiles.size() - first, static_cast<std::size_t>(columns)));
    cv::Size size;
    for (const ColourFrame& tile : row) {
      size.width += tile.size.width;
      size.height = std::max(size.height, tile.size.height);
    }
    cv::Mat& canvas = rows.emplace_back(size, CV_8UC3, kBackground);
    cv::Point at;
    for (const ColourFrame& tile : row) {
      cv::Mat(tile.size.height, tile.size.width, CV_8UC3,
              const_cast<std::uint8_t*>(tile.bgr.data()))
          .copyTo(canvas(cv::Rect(at, cv::Size(tile.size.width, tile.size.height))));
      at.x += tile.size.width;
    }
    width = std::max(width, size.width);
  }
  cv::Mat sheet;
  for (cv::Mat& row : rows) {
    cv::copyMakeBorder(row, row, 0, 0, 0, width - row.cols, cv::BORDER_CONSTANT, kBackground);
  }
  cv::vconcat(rows, sheet);
  return image_of(sheet);
}

std::string time_image_png(std::span<const float> volume, const VolumeShape& shape) {
  try {
    const cv::Mat panel = time_panel(volume, shape);
    return encode_png({{panel.rows, panel.cols}, panel.data});
  } catch (const cv::Exception& exception) {
    throw std::runtime_error("cannot draw an image of times: " + exception.err);
  }
}

namespace {

/// Calls `take` with the sums of each pixel's positive and negative bins.
template <class Take>
void for_each_sum(std::span<const float> volume, const VolumeShape& shape, Take take) {
  const std::size_t pixels = shape.size.pixel_count();
  const std::size_t bins = static_cast<std::size_t>(shape.channels()) / 2;
  for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
    double positive = 0, negative = 0;
    for (std::size_t bin = 0; bin < bins; ++bin) {
      positive += volume[bin * pixels + pixel];
      negative += volume[(bins + bin) * pixels + pixel];
    }
    take(positive, negative);
  }
}

}  // namespace

double largest_polarity_sum(std::span<const float> volume, const VolumeShape& shape) {
  double largest = 0;
  for_each_sum(volume, shape, [&](double positive, double negative) {
    largest = std::max({largest, positive, negative});
  });
  return largest;
}

std::string polarity_image_png(std::span<const float> volume, const VolumeShape& shape,
                               double full_scale) {
  const auto code = [](double share) {
    return static_cast<std::uint8_t>(std::lround(255 * std::clamp(share, 0.0, 1.0)));
  };
  std::vector<std::uint8_t> bgr;
  bgr.reserve(3 * shape.size.pixel_count());
  for_each_sum(volume, shape, [&](double positive, double negative) {
    bgr.push_back(code(negative / full_scale));
    bgr.push_back(code(0.5 + (positive - negative) / full_scale / 2));
    bgr.push_back(code(positive / full_scale));
  });
  return encode_png({shape.size, bgr.data()});
}

}  // namespace eventgan
