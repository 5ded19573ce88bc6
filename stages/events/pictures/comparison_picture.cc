#include "stages/events/pictures/comparison_picture.h"

#include <algorithm>
#include <array>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

#include "stages/base/files/atomic_file.h"
#include "stages/events/pictures/time_panel_internal.h"

namespace eventgan {
namespace {

constexpr int kGap = 6;
constexpr int kTitle = 22;
constexpr int kPanelRoom = 320;  // panels are enlarged as long as they are not wider
constexpr double kTextSize = 0.42;
const cv::Scalar kPaper(32, 28, 26), kInk(235, 235, 235);
constexpr std::array kCaptions{"previous frame", "next frame", "generated", "real"};

void check(const ComparedPair& pair) {
  const std::size_t plane = pair.shape.size.pixel_count();
  if (plane == 0 || pair.frames.size() != 2 * plane ||
      pair.generated.size() != pair.shape.value_count() ||
      pair.real.size() != pair.shape.value_count()) {
    throw std::invalid_argument("expected two frames and two volumes of one size, got others");
  }
}

cv::Mat frame_panel(const float* frame, ImageSize size) {
  const cv::Mat values(size.height, size.width, CV_32F, const_cast<float*>(frame));
  cv::Mat grey, panel;
  values.convertTo(grey, CV_8U, 127.5, 127.5);
  cv::cvtColor(grey, panel, cv::COLOR_GRAY2BGR);
  return panel;
}

void write_text(cv::Mat& canvas, const std::string& text, cv::Point at) {
  cv::putText(canvas, text, at, cv::FONT_HERSHEY_SIMPLEX, kTextSize, kInk, 1, cv::LINE_AA);
}

cv::Mat row_picture(const ComparedPair& pair) {
  const ImageSize size = pair.shape.size;
  const std::array panels{frame_panel(pair.frames.data(), size),
                          frame_panel(pair.frames.data() + size.pixel_count(), size),
                          time_panel(pair.generated, pair.shape),
                          time_panel(pair.real, pair.shape)};
  const int factor = std::max(1, kPanelRoom / size.width);
  const cv::Size shown(size.width * factor, size.height * factor);
  const int columns = static_cast<int>(panels.size());
  cv::Mat row(2 * kTitle + shown.height, columns * (shown.width + kGap) + kGap, CV_8UC3, kPaper);
  write_text(row, pair.title, {kGap, kTitle - 7});
  for (int i = 0; i < columns; ++i) {
    const int left = kGap + i * (shown.width + kGap);
    cv::Mat place = row(cv::Rect({left, kTitle}, shown));
    cv::resize(panels[i], place, shown, 0, 0, cv::INTER_NEAREST);
    write_text(row, kCaptions[i], {left, 2 * kTitle + shown.height - 7});
  }
  return row;
}

}  // namespace

void write_comparison_png(std::span<const ComparedPair> pairs, const std::filesystem::path& path) {
  if (pairs.empty()) throw std::invalid_argument("expected pairs to compare, got none");
  std::vector<cv::Mat> rows;
  int width = 0;
  for (const ComparedPair& pair : pairs) {
    check(pair);
    rows.push_back(row_picture(pair));
    width = std::max(width, rows.back().cols);
  }
  for (cv::Mat& row : rows) {  // pairs may differ in size
    cv::copyMakeBorder(row, row, 0, 0, 0, width - row.cols, cv::BORDER_CONSTANT, kPaper);
  }
  std::vector<unsigned char> png;
  try {
    cv::Mat picture;
    cv::vconcat(rows, picture);
    cv::imencode(".png", picture, png);
  } catch (const cv::Exception& exception) {
    throw std::runtime_error("cannot draw " + path.string() + ": " + exception.err);
  }
  write_file_atomically(path, {reinterpret_cast<const char*>(png.data()), png.size()});
}

}  // namespace eventgan
