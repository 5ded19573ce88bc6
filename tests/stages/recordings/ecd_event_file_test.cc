#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <string>

#include "manifests/faults.h"
#include "stages/recordings/ecd_event_file_internal.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class EcdEventFileTest : public ::testing::Test {
 protected:
  EcdEventFile file_of(const std::string& text) {
    testing::write_file(path_, text);
    return EcdEventFile(path_);
  }
  /// The events in (after_s, until_s].
  static std::vector<Event> between(const EcdEventFile& file, double after_s, double until_s) {
    return file.events(file.first_byte_after(after_s), file.first_byte_after(until_s),
                       EventCheck({100, 100}, after_s, until_s));
  }
  testing::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "events.txt";
};

// Event i at i milliseconds, two of each time; lines of 13 to 18 bytes.
std::string many_lines(int count) {
  std::string text;
  char line[64];
  for (int i = 0; i < count; ++i) {
    std::snprintf(line, sizeof line, "%.3f %d %d %d\n", 0.001 * (i / 2), i % 100, i / 7 % 100,
                  i % 3 == 0);
    text += line;
  }
  return text;
}

TEST_F(EcdEventFileTest, FindsWhereATimeEnds) {
  const EcdEventFile file = file_of("1 0 0 1\n2 0 0 1\n2 1 0 1\n3 0 0 1\n");
  EXPECT_EQ(file.first_byte_after(0), 0);
  EXPECT_EQ(file.first_byte_after(1), 8);
  EXPECT_EQ(file.first_byte_after(2), 24);
  EXPECT_EQ(file.first_byte_after(2.5), 24);
  EXPECT_EQ(file.first_byte_after(3), 32);
}

TEST_F(EcdEventFileTest, ReadsAnyStretchOfALongFile) {
  constexpr int kCount = 200'000;  // 3 MB: several reads for all of it
  const EcdEventFile file = file_of(many_lines(kCount));
  for (const int first : {0, 1, 7, 5'000, 49'999, 99'990}) {
    const std::vector<Event> events =
        between(file, 0.001 * first + 1e-9, 0.001 * (first + 9) + 1e-9);
    ASSERT_EQ(events.size(), 18u) << first;
    const int i = 2 * (first + 1);  // the first event after the time
    EXPECT_NEAR(events[0].t_s, 0.001 * (first + 1), 1e-9);
    EXPECT_EQ(events[0].x, i % 100);
    EXPECT_EQ(events[0].y, i / 7 % 100);
    EXPECT_EQ(events[0].positive, i % 3 == 0);
  }
  const std::vector<Event> all = between(file, -1, 1e9);
  ASSERT_EQ(all.size(), static_cast<std::size_t>(kCount));
  for (int i = 0; i < kCount; ++i) ASSERT_EQ(all[static_cast<std::size_t>(i)].x, i % 100) << i;
}

TEST_F(EcdEventFileTest, NeedsNoEventsAndNoLastLineEnd) {
  EXPECT_TRUE(between(file_of(""), 0, 9).empty());
  EXPECT_EQ(between(file_of("1 0 0 1"), 0, 9).size(), 1u);
  EXPECT_TRUE(between(file_of("1 0 0 1"), 1, 9).empty());
  EXPECT_EQ(between(file_of("1 0 0 1\r\n2 0 0 0\r\n"), 0, 9).size(), 2u);
}

TEST_F(EcdEventFileTest, NamesTheLineThatIsWrong) {
  EXPECT_THAT(
      [&] { between(file_of("1 0 0 1\n2 0 0 1\n3 0 z 1\n"), 0, 9); },
      ThrowsMessage<InputError>(HasSubstr("got \"3 0 z 1\", in " + path_.string() + " (line 3)")));
  EXPECT_THAT([&] { between(file_of("1 0 0 1\n2 100 0 1\n"), 0, 9); },
              ThrowsMessage<InputError>(HasSubstr("(line 2)")));
  EXPECT_THAT([&] { between(file_of("1 0 0 1\n\n2 0 0 1\n"), 0, 9); },
              ThrowsMessage<InputError>(HasSubstr("(line 2)")));
}

TEST_F(EcdEventFileTest, NamesTheLineFarInALongFile) {
  std::string text = many_lines(200'000);
  std::size_t at = 0;
  for (int line = 1; line < 150'000; ++line) at = text.find('\n', at) + 1;
  text[at] = 'x';
  EXPECT_THAT([&] { between(file_of(text), -1, 1e9); },
              ThrowsMessage<InputError>(HasSubstr("(line 150000)")));
}

TEST_F(EcdEventFileTest, RefusesTimesThatFall) {
  EXPECT_THAT([&] { between(file_of("1 0 0 1\n3 0 0 1\n2 0 0 1\n4 0 0 1\n"), 0, 9); },
              ThrowsMessage<InputError>(
                  HasSubstr("got 2 s after 3 s, in " + path_.string() + " (line 3)")));
}

TEST_F(EcdEventFileTest, RefusesAStretchThatEndsBeforeItBegins) {
  const EcdEventFile file = file_of("1 0 0 1\n2 0 0 1\n");
  EXPECT_THAT(
      [&] {
        file.events(8, 0, EventCheck({1, 1}, 0, 9));
      },
      ThrowsMessage<InputError>(HasSubstr("times that never fall")));
}

TEST_F(EcdEventFileTest, RefusesFilesThatAreNoText) {
  for (const std::string& bytes : {std::string(100'000, '\0'), std::string(3 << 20, 'x')}) {
    const EcdEventFile file = file_of(bytes);
    EXPECT_THROW(file.first_byte_after(1), InputError);
    EXPECT_THROW(file.events(0, static_cast<std::int64_t>(bytes.size()), EventCheck({1, 1}, 0, 9)),
                 InputError);
  }
}

}  // namespace
}  // namespace eventgan
