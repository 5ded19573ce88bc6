#include "stages/events/images/comparison_image.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

#include "manifests/files/atomic_file.h"
#include "stages/base/images/image_file.h"
#include "stages/events/images/detail/time_panel.h"

namespace eventgan {
namespace {

constexpr int kGap = 6;
constexpr int kTitle = 22;
constexpr int kPanelRoom = 320;  // panels are enlarged as long as they are not wider
constexpr double kTextSize = 0.42;
const cv::Scalar kPaper(32, 28, 26), kInk(235, 235, 235);
/// Of the volumes, in their order: caption and line.
const std::array kVolumeColours{cv::Scalar(235, 235, 235), cv::Scalar(235, 190, 60),
                                cv::Scalar(70, 160, 250), cv::Scalar(110, 215, 110),
                                cv::Scalar(220, 120, 230)};

const cv::Scalar& volume_colour(std::size_t volume) {
  return kVolumeColours[volume % kVolumeColours.size()];
}

void check(const ComparedPair& pair) {
  const std::size_t plane = pair.shape.size.pixel_count();
  const bool fit = std::ranges::all_of(pair.volumes, [&](const NamedVolume& named) {
    return named.volume.size() == pair.shape.value_count();
  });
  if (plane == 0 || pair.frames.size() != 2 * plane || pair.volumes.empty() || !fit) {
    throw std::invalid_argument("expected two frames and volumes of one size, got others");
  }
}

cv::Mat frame_panel(const float* frame, ImageSize size) {
  const cv::Mat values(size.height, size.width, CV_32F, const_cast<float*>(frame));
  cv::Mat grey, panel;
  values.convertTo(grey, CV_8U, 127.5, 127.5);
  cv::cvtColor(grey, panel, cv::COLOR_GRAY2BGR);
  return panel;
}

/// Sums over both polarities and all pixels, a bin each.
std::vector<double> events_per_bin(const std::vector<float>& volume, const VolumeShape& shape) {
  const auto plane = static_cast<std::ptrdiff_t>(shape.size.pixel_count());
  std::vector<double> sums(static_cast<std::size_t>(shape.bins), 0.0);
  for (std::ptrdiff_t channel = 0; channel < 2 * shape.bins; ++channel) {
    const auto begin = volume.begin() + channel * plane;
    sums[static_cast<std::size_t>(channel % shape.bins)] +=
        std::accumulate(begin, begin + plane, 0.0);
  }
  return sums;
}

/// Each volume's events over time, as a line.
cv::Mat bins_panel(const ComparedPair& pair, cv::Size size) {
  cv::Mat panel(size, CV_8UC3, cv::Scalar::all(0));
  std::vector<std::vector<double>> lines;
  double most = 0;
  for (const NamedVolume& named : pair.volumes) {
    lines.push_back(events_per_bin(named.volume, pair.shape));
    most = std::max(most, *std::ranges::max_element(lines.back()));
  }
  for (std::size_t line = lines.size(); line-- > 0;) {  // the first on top
    std::vector<cv::Point> points;
    for (int bin = 0; bin < pair.shape.bins; ++bin) {
      const double share = most > 0 ? lines[line][static_cast<std::size_t>(bin)] / most : 0;
      points.emplace_back((2 * bin + 1) * size.width / (2 * pair.shape.bins),
                          static_cast<int>((1 - 0.95 * share) * (size.height - 1)));
    }
    cv::polylines(panel, points, false, volume_colour(line), 1, cv::LINE_AA);
  }
  return panel;
}

void write_text(cv::Mat& canvas, const std::string& text, cv::Point at, const cv::Scalar& colour) {
  cv::putText(canvas, text, at, cv::FONT_HERSHEY_SIMPLEX, kTextSize, colour, 1, cv::LINE_AA);
}

cv::Mat row_image(const ComparedPair& pair) {
  const ImageSize size = pair.shape.size;
  const int factor = std::max(1, kPanelRoom / size.width);
  const cv::Size shown(size.width * factor, size.height * factor);
  struct Panel {
    cv::Mat image;
    std::string caption;
    cv::Scalar colour;
  };
  std::vector<Panel> panels{
      {frame_panel(pair.frames.data(), size), "previous frame", kInk},
      {frame_panel(pair.frames.data() + size.pixel_count(), size), "next frame", kInk}};
  for (std::size_t i = 0; i < pair.volumes.size(); ++i) {
    panels.push_back(
        {time_panel(pair.volumes[i].volume, pair.shape), pair.volumes[i].name, volume_colour(i)});
  }
  panels.push_back({bins_panel(pair, shown), "events a bin", kInk});

  const int columns = static_cast<int>(panels.size());
  cv::Mat row(2 * kTitle + shown.height, columns * (shown.width + kGap) + kGap, CV_8UC3, kPaper);
  write_text(row, pair.title, {kGap, kTitle - 7}, kInk);
  for (int i = 0; i < columns; ++i) {
    const Panel& panel = panels[static_cast<std::size_t>(i)];
    const int left = kGap + i * (shown.width + kGap);
    cv::Mat place = row(cv::Rect({left, kTitle}, shown));
    cv::resize(panel.image, place, shown, 0, 0, cv::INTER_NEAREST);
    write_text(row, panel.caption, {left, 2 * kTitle + shown.height - 7}, panel.colour);
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
    rows.push_back(row_image(pair));
    width = std::max(width, rows.back().cols);
  }
  for (cv::Mat& row : rows) {  // pairs may differ in size
    cv::copyMakeBorder(row, row, 0, 0, 0, width - row.cols, cv::BORDER_CONSTANT, kPaper);
  }
  cv::Mat image;
  cv::vconcat(rows, image);
  write_file_atomically(path,
                        encode_png({{image.rows, image.cols}, image.data}, /*is_drawn=*/true));
}

}  // namespace eventgan
