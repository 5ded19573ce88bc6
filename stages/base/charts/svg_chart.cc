#include "stages/base/charts/svg_chart.h"

#include <fmt/core.h>
#include <utf8.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <utility>

namespace eventgan {

std::string escaped(const std::string& text, std::size_t most) {
  std::string sound;
  utf8::replace_invalid(text.begin(), text.end(), std::back_inserter(sound));
  std::string html;
  for (std::size_t i = 0; i < sound.size(); ++i) {
    const char c = sound[i];
    const bool begins = (static_cast<unsigned char>(c) & 0xC0) != 0x80;
    if (i >= most && begins) return html + "…";
    switch (c) {
      case '&':
        html += "&amp;";
        break;
      case '<':
        html += "&lt;";
        break;
      case '>':
        html += "&gt;";
        break;
      case '"':
        html += "&quot;";
        break;
      case '\'':
        html += "&#39;";
        break;
      default:
        html += static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t' ? "\uFFFD"
                                                                               : std::string(1, c);
    }
  }
  return html;
}

namespace {

constexpr std::size_t kColours = 6;
constexpr std::size_t kMostLabel = 14, kMostName = 90, kMostTitle = 180;
constexpr double kCharacter = 7.7;  // of 12 px in DejaVu Sans, a wide typeface
constexpr double kLine = 18;        // of text
constexpr double kTop = 12, kRight = 28;
constexpr double kTiny = 1e-300, kHuge = 1e300;  // further out, axes would overflow

// ---- Axes

/// The value as an axis can place it; NaN if it cannot.
double placeable(double value, bool logarithmic) {
  if (!std::isfinite(value) || (logarithmic && value <= 0)) return std::nan("");
  if (logarithmic) return std::clamp(value, kTiny, kHuge);
  return std::abs(value) < kTiny ? 0 : std::clamp(value, -kHuge, kHuge);
}

struct Range {
  double low = kHuge * 10, high = -kHuge * 10;
  void add(double value) {
    if (std::isnan(value)) return;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  bool empty() const { return low > high; }
};

/// 1, 2 or 5 times a power of ten, `least` or just above.
double tick_step(double least) {
  const double decade = std::pow(10.0, std::floor(std::log10(least)));
  for (const double digit : {1.0, 2.0, 5.0}) {
    if (digit * decade >= least * (1 - 1e-9)) return digit * decade;
  }
  return 10 * decade;
}

/// The multiples of `step` from `low` to `high`.
std::vector<double> multiples(double step, double low, double high) {
  std::vector<double> values;
  const int last = static_cast<int>(std::floor(high / step + 1e-9));
  for (int i = static_cast<int>(std::ceil(low / step - 1e-9)); i <= last; ++i) {
    values.push_back(i * step);
  }
  return values;
}

struct Axis {
  double low = 0, high = 1;  // of a logarithmic one the decades
  bool logarithmic = false;
  std::vector<double> ticks = {};

