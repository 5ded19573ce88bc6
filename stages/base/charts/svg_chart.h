#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace eventgan {

/// Text as HTML and XML show it: & < > " and ' as entities, bytes that are no UTF-8 and control
/// characters as U+FFFD; beyond `most` bytes cut, with an ellipsis.
std::string escaped(const std::string& text, std::size_t most = 300);

enum class ChartMark { kBar, kLine, kFaintLine, kPoint };

/// What shares a colour, and for points a shape.
struct ChartSeries {
  std::string name;       ///< in the legend; empty: not there
  std::vector<double> y;  ///< of bars as many in each series
  ChartMark mark = ChartMark::kBar;
  std::vector<double> x = {};              ///< of each y, in rising order for a line; not of bars
  std::vector<std::string> captions = {};  ///< beside each point, or empty
  std::vector<std::string> tooltips = {};  ///< of each point, or empty
};

/// Bars, or lines and points, on axes that fit their values. Not drawn: values that are not finite,
/// bars below zero, and on a logarithmic axis what is not above zero. A line has a gap there.
struct Chart {
  std::string title, x_axis, y_axis;
  std::vector<ChartSeries> series = {};
  /// Below the bars; or, one more than bars, below their edges.
  std::vector<std::string> labels = {};
  bool stacked = false;  ///< bars of one label upon each other, not beside
  bool log_x = false, log_y = false;
  std::vector<double> rules = {};       ///< x of vertical lines, where there are values
  std::vector<std::string> notes = {};  ///< lines below it
  double width = 460, plot_height = 202;
};

/// The chart as one SVG element, without its title, for a page that has chart_style().
std::string chart_svg(const Chart& chart);

/// CSS of charts, in colours for light and dark that colour-blind readers can tell apart. The
/// colours of series are the classes s0 to s5.
std::string chart_style();

/// The charts, row by row in so many columns, as an SVG file of its own: no network, no script.
std::string chart_file(const std::string& title, const std::vector<Chart>& charts, int columns);

}  // namespace eventgan
