#include "stages/base/charts/svg_chart.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <regex>
#include <string>
#include <vector>

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinite = std::numeric_limits<double>::infinity();

TEST(Escaped, LeavesNoMarkupAndNoBrokenText) {
  EXPECT_EQ(escaped("<b a=\"1\" c='2'>&"), "&lt;b a=&quot;1&quot; c=&#39;2&#39;&gt;&amp;");
  EXPECT_EQ(escaped("a\xFF\x01z\n"), "a\uFFFD\uFFFDz\n");
  EXPECT_EQ(escaped("äöü", 2), "ä…") << "a letter of two bytes stays whole";
  EXPECT_EQ(escaped("abc", 3), "abc");
}

/// What the first group of `pattern` matches, in turn.
std::vector<std::string> all(const std::string& svg, const std::string& pattern) {
  const std::regex regex(pattern);
  std::vector<std::string> found;
  for (std::sregex_iterator at(svg.begin(), svg.end(), regex), none; at != none; ++at) {
    found.push_back((*at)[1]);
  }
  return found;
}

std::vector<std::string> y_ticks(const std::string& svg) {
  return all(svg, "text-anchor=\"end\">([^<]*)<");
}
std::vector<std::string> x_ticks(const std::string& svg) {
  return all(svg, "text-anchor=\"middle\">([-+.e0-9]+)<");
}

Chart bars(const std::vector<double>& values) {
  Chart chart{"title", "across", "up", {{"", values}}};
  for (std::size_t i = 0; i < values.size(); ++i) chart.labels.push_back("bar");
  return chart;
}

Chart curve(const std::vector<double>& x, const std::vector<double>& y,
            ChartMark mark = ChartMark::kLine) {
  return {"title", "across", "up", {{"", y, mark, x}}};
}

TEST(ChartSvg, BarsStandOnZeroAndStackedOnesAddUp) {
  std::string svg = chart_svg(bars({3, 7}));
  // 7 in five steps is 1.4, rounded up to 2: the axis ends at 8.
  EXPECT_THAT(y_ticks(svg), ElementsAre("0", "2", "4", "6", "8"));
  // The plot is 202 high and begins at 12.
  EXPECT_THAT(all(svg, "<rect [^>]* height=\"([0-9.]+)\""), ElementsAre("75.75", "176.75"));
  EXPECT_THAT(all(svg, "<rect [^>]* y=\"([0-9.]+)\""), ElementsAre("138.25", "37.25"));
  Chart chart = bars({1, 2});
  chart.series.push_back({"upper", {3, kNan}});
  chart.stacked = true;
  svg = chart_svg(chart);
  EXPECT_THAT(y_ticks(svg), ElementsAre("0", "1", "2", "3", "4"));
  EXPECT_THAT(all(svg, "<rect [^>]* y=\"([0-9.]+)\""), ElementsAre("163.50", "12.00", "113.00"));
  svg = chart_svg(curve({0, 50, 100}, {-3, 1, 7}));
  EXPECT_THAT(y_ticks(svg), ElementsAre("-4", "-2", "0", "2", "4", "6", "8"));
  // Two letters beside the axis: it begins at 28 + 2 * 7.7 and ends 28 before 460.
  EXPECT_THAT(x_ticks(svg), ElementsAre("0", "50", "100"));
  EXPECT_THAT(svg, HasSubstr("d=\"M43.4 197.2L43.4 197.2L237.7 129.8L237.7 129.8L432.0 28.8"));
}

TEST(ChartSvg, ALogarithmicAxisHasTicksOfDecadesOrOfTheirParts) {
  Chart chart = curve({1, 10}, {1e-6, 1e6}, ChartMark::kPoint);
  chart.log_y = true;
  // Twelve decades and 4 % at either end, in five steps: each third decade.
  EXPECT_THAT(y_ticks(chart_svg(chart)), ElementsAre("1e-06", "0.001", "1", "1000", "1000000"));
  chart.series[0].y = {2, 11};
  EXPECT_THAT(y_ticks(chart_svg(chart)), ElementsAre("5", "10")) << "less than a decade";
  chart.series[0].y = {2, 40};
  EXPECT_THAT(y_ticks(chart_svg(chart)), ElementsAre("2", "5", "10", "20"));
  chart.series[0].y = {2, 3};
  EXPECT_THAT(y_ticks(chart_svg(chart)), ElementsAre("2", "2.5", "3"));
  chart.series[0].y = {0, -1};
  EXPECT_THAT(chart_svg(chart), HasSubstr("nothing to show"));
}

TEST(ChartSvg, PointsHaveCaptionsTooltipsAndAShapeForEachSeries) {
  Chart chart = curve({1, 2}, {1, 2}, ChartMark::kPoint);
  chart.series[0].captions = {"", "<1>"};
  chart.series[0].tooltips = {"first", "second & last"};
  chart.series[0].name = "one";
  chart.series.push_back({"other", {1.5}, ChartMark::kPoint, {1.5}});
  const std::string svg = chart_svg(chart);
  EXPECT_THAT(svg, HasSubstr(">&lt;1&gt;</text>"));
  EXPECT_THAT(svg, HasSubstr("<title>second &amp; last: 2, 2</title>"));
  EXPECT_EQ(all(svg, "class=\"(s0) mark\"").size(), 3u) << "two points, and one in the legend";
  EXPECT_THAT(all(svg, "s0 mark\" d=\"M[0-9.]+ [0-9.]+([a-z])"), ::testing::Each("m"));
  EXPECT_NE(all(svg, "s0 mark\" d=\"M[0-9.]+ [0-9.]+(m[^\"]*)").at(0),
            all(svg, "s1 mark\" d=\"M[0-9.]+ [0-9.]+(m[^\"]*)").at(0));
}