  /// 0 at the axis' begin, 1 at its end.
  double share(double value) const {
    return ((logarithmic ? std::log10(value) : value) - low) / (high - low);
  }
};

/// About `steps` steps between ticks; `to_ticks`: it begins and ends at one.
Axis linear_axis(Range range, int steps, bool to_ticks) {
  const double most = std::max(std::abs(range.low), std::abs(range.high));
  if (range.high - range.low <=
      0.01 * most) {  // as good as equal: in the middle, no noise enlarged
    const double room = most > 0 ? 0.1 * most : 1;
    range = {range.low - room, range.high + room};
  }
  const double step = tick_step((range.high - range.low) / steps);
  if (to_ticks) {
    range.low = step * std::floor(range.low / step + 1e-9);
    range.high = step * std::ceil(range.high / step - 1e-9);
  }
  return {range.low, range.high, false, multiples(step, range.low, range.high)};
}

Axis log_axis(const Range& range, int steps) {
  Axis axis{std::log10(range.low), std::log10(range.high), true};
  const double margin = std::max(0.05, 0.04 * (axis.high - axis.low));
  axis.low -= margin;
  axis.high += margin;
  const double decades = axis.high - axis.low;
  if (decades < 1) {
    const double low = std::pow(10.0, axis.low), high = std::pow(10.0, axis.high);
    axis.ticks = multiples(tick_step((high - low) / steps), low, high);
    return axis;
  }
  const bool few = 3 * decades <= steps;  // room for 1, 2 and 5 of each decade
  const int every = std::max(1, static_cast<int>(std::ceil(decades / steps)));
  for (int decade = static_cast<int>(std::floor(axis.low)); decade <= axis.high; ++decade) {
    if (decade % every != 0) continue;
    for (const int digit : {1, 2, 5}) {
      const double place = decade + std::log10(digit);
      if ((digit > 1 && !few) || place < axis.low || place > axis.high) continue;
      axis.ticks.push_back(digit * std::pow(10.0, decade));
    }
  }
  return axis;
}

std::string tick_text(double value) {
  const bool whole = std::abs(value) >= 1e3 && std::abs(value) < 1e7;
  return whole ? fmt::format("{:.0f}", value) : fmt::format("{:.4g}", value);
}

// ---- Marks

/// The plot's place and its axes.
struct Plot {
  double left, width, height;
  Axis x = {}, y = {};

