#include "manifests/plan_outline.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "tests/manifests/small_plan.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using testing::small_plan;
using ::testing::ThrowsMessage;

PlanOutline read(const std::string& text) {
  std::istringstream stream(text);
  return read_plan_outline(stream, "p");
}

TEST(PlanOutline, IsThePlanWithoutItsSamples) {
  const Plan plan = small_plan();
  for (const PlanOutline& outline : {outline_of(plan), read(to_json(plan))}) {
    EXPECT_EQ(outline.name, plan.name);
    EXPECT_EQ(outline.manifest_text, plan.manifest_text);
    EXPECT_EQ(outline.fingerprint, plan.fingerprint);
    ASSERT_EQ(outline.sources.size(), 2U);
    EXPECT_EQ(outline.sources[0].without_partner_ids, plan.sources[0].without_partner_ids);
    EXPECT_THAT(outline.shards,
                ::testing::ElementsAre(ShardOutline{"job-train-00000-of-00002.h5", 0, {3, 4}, 2},
                                       ShardOutline{"job-train-00001-of-00002.h5", 1, {5, 6}, 1}));
    EXPECT_EQ(outline.sample_count(), 3);
  }
}

TEST(PlanOutline, OfNoShards) { EXPECT_TRUE(read(to_json(Plan{})).shards.empty()); }

TEST(PlanOutline, CountsManySamples) {
  Plan plan = small_plan();
  plan.shards[0].samples.assign(20000, plan.shards[1].samples[0]);
  EXPECT_EQ(read(to_json(plan)).sample_count(), 20001);
}

TEST(PlanOutline, SeesNoFaultInASampleButEveryOther) {
  std::string text = to_json(small_plan());
  text.replace(text.find("\"gap\":1"), 7, "\"gap\":9");
  EXPECT_EQ(read(text).sample_count(), 3);
  text.replace(text.find("\"width\":4"), 9, "\"width\":0");
  EXPECT_THAT([&] { read(text); },
              ThrowsMessage<std::runtime_error>(HasSubstr("p:9: $.shards[0].width: expected")));
}

TEST(PlanOutline, NoPartOfAPlanHasOne) {
  const std::string text = to_json(small_plan());
  for (std::size_t size = 0; size < text.size(); ++size) {
    EXPECT_THROW(read(text.substr(0, size)), std::runtime_error) << size;
  }
}

}  // namespace
}  // namespace eventgan
