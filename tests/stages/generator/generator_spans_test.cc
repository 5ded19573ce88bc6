#include "stages/generator/generator_spans.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <vector>

namespace eventgan {
namespace {

TEST(CheckGeneratorSpans, TakesFramesAndVolumeOfOneSize) {
  const std::vector<float> frames(2 * 6), volume(18 * 6);
  EXPECT_NO_THROW(check_generator_spans(frames, {2, 3}, volume, 9));
}

TEST(CheckGeneratorSpans, RefusesOthers) {
  const std::vector<float> frames(2 * 6), volume(18 * 6);
  EXPECT_THROW(check_generator_spans(frames, {3, 3}, volume, 9), std::invalid_argument);
  EXPECT_THROW(check_generator_spans(frames, {2, 3}, volume, 8), std::invalid_argument);
  EXPECT_THROW(check_generator_spans({}, {0, 0}, {}, 9), std::invalid_argument);
  EXPECT_THROW(check_generator_spans(frames, {-2, -3}, volume, 9), std::invalid_argument);
}

}  // namespace
}  // namespace eventgan