  double x_of(double value) const { return left + width * x.share(value); }
  double y_of(double value) const { return kTop + height * (1 - y.share(value)); }
};

std::string text(const char* anchor, double x, double y, const std::string& escaped_text) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\">{}</text>", x, y, anchor,
                     escaped_text);
}

std::string path(const std::string& classes, const std::string& of, const std::string& inner = "") {
  return "<path class=\"" + classes + "\" d=\"" + of + "\">" + inner + "</path>";
}

/// A shape for each colour, for those who do not see colours.
std::string shape(std::size_t series, double x, double y) {
  constexpr std::array<const char*, kColours> kShapes{"m-4 0a4 4 0 1 0 8 0a4 4 0 1 0 -8 0z",
                                                      "m-3.6 -3.6h7.2v7.2h-7.2z",
                                                      "m0 -4.8l4.5 8h-9z",
                                                      "m0 -5l5 5l-5 5l-5 -5z",
                                                      "m0 4.8l4.5 -8h-9z",
                                                      "m-4.5 -1.5h3v-3h3v3h3v3h-3v3h-3v-3h-3z"};
  return fmt::format("M{:.1f} {:.1f}{}", x, y, kShapes[series % kColours]);
}

std::string colour_of(std::size_t series) { return fmt::format("s{}", series % kColours); }

std::string bars(const Chart& chart, std::size_t count, const Plot& plot) {
  const double slot = plot.width / static_cast<double>(count);
  const double width =
      slot * 0.84 / (chart.stacked ? 1.0 : static_cast<double>(chart.series.size()));
  std::string svg;
  for (std::size_t i = 0; i < count; ++i) {
    double below = 0;
    for (std::size_t s = 0; s < chart.series.size(); ++s) {
      const ChartSeries& series = chart.series[s];
      const double value = placeable(series.y[i], false);
      if (!(value > 0)) continue;
      const double left = plot.left + slot * (static_cast<double>(i) + 0.08) +
                          (chart.stacked ? 0 : width * static_cast<double>(s));
      std::string where = chart.labels[i];
      if (chart.labels.size() > count) where += " – " + chart.labels[i + 1];
      svg += fmt::format(
          "<rect class=\"{} mark\" x=\"{:.2f}\" y=\"{:.2f}\" width=\"{:.2f}\" height=\"{:.2f}\" "
          "data-value=\"{:.6g}\"><title>{}{}{}: {:.4g}</title></rect>",
          colour_of(s), left, plot.y_of(below + value), width,
          plot.y_of(below) - plot.y_of(below + value), value, escaped(series.name, kMostName),
          series.name.empty() ? "" : ", ", escaped(where, kMostName), value);
      if (chart.stacked) below += value;
    }
  }
  return svg;
}

std::string bar_labels(const Chart& chart, std::size_t count, const Plot& plot) {
  std::size_t longest = 1;
  for (const std::string& label : chart.labels) longest = std::max(longest, label.size());
  const auto fitting = static_cast<std::size_t>(
      plot.width / (kCharacter * static_cast<double>(std::min(longest, kMostLabel)) + 8));
  const std::size_t every = (chart.labels.size() + fitting - 1) / fitting;
  const double begin = chart.labels.size() > count ? 0 : 0.5;
  std::string svg;
  for (std::size_t i = 0; i < chart.labels.size(); i += every) {
    const double at = (static_cast<double>(i) + begin) / static_cast<double>(count);
    svg += text("middle", plot.left + plot.width * at, kTop + plot.height + 16,
                escaped(chart.labels[i], kMostLabel));
  }
  return svg;
}

/// A line of any number of values stays small: of those in one column of pixels only the highest
/// and the lowest are there.
std::string line(const ChartSeries& series, const std::string& colour, const Plot& plot) {
  struct Place {
    double x, y;
  };
  std::string way;
  std::vector<Place> column;
  bool begins = true;
  const auto finish = [&] {
    if (column.empty()) return;
    const auto [up, down] = std::ranges::minmax_element(column, {}, &Place::y);
    for (const auto& at : {std::min(up, down), std::max(up, down)}) {
      way += fmt::format("{}{:.1f} {:.1f}", std::exchange(begins, false) ? "M" : "L", at->x, at->y);
    }
    column.clear();
  };
  for (std::size_t i = 0; i < series.y.size(); ++i) {
    const double x = placeable(series.x[i], plot.x.logarithmic);
    const double y = placeable(series.y[i], plot.y.logarithmic);
    if (std::isnan(x) || std::isnan(y)) {
      finish();
      begins = true;
      continue;
    }
    const Place place{plot.x_of(x), plot.y_of(y)};
    if (!column.empty() && std::floor(column.front().x) != std::floor(place.x)) finish();
    column.push_back(place);
  }
  finish();
  if (way.empty()) return "";
  return path(colour + (series.mark == ChartMark::kLine ? " line" : " faint line"), way);
}

std::string points(const ChartSeries& series, std::size_t index, const Plot& plot) {
  std::string svg;
  for (std::size_t i = 0; i < series.y.size(); ++i) {
    const double x = placeable(series.x[i], plot.x.logarithmic);
    const double y = placeable(series.y[i], plot.y.logarithmic);
    if (std::isnan(x) || std::isnan(y)) continue;
    const double across = plot.x_of(x), down = plot.y_of(y);
    const std::string& name = series.tooltips.empty() ? series.name : series.tooltips[i];
    svg += path(colour_of(index) + " mark", shape(index, across, down),
                fmt::format("<title>{}: {:.4g}, {:.4g}</title>", escaped(name, kMostName), x, y));
    if (!series.captions.empty()) {
      svg += text("start", across + 6, down - 6, escaped(series.captions[i], kMostLabel));
    }
  }
  return svg;
}

// ---- The whole

struct Drawing {
  double height;
  std::string svg;
};

/// Legend and notes, below the axis' title.
Drawing below(const Chart& chart, double top) {
  const auto named =
      std::ranges::count_if(chart.series, [](const auto& s) { return !s.name.empty(); });
  Drawing drawing{top, ""};
  const auto fitting = static_cast<std::size_t>((chart.width - 36) / kCharacter);
  double x = 12;
  for (std::size_t i = 0; i < chart.series.size() && named > 1; ++i) {
    const ChartSeries& series = chart.series[i];
    if (series.name.empty()) continue;
    const auto letters = static_cast<double>(std::min(series.name.size(), fitting));
    const double width = 30 + kCharacter * letters;
    if (x > 12 && x + width > chart.width) {
      x = 12;
      drawing.height += kLine;
    }
    const double y = drawing.height + 8;
    drawing.svg +=
        series.mark == ChartMark::kPoint ? path(colour_of(i) + " mark", shape(i, x, y))
        : series.mark == ChartMark::kBar
            ? path(colour_of(i) + " mark", fmt::format("M{:.1f} {:.1f}h10v10h-10z", x - 5, y - 5))
            : path(colour_of(i) + " line", fmt::format("M{:.1f} {:.1f}h12", x - 6, y));
    drawing.svg += text("start", x + 11, y + 4, escaped(series.name, fitting));
    x += width;
  }
  if (named > 1) drawing.height += kLine + 4;
  for (const std::string& note : chart.notes) {
    drawing.svg += text("start", 6, drawing.height + 12, escaped(note, fitting));
    drawing.height += kLine;
  }
  return drawing;
}

/// The ranges of both axes; bars begin at 0.
std::pair<Range, Range> ranges(const Chart& chart, std::size_t bar_count) {
  Range x, y;
  for (std::size_t i = 0; i < bar_count; ++i) {
    double sum = 0;
    for (const ChartSeries& series : chart.series) {
      const double value = std::max(0.0, placeable(series.y[i], false));
      sum = placeable(chart.stacked ? sum + value : std::max(sum, value), false);
    }
    if (sum > 0) y.add(sum);
  }
  if (bar_count > 0) {
    if (!y.empty()) y.add(0);
    return {x, y};
  }
  for (const ChartSeries& series : chart.series) {
    for (std::size_t i = 0; i < series.y.size(); ++i) {
      const double across = placeable(series.x[i], chart.log_x);
      const double up = placeable(series.y[i], chart.log_y);
      if (std::isnan(across) || std::isnan(up)) continue;
      x.add(across);
      y.add(up);
    }
  }
  return {x, y};
}

Drawing draw(const Chart& chart) {
  const bool has_bars = !chart.series.empty() && chart.series.front().mark == ChartMark::kBar;
  const std::size_t bar_count = has_bars ? chart.series.front().y.size() : 0;
  const auto [x, y] = ranges(chart, bar_count);
  if (y.empty()) return {40, text("start", 6, 24, "nothing to show")};

  const int rows = std::max(2, static_cast<int>(chart.plot_height / 40));
  Plot plot{0, 0, chart.plot_height};
  plot.y = chart.log_y ? log_axis(y, rows) : linear_axis(y, rows, true);
  std::size_t longest = 1;
  for (const double tick : plot.y.ticks) longest = std::max(longest, tick_text(tick).size());
  plot.left = 28 + kCharacter * static_cast<double>(longest);
  plot.width = chart.width - plot.left - kRight;

  const double bottom = kTop + plot.height, end = plot.left + plot.width;
  std::string svg;
  for (const double tick : plot.y.ticks) {
    const double at = plot.y_of(tick);
    svg += path("grid", fmt::format("M{:.1f} {:.1f}H{:.1f}", plot.left, at, end)) +
           text("end", plot.left - 6, at + 4, tick_text(tick));
  }
  if (has_bars) {
    svg += bars(chart, bar_count, plot) + bar_labels(chart, bar_count, plot);
  } else {
    const int columns = std::max(2, static_cast<int>(plot.width / 80));
    plot.x = chart.log_x ? log_axis(x, columns) : linear_axis(x, columns, false);
    for (const double tick : plot.x.ticks) {
      const double at = plot.x_of(tick);
      svg += path("grid", fmt::format("M{:.1f} {:.1f}V{:.1f}", at, kTop, bottom)) +
             text("middle", at, bottom + 16, tick_text(tick));
    }
    for (const double rule : chart.rules) {
      if (!(rule >= x.low && rule <= x.high)) continue;
      svg += path("axis rule", fmt::format("M{:.1f} {:.1f}V{:.1f}", plot.x_of(rule), kTop, bottom));
    }
    for (std::size_t i = 0; i < chart.series.size(); ++i) {
      svg += chart.series[i].mark == ChartMark::kPoint ? points(chart.series[i], i, plot)
                                                       : line(chart.series[i], colour_of(i), plot);
    }
  }
  svg += path("axis", fmt::format("M{:.1f} {:.1f}H{:.1f}", plot.left, bottom, end)) +
         text("middle", plot.left + plot.width / 2, bottom + 36, escaped(chart.x_axis)) +
         fmt::format(
             "<text transform=\"translate(13 {:.1f}) rotate(-90)\" "
             "text-anchor=\"middle\">{}</text>",
             kTop + plot.height / 2, escaped(chart.y_axis));
  Drawing rest = below(chart, bottom + 46);
  return {rest.height, svg + rest.svg};
}

}  // namespace