/// Opened tags are closed in turn, attributes are quoted, no number is NaN or infinite.
void expect_sound(const std::string& svg) {
  EXPECT_TRUE(all(svg, "[ \"](-?nan|-?inf)").empty()) << svg;
  const std::regex tag("<(/?)([a-z]+)((?: [a-zA-Z-]+=\"[^\"<&]*\")*)(/?)>|[<>]");
  std::vector<std::string> open;
  for (std::sregex_iterator at(svg.begin(), svg.end(), tag), none; at != none; ++at) {
    ASSERT_TRUE((*at)[2].matched) << at->str() << " at " << at->position() << " of " << svg;
    if ((*at)[1].length() > 0) {
      ASSERT_FALSE(open.empty());
      EXPECT_EQ(open.back(), (*at)[2]);
      open.pop_back();
    } else if ((*at)[4].length() == 0) {
      open.push_back((*at)[2]);
    }
  }
  EXPECT_THAT(open, IsEmpty());
}

/// Every text is within the chart, and no tick's number reaches the rotated title of its axis,
/// which takes the leftmost 18.
void expect_texts_inside(const std::string& svg) {
  const std::regex text("<text x=\"([0-9.]+)\"[^>]* text-anchor=\"(middle|end)\">([^<]*)<");
  std::size_t count = 0;
  for (std::sregex_iterator at(svg.begin(), svg.end(), text), none; at != none; ++at, ++count) {
    const double width = 7.7 * static_cast<double>((*at)[3].length());
    const double right = std::stod((*at)[1]) + ((*at)[2] == "middle" ? width / 2 : 0);
    EXPECT_GE(right - width, (*at)[2] == "middle" ? 0 : 18) << at->str();
    EXPECT_LE(right, 460) << at->str();
  }
  EXPECT_TRUE(count > 4 || svg.find("nothing to show") != svg.npos) << svg;
}

TEST(ChartSvg, LabelsOfEdgesAreNotCutOff) {
  Chart chart = bars({1, 2, 3, 4, 5, 6, 7, 8, 9, 1.4e-4});
  chart.labels.assign(11, "1.2e-05");
  expect_texts_inside(chart_svg(chart));
}

TEST(ChartSvg, IsSoundForAnyValues) {
  const std::vector<std::vector<double>> cases{{},
                                               {0},
                                               {5},
                                               {-5},
                                               {0, 0},
                                               {3, 3, 3},
                                               {kNan, 1},
                                               {kNan},
                                               {kInfinite},
                                               {-kInfinite},
                                               {1e308, 5},
                                               {-1.7e308, 1.7e308},
                                               {5e-324},
                                               {5e-324, 1},
                                               {1e15, 1e15 + 0.125},
                                               {1, 1e300},
                                               {1e-300, 1e-299},
                                               {-1.234e-5, -1.236e-5},
                                               {123'456, 999'999}};
  for (const auto& values : cases) {
    std::vector<std::string> drawn{chart_svg(bars(values))};
    for (const ChartMark mark : {ChartMark::kLine, ChartMark::kPoint}) {
      for (const bool logarithmic : {false, true}) {
        Chart chart = curve(values, values, mark);
        chart.log_x = chart.log_y = logarithmic;
        chart.rules = {1};
        drawn.push_back(chart_svg(chart));
      }
    }
    for (const std::string& svg : drawn) {
      expect_sound(svg);
      expect_texts_inside(svg);
      EXPECT_LE(y_ticks(svg).size(), 16u) << svg;
    }
  }
}

TEST(ChartSvg, EqualValuesLieInTheMiddle) {
  const std::string svg = chart_svg(curve({1}, {50}));
  // 50 and a tenth to either side: from 45 to 55, 50 is in the middle of 12 to 214.
  EXPECT_THAT(y_ticks(svg), ElementsAre("44", "46", "48", "50", "52", "54", "56"));
  EXPECT_THAT(svg, HasSubstr(" 113.0L"));
  EXPECT_THAT(chart_svg(bars({})), HasSubstr("nothing to show"));
}

TEST(ChartSvg, ALineOfAMillionValuesStaysSmallAndKeepsItsPeak) {
  std::vector<double> x, y;
  for (int i = 0; i < 1'000'000; ++i) {
    x.push_back(i);
    y.push_back(i == 777'777 ? 10 : 0);
  }
  const std::string svg = chart_svg(curve(x, y));
  EXPECT_LT(svg.size(), 20'000u);
  EXPECT_THAT(svg, HasSubstr(" 12.0L")) << "10 is the top";
}

TEST(ChartFile, IsSoundWithHostileTextsAndShowsAllCharts) {
  const std::string hostile = "<script>\"'&\xFF";
  Chart chart = bars({1, 2});
  chart.title = chart.x_axis = chart.y_axis = hostile;
  chart.labels = {hostile, hostile};
  chart.series[0].name = hostile;
  chart.series.push_back({hostile, {1, 2}});
  chart.notes = {hostile};
  std::string svg = chart_file(hostile, {chart, curve({1, 2}, {1, 2}), chart}, 2);
  EXPECT_THAT(svg, Not(HasSubstr("<script")));
  EXPECT_THAT(svg, HasSubstr("width=\"968\"")) << "16 + 460 + 16 + 460 + 16";
  svg = std::regex_replace(svg, std::regex("&(amp|lt|gt|quot|#39);"), "");
  expect_sound(svg);
  expect_sound(chart_file("", {}, 1));
}

}  // namespace
}  // namespace eventgan
