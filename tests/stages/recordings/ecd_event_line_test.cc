#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "stages/recordings/ecd_event_line_internal.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(EcdEventLineTest, ParsesNumbersBetweenBlanks) {
  for (const char* line : {"0.003811000 96 133 0", "0.003811\t96  133 0\r", "3.811e-3 96 133 0 "}) {
    const StoredEvent event = parse_ecd_event(line);
    EXPECT_EQ(event.t_s, 0.003811) << line;
    EXPECT_EQ(event.x, 96);
    EXPECT_EQ(event.y, 133);
    EXPECT_EQ(event.polarity, 0);
    EXPECT_EQ(parse_ecd_event_time(line), 0.003811);
  }
}

TEST(EcdEventLineTest, RefusesOtherLines) {
  for (const char* line :
       {"", " ", "0.5", "0.5 1 2", "0.5 1 2 1 7", "0.5 1.5 2 1", "0.5,1,2,1", "# t x y p",
        "0.5 1 2 1x", "0.5x 1 2 1", "0.5 99999999999 2 1", "1e999 1 2 1", " 0.5 1 2 1"}) {
    EXPECT_THROW(parse_ecd_event(line), EventFault) << line;
  }
  EXPECT_THROW(parse_ecd_event_time("time"), EventFault);
  EXPECT_THROW(parse_ecd_event_time(""), EventFault);
  EXPECT_THROW(parse_ecd_event_time("nan 1 2 1"), EventFault);
}

TEST(EcdEventLineTest, QuotesTheLineInPrintableCharacters) {
  EXPECT_THAT([] { parse_ecd_event("a\x01\xff" + std::string(100, 'b')); },
              ThrowsMessage<EventFault>(HasSubstr("got \"a??" + std::string(37, 'b') + "\"")));
}

}  // namespace
}  // namespace eventgan
