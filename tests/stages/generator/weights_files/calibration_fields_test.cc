#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <memory>

#include "manifests/faults.h"
#include "stages/generator/untrained.h"
#include "stages/generator/weights_files/safetensors.h"
#include "stages/generator/weights_files/weights_file.h"
#include "tests/stages/generator/calibration/sample_calibration.h"

namespace eventgan {
namespace {

Weights calibrated_weights() {
  Weights weights = untrained_weights(2, 9, 3);
  weights.calibration = std::make_shared<const Calibration>(testing::sample_calibration(2, 1));
  return weights;
}

TEST(CalibrationFields, RoundTrip) {
  const Weights weights = calibrated_weights();
  const std::string bytes = serialize_weights(weights);
  const Weights back = parse_weights(bytes, "NAME");
  ASSERT_NE(back.calibration, nullptr);
  EXPECT_EQ(back.metadata, weights.metadata);
  EXPECT_EQ(back.calibration->pairs, weights.calibration->pairs);
  EXPECT_EQ(back.calibration->origin, weights.calibration->origin);
  ASSERT_EQ(back.calibration->tensors.size(), weights.calibration->tensors.size());
  for (std::size_t i = 0; i < back.calibration->tensors.size(); ++i) {
    const TensorStatistics& got = back.calibration->tensors[i];
    const TensorStatistics& wanted = weights.calibration->tensors[i];
    EXPECT_EQ(got.name, wanted.name);
    EXPECT_EQ(got.highest, wanted.highest);
    EXPECT_EQ(got.mean, wanted.mean);
    EXPECT_EQ(got.offset, wanted.offset);
    EXPECT_EQ(got.mixing, wanted.mixing);
  }
  EXPECT_EQ(serialize_weights(back), bytes);
}

TEST(CalibrationFields, AreAbsentWithoutACalibration) {
  const std::string bytes = serialize_weights(untrained_weights(2, 9, 3));
  EXPECT_EQ(bytes.find("calibration"), std::string::npos);
  EXPECT_EQ(parse_weights(bytes, "NAME").calibration, nullptr);
}

TEST(CalibrationFields, RefuseHalfACalibration) {
  const SafetensorsFile whole = parse_safetensors(serialize_weights(calibrated_weights()), "test");
  const auto refused = [](const SafetensorsFile& changed) {
    EXPECT_THROW(parse_weights(serialize_safetensors(changed), "NAME"), InputError);
  };
  for (const char* key : {"calibration.pairs", "calibration.origin"}) {
    SafetensorsFile changed = whole;
    changed.metadata.erase(key);
    refused(changed);
  }
  for (const char* pairs : {"0", "-3", "", "many", "1.5", "99999999999"}) {
    SafetensorsFile changed = whole;
    changed.metadata["calibration.pairs"] = pairs;
    refused(changed);
  }
  for (const char* tensor : {"calibration.head.mixing", "calibration.resblocks.0.mean",
                             "calibration.decoders.2.highest", "calibration.encoders.3.offset"}) {
    SafetensorsFile changed = whole;
    changed.tensors.erase(tensor);
    refused(changed);
    changed = whole;
    changed.tensors[tensor] = {{1}, {0}};
    refused(changed);
    changed = whole;
    changed.tensors[tensor].values[0] = std::numeric_limits<float>::quiet_NaN();
    refused(changed);
  }
  SafetensorsFile changed = whole;
  changed.tensors["calibration.resblocks.0.mixing"] = {{1}, {0}};
  refused(changed);
  changed = whole;
  changed.tensors["calibration.head.highest"].values[1] = -1;
  refused(changed);
}

}  // namespace
}  // namespace eventgan
