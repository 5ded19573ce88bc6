#include "stages/events/pictures/preview_picture.h"

#include <array>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

#include "stages/events/pictures/label_drawing_internal.h"
#include "stages/events/pictures/panel_scale.h"
#include "stages/events/pictures/time_panel_internal.h"
#include "stages/files/atomic_file.h"

namespace eventgan {
namespace {

constexpr int kTitleHeight = 24;
constexpr int kCaptionHeight = 20;
constexpr int kGap = 6;
constexpr double kTextSize = 0.45;
const cv::Scalar kPaper(32, 28, 26);
const cv::Scalar kInk(235, 235, 235);

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
    return cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, kTextSize, 1, &baseline).width;
  };
  if (width() > room) {
    text += "...";
    while (text.size() > 3 && width() > room) text.erase(text.size() - 4, 1);
  }
  cv::putText(canvas, text, at, cv::FONT_HERSHEY_SIMPLEX, kTextSize, kInk, 1, cv::LINE_AA);
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
  cv::Mat canvas(kTitleHeight + size.height + kCaptionHeight, 3 * size.width + 4 * kGap, CV_8UC3,
                 kPaper);
  write_text(canvas, content.title, {kGap, kTitleHeight - 8}, canvas.cols - 2 * kGap);
  const int captions = kTitleHeight + size.height + kCaptionHeight - 6;
  for (int i = 0; i < 3; ++i) {
    const int left = kGap + i * (size.width + kGap);
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

}  // namespace

void write_preview_png(const PreviewContent& content, const std::filesystem::path& path) {
  check(content);
  std::vector<unsigned char> png;
  try {
    cv::imencode(".png", compose(content), png);
  } catch (const cv::Exception& exception) {
    throw std::runtime_error("cannot draw " + path.string() + ": " + exception.err);
  }
  write_file_atomically(path, {reinterpret_cast<const char*>(png.data()), png.size()});
}

}  // namespace eventgan
