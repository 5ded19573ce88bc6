#include "pipeline/simulation/simulation_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace eventgan {
namespace {

SimulationReport report() {
  return {"/out", {{"a", 11, 3000, 100, 10, 2.5}, {"b", 5, 0, 500, 2, 0}}, {"c"}, 8};
}

TEST(SimulationReport, GivesEventsPerPixelAndSecond) {
  EXPECT_EQ(report().made[0].events_per_pixel_second(), 3);
  EXPECT_EQ(RecordingSummary().events_per_pixel_second(), 0);
  const std::string text = to_text(report());
  EXPECT_THAT(text, ::testing::HasSubstr("3000"));
  // 3000 events in 100 x 10 + 500 x 2 pixel seconds.
  EXPECT_THAT(text, ::testing::ContainsRegex("all +16 +3000 +1.500 +2.5"));
  EXPECT_THAT(text, ::testing::HasSubstr("2 recordings made, 1 kept from before; 8.0 s, 0.50 s a"));
}

TEST(SimulationReport, IsOneLineOfJson) {
  const auto json = nlohmann::json::parse(to_json(report()));
  EXPECT_EQ(json.at("made").at(0).at("events"), 3000);
  EXPECT_EQ(json.at("total").at("events_per_pixel_second"), 1.5);
  EXPECT_EQ(json.at("kept").at(0), "c");
}

TEST(SimulationReport, OfNothingHasNoTable) {
  EXPECT_EQ(to_text(SimulationReport()).substr(0, 19), "0 recordings made, ");
}

}  // namespace
}  // namespace eventgan
