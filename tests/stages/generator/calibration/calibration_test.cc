#include "stages/generator/calibration/calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "tests/stages/generator/calibration/sample_calibration.h"

namespace eventgan {
namespace {

template <class Change>
void expect_refused(const std::string& reason, const Change& change) {
  Calibration calibration = testing::sample_calibration(2, 1);
  change(calibration);
  try {
    check_calibration(calibration, 2, "NAME");
    ADD_FAILURE() << "accepted: " << reason;
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr(reason));
    EXPECT_THAT(error.what(), ::testing::EndsWith("in NAME"));
  }
}

TEST(CheckCalibration, TakesAWholeOneAndRefusesTheRest) {
  EXPECT_NO_THROW(check_calibration(testing::sample_calibration(2, 1), 2, "NAME"));
  EXPECT_THROW(check_calibration(testing::sample_calibration(2, 1), 3, "NAME"), std::runtime_error);
  expect_refused("at least 1 pair, got 0", [](auto& c) { c.pairs = 0; });
  expect_refused("expected 12 calibrated tensors, got 11", [](auto& c) { c.tensors.pop_back(); });
  expect_refused("statistics for head", [](auto& c) { c.tensors[0].name = "tail"; });
  expect_refused("expected 2 values for head, got 1",
                 [](auto& c) { c.tensors[0].mean.pop_back(); });
  expect_refused("expected 0 values for resblocks.0, got 1",
                 [](auto& c) { c.tensors[6].offset.push_back(0); });
  expect_refused("expected 4 values for head", [](auto& c) { c.tensors[0].mixing.clear(); });
  expect_refused("finite", [](auto& c) { c.tensors[3].mixing[5] = std::nanf(""); });
  expect_refused("finite", [](auto& c) { c.tensors[3].highest[1] = INFINITY; });
  expect_refused("negative", [](auto& c) { c.tensors[11].highest[1] = -1; });
  expect_refused("negative", [](auto& c) { c.tensors[5].mean[1] = -1e-9f; });
}

}  // namespace
}  // namespace eventgan