std::string chart_svg(const Chart& chart) {
  const Drawing drawing = draw(chart);
  return fmt::format(
      "<svg class=\"chart\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">{}</svg>",
      chart.width, drawing.height, escaped(chart.title), drawing.svg);
}

std::string chart_style() {
  // No variables: programs that show SVG files, other than browsers, do not know them.
  return R"css(
.chart text{fill:#5c666d;font-size:12px}.chart .title{fill:#1d2327;font-weight:600}.grid{stroke:#dcdfe1}.axis{stroke:#5c666d}
.rule{stroke-dasharray:3 3}.mark{fill:currentColor}.line{fill:none;stroke:currentColor;stroke-width:1.6;stroke-linejoin:round;
stroke-linecap:round}.faint{stroke-width:1;stroke-opacity:.4}
.s0{color:#0072b2}.s1{color:#d55e00}.s2{color:#00875f}.s3{color:#b5478f}.s4{color:#7a838a}.s5{color:#1d2327}
@media (prefers-color-scheme:dark){.chart text{fill:#9aa5ac}.chart .title{fill:#e6e9eb}.grid{stroke:#343c42}.axis{stroke:#9aa5ac}
.s0{color:#56b4e9}.s1{color:#f0883e}.s2{color:#3fc79a}.s3{color:#e08bc4}.s4{color:#8b949b}.s5{color:#e6e9eb}}
)css";
}

std::string chart_file(const std::string& title, const std::vector<Chart>& charts, int columns) {
  constexpr double kMargin = 16, kTitle = 24;
  double width = kMargin + kCharacter * static_cast<double>(std::min(title.size(), kMostTitle));
  double top = kMargin + kTitle;
  std::string svg;
  for (std::size_t i = 0; i < charts.size();) {
    double left = kMargin, height = 0;
    for (int column = 0; column < columns && i < charts.size(); ++column, ++i) {
      const Chart& chart = charts[i];
      const Drawing drawing = draw(chart);
      svg += fmt::format(
          "<g transform=\"translate({} {})\"><text class=\"title\" x=\"6\" y=\"14\">"
          "{}</text><g transform=\"translate(0 {})\">{}</g></g>",
          left, top, escaped(chart.title), kTitle, drawing.svg);
      left += chart.width + kMargin;
      height = std::max(height, drawing.height + kTitle + kMargin);
    }
    width = std::max(width, left);
    top += height;
  }
  return fmt::format(
             "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"chart\" width=\"{0:.0f}\" "
             "height=\"{1:.0f}\" viewBox=\"0 0 {0:.0f} {1:.0f}\" "
             "font-family=\"system-ui,'DejaVu Sans',sans-serif\"><style>",
             width, top) +
         chart_style() +
         ".paper{fill:#fff}@media (prefers-color-scheme:dark){.paper{fill:#1c2226}}</style>"
         "<rect class=\"paper\" width=\"100%\" height=\"100%\"/>" +
         fmt::format("<text class=\"title\" x=\"{}\" y=\"26\">{}</text>", kMargin + 6,
                     escaped(title, kMostTitle)) +
         svg + "</svg>\n";
}

}  // namespace eventgan
