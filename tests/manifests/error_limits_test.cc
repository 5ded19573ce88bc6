#include "manifests/error_limits.h"

#include <gtest/gtest.h>

namespace eventgan {
namespace {

TEST(BeyondLimits, CountAndFractionBothBind) {
  const ErrorSpec errors{ErrorPolicy::kQuarantine, 3, 0.1};
  EXPECT_FALSE(beyond_limits(errors, 0, 0));
  EXPECT_FALSE(beyond_limits(errors, 3, 30));
  EXPECT_TRUE(beyond_limits(errors, 3, 29));  // 10.3 %
  EXPECT_TRUE(beyond_limits(errors, 4, 1000));
}

TEST(BeyondLimits, PolicyFailAllowsNone) {
  const ErrorSpec errors{ErrorPolicy::kFail, 100, 1};
  EXPECT_FALSE(beyond_limits(errors, 0, 10));
  EXPECT_TRUE(beyond_limits(errors, 1, 10));
}

TEST(LimitsText, SaysWhatThePolicyAllows) {
  EXPECT_EQ(limits_text({ErrorPolicy::kQuarantine, 3, 0.25}),
            "at most 3 quarantined pairs and 0.25 of all (errors in the manifest)");
  EXPECT_EQ(limits_text({ErrorPolicy::kFail, 3, 0.25}),
            "no quarantined pair (errors.policy in the manifest is \"fail\")");
}

}  // namespace
}  // namespace eventgan
