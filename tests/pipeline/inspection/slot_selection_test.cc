#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "pipeline/folder/preview_shard.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;

TEST(ParseSlots, TakesNumbersAndRanges) {
  EXPECT_THAT(parse_slots("0,3-5", 8), ElementsAre(0, 3, 4, 5));
  EXPECT_THAT(parse_slots("5,1,4-5,1", 8), ElementsAre(1, 4, 5));
  EXPECT_THAT(parse_slots("7", 8), ElementsAre(7));
}

TEST(ParseSlots, RefusesWhatIsNoSlot) {
  for (const char* text :
       {"", ",", "1,", "8", "-1", "5-3", "1-", "a", "1 2", "0x1", "99999999999"}) {
    EXPECT_THROW(parse_slots(text, 8), UsageError) << text;
  }
  EXPECT_THROW(parse_slots("0", 0), UsageError);
}

TEST(SpreadSlots, SpreadsEvenlyFromTheFirst) {
  EXPECT_THAT(spread_slots(3, 9), ElementsAre(0, 3, 6));
  EXPECT_THAT(spread_slots(8, 3), ElementsAre(0, 1, 2));
  EXPECT_THAT(spread_slots(8, 0), ElementsAre());
}

}  // namespace
}  // namespace eventgan
