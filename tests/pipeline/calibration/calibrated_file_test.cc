#include "pipeline/calibration/calibrated_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

class CalibratedFile : public ::testing::Test {
 protected:
  CalibratedFile() { manifest_.directory = folder_.path(); }

  std::filesystem::path file(const std::string& weights,
                             const std::optional<std::string>& out = std::nullopt) {
    manifest_.generator.weights = weights;
    return calibrated_file(manifest_, 16, out);
  }

  testing::TemporaryFolder folder_;
  JobManifest manifest_;
};

TEST_F(CalibratedFile, StandsBesideTheManifest) {
  EXPECT_EQ(file("shipped"), folder_ / "eventgan-16-calibrated.safetensors");
  EXPECT_EQ(file("shipped:16"), folder_ / "eventgan-16-calibrated.safetensors");
  EXPECT_EQ(file("untrained:16"), folder_ / "untrained-16-calibrated.safetensors");
  EXPECT_EQ(file("a.b.safetensors"), folder_ / "a.b-calibrated.safetensors");
  EXPECT_EQ(file("/elsewhere/w.safetensors"), folder_ / "w-calibrated.safetensors");
}

TEST_F(CalibratedFile, IsTheInputOnlyIfThatIsSaid) {
  testing::write_file(folder_ / "w-calibrated.safetensors", "");
  EXPECT_THROW(file("w-calibrated.safetensors"), UsageError);
  EXPECT_EQ(file("w-calibrated.safetensors", folder_ / "w-calibrated.safetensors"),
            folder_ / "w-calibrated.safetensors");
  EXPECT_EQ(file("w-calibrated.safetensors", folder_ / "other.safetensors"),
            folder_ / "other.safetensors");
}

TEST_F(CalibratedFile, MustHaveTheRightNameAndAFolder) {
  for (const std::string out : {"", "w", "w.h5"}) {
    EXPECT_THROW(file("shipped", folder_ / out), UsageError) << out;
  }
  EXPECT_THROW(file("shipped", folder_ / "none" / "w.safetensors"), UsageError);
}

TEST_F(CalibratedFile, IsNamedInTheManifestFromItsFolder) {
  EXPECT_EQ(calibrated_generator_line(manifest_, folder_ / "sub" / "w \"8\".safetensors"),
            R"("generator": { "weights": "sub/w \"8\".safetensors", "precision": "int8" })");
  EXPECT_EQ(calibrated_generator_line(manifest_, "/elsewhere/w.safetensors"),
            R"("generator": { "weights": "/elsewhere/w.safetensors", "precision": "int8" })");
}

}  // namespace
}  // namespace eventgan
