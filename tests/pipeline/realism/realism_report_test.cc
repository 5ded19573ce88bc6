#include "pipeline/realism/realism_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

namespace eventgan {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

MethodSummary method_of(const std::string& name, double f1, double mse, double events) {
  MethodSummary method;
  method.name = name;
  method.settings = "settings of " + name;
  method.mean.f1_time = f1;
  method.mean.pool_mse_2 = mse;
  method.mean.events_per_pixel = events;
  method.mean.time_correlation = kNaN;
  method.mean.events_per_bin = {events / 2, events / 2};
  method.intervals.push_back({method.mean, std::nullopt});
  return method;
}

RealismReport two_methods() {
  RealismReport report;
  report.recording = "slider";
  report.size = {180, 240};
  report.bins = 2;
  report.seed = 5;
  report.intervals.push_back({{3, 5}, 0.25, 1234});
  report.real = method_of("real", 1, 0, 0.3);
  report.methods.push_back(method_of("network", 0.5, 0.02, 0.25));
  report.methods.push_back(method_of("difference", 0.25, 0.01, 0.4));
  return report;
}

TEST(RealismText, MarksTheBestOfEachRow) {
  const std::string text = to_text(two_methods());
  EXPECT_THAT(text, ContainsRegex("F1, summed over time +↑ +0.5000\\* +0.2500 \n"));
  EXPECT_THAT(text, ContainsRegex("PoolMSE 2 +↓ +0.0200 +0.0100\\*\n"));
  EXPECT_THAT(text, ContainsRegex("events per pixel +≈ +0.3000 +0.2500\\* +0.4000 \n"));
  EXPECT_THAT(text, ContainsRegex("in bin 1 +≈ +0.1500 +0.1250\\* +0.2000 \n"));
  EXPECT_THAT(text, ContainsRegex("correlation of mean times +↑ +- +- \n"));
}

TEST(RealismText, SaysWhatWasCompared) {
  const std::string text = to_text(two_methods());
  EXPECT_THAT(text, HasSubstr("slider: 240x180 pixels, 1 pair of frames (gap 2: 1), 1234 real"));
  EXPECT_THAT(text, HasSubstr("difference: settings of difference"));
  EXPECT_THAT(text, Not(HasSubstr("direction")));
}

TEST(RealismText, HasTheDirectionWhereTheFlowIsKnown) {
  RealismReport report = two_methods();
  report.real.direction = DirectionScore{200, 180};
  report.methods[0].direction = DirectionScore{100, 80};
  report.methods[1].direction = DirectionScore{};
  const std::string text = to_text(report);
  EXPECT_THAT(text, ContainsRegex("direction within 30 deg +↑ +0.9000 +0.8000\\* +- \n"));
  EXPECT_THAT(text, ContainsRegex("pixels that tell it +200 +100 +0 \n"));
}

TEST(RealismText, OfOneMethodMarksNothing) {
  RealismReport report = two_methods();
  report.methods.pop_back();
  EXPECT_THAT(to_text(report), Not(HasSubstr("0.5000*")));
}

TEST(RealismJson, HasEverything) {
  RealismReport report = two_methods();
  report.methods[0].intervals[0].direction = DirectionScore{7, 3};
  const auto json = nlohmann::json::parse(to_json(report));
  EXPECT_EQ(json["recording"], "slider");
  EXPECT_EQ(json["seed"], 5);
  EXPECT_EQ(json["pairs"][0]["gap"], 2);
  EXPECT_EQ(json["pairs"][0]["events"], 1234);
  EXPECT_EQ(json["real"]["mean"]["events_per_pixel"], 0.3);
  const auto& network = json["methods"][0];
  EXPECT_EQ(network["name"], "network");
  EXPECT_EQ(network["mean"]["f1_time"], 0.5);
  EXPECT_TRUE(network["mean"]["time_correlation"].is_null());
  EXPECT_EQ(network["mean"]["events_per_bin"].size(), 2u);
  EXPECT_FALSE(network["mean"].contains("direction"));
  EXPECT_EQ(network["pairs"][0]["first_frame"], 3);
  EXPECT_EQ(network["pairs"][0]["direction"]["within_30_deg"], 3);
}

}  // namespace
}  // namespace eventgan
