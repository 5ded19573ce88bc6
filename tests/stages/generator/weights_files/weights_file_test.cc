#include "stages/generator/weights_files/weights_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "manifests/faults.h"
#include "stages/generator/untrained.h"
#include "stages/generator/weights_files/safetensors.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

TEST(WeightsFile, RoundTrips) {
  const testing::TemporaryFolder folder;
  Weights weights = untrained_weights(2, 9, 3);
  weights.metadata["origin_sha256"] = "abc";
  testing::write_file(folder / "w.safetensors", serialize_weights(weights));
  const Weights back = read_weights(folder / "w.safetensors");
  EXPECT_EQ(back.base_channels, 2);
  EXPECT_EQ(back.bins, 9);
  EXPECT_EQ(back.metadata, weights.metadata);
  EXPECT_EQ(serialize_weights(back), serialize_weights(weights));
}

TEST(WeightsFile, ParsesBytes) {
  const std::string bytes = serialize_weights(untrained_weights(1, 9, 3));
  EXPECT_EQ(serialize_weights(parse_weights(bytes, "NAME")), bytes);
  EXPECT_THROW(parse_weights(bytes.substr(1), "NAME"), InputError);
}

TEST(WeightsFile, TellsWhatGapsItWasTrainedOn) {
  Weights weights = untrained_weights(1, 9, 3);
  const auto written_and_read = [&] { return parse_weights(serialize_weights(weights), "NAME"); };
  EXPECT_EQ(written_and_read().training_gaps, std::nullopt);
  weights.training_gaps = GapRange{1, 5};
  EXPECT_EQ(written_and_read().training_gaps, (GapRange{1, 5}));
  EXPECT_EQ(parse_safetensors(serialize_weights(weights), "").metadata.at("training_gaps"), "1-5");
  for (const char* wrong : {"", "5", "1-", "-5", "0-5", "3-2", "1-5x", "1..5", "1-99999999999"}) {
    SafetensorsFile content = parse_safetensors(serialize_weights(weights), "");
    content.metadata["training_gaps"] = wrong;
    EXPECT_THROW(parse_weights(serialize_safetensors(content), "NAME"), InputError) << wrong;
  }
}

TEST(WeightsFile, TakesTheGapsOfAnEarlierFileFromItsTrainingManifest) {
  Weights weights = untrained_weights(1, 9, 3);
  weights.metadata["training_manifest"] = R"({
    "format": "eventgan-training", "version": 1, "name": "t",
    "recordings": [{ "path": "r.hdf5", "format": "mvsec" }],
    "gaps": [4, 2], "steps": { "flow": 1, "reconstruction": 1, "generator": 1 }, "output": { "directory": "out" } })";
  EXPECT_EQ(parse_weights(serialize_weights(weights), "NAME").training_gaps, (GapRange{2, 4}));
  weights.metadata["training_manifest"] = "gaps: 2, 4";
  EXPECT_EQ(parse_weights(serialize_weights(weights), "NAME").training_gaps, std::nullopt);
}

TEST(WeightsFile, RefusesOtherSafetensorsAndMissingFiles) {
  const testing::TemporaryFolder folder;
  SafetensorsFile content =
      parse_safetensors(serialize_weights(untrained_weights(1, 9, 3)), "test");
  const auto refused = [&](const SafetensorsFile& changed) {
    testing::write_file(folder / "w.safetensors", serialize_safetensors(changed));
    EXPECT_THROW(read_weights(folder / "w.safetensors"), InputError);
  };
  auto changed = content;
  changed.metadata["format"] = "other";
  refused(changed);
  changed = content;
  changed.metadata["base_channels"] = "2";
  refused(changed);
  changed = content;
  changed.metadata["base_channels"] = "-1";
  refused(changed);
  changed = content;
  changed.tensors.erase("pred.bias");
  refused(changed);
  changed = content;
  changed.tensors["extra"] = {{1}, {0}};
  refused(changed);
  changed = content;
  changed.tensors["pred.bias"].values[0] = 1.0f / 0.0f;
  refused(changed);
  changed.tensors["pred.bias"].values[0] = std::numeric_limits<float>::quiet_NaN();
  refused(changed);
  EXPECT_THROW(read_weights(folder / "none.safetensors"), InputError);
}

}  // namespace
}  // namespace eventgan
