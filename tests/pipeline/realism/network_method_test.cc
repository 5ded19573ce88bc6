#include "pipeline/realism/network_method.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "tests/testing/fake_generator.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::FloatEq;
using ::testing::HasSubstr;

TEST(NetworkMethod, GivesTheFramesToTheGenerator) {
  const auto method = make_network_method(std::make_unique<testing::FakeGenerator>(1), "w.st");
  // The fake's volume of one bin is max(next - previous, 0) and max(previous - next, 0).
  const IntervalFrames frames{{0, 1}, 0.1, {{1, 2}, {0, 255}}, {{1, 2}, {255, 204}}, 0};
  EXPECT_THAT(method->volume(frames, 0), ElementsAre(2.0f, 0.0f, 0.0f, FloatEq(0.4f)));
  EXPECT_EQ(method->name(), "network");
  EXPECT_EQ(method->draws(), 1);
  EXPECT_THAT(method->settings(), HasSubstr("w.st"));
}

TEST(OpenRealismGenerator, RefusesNamesAndFilesThatAreNoWeights) {
  const testing::TemporaryFolder folder;
  EXPECT_THROW(open_realism_generator((folder / "absent.safetensors").string()), InputError);
  EXPECT_THROW(open_realism_generator("shipped:"), UsageError);
  EXPECT_THROW(open_realism_generator("shipped:8x"), UsageError);
  EXPECT_THROW(open_realism_generator("shipped:12345"), UsageError);
  EXPECT_THROW(open_realism_generator("shipped:63"), InputError);  // a width that is not shipped
  EXPECT_THROW(open_realism_generator("untrained:8"), UsageError);
}

}  // namespace
}  // namespace eventgan
