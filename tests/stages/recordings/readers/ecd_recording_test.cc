#include "stages/recordings/readers/detail/ecd_recording.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <string>

#include "manifests/values/faults.h"
#include "stages/recordings/readers/detail/ecd_event_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(EcdEventLineTest, ParsesNumbersBetweenBlanks) {
  for (const char* line : {"0.003811000 96 133 0", "0.003811\t96  133 0\r", "3.811e-3 96 133 0 "}) {
    const StoredEvent event = parse_ecd_event(line);
    EXPECT_EQ(event.t_s, 0.003811) << line;
    EXPECT_EQ(event.x, 96);
    EXPECT_EQ(event.y, 133);
    EXPECT_EQ(event.polarity, 0);
  }
}

TEST(EcdEventLineTest, RefusesOtherLines) {
  for (const char* line :
       {"", " ", "0.5", "0.5 1 2", "0.5 1 2 1 7", "0.5 1.5 2 1", "0.5,1,2,1", "# t x y p",
        "0.5 1 2 1x", "0.5x 1 2 1", "0.5 99999999999 2 1", "1e999 1 2 1", " 0.5 1 2 1"}) {
    EXPECT_THROWS(parse_ecd_event(line), EventFault,
                  std::string("expected an event \"t x y p\", got \"") + line + "\"");
  }
  // In printable characters, and not all of a long one.
  EXPECT_THROWS(parse_ecd_event("a\x01\xff" + std::string(100, 'b')), EventFault,
                "got \"a??" + std::string(37, 'b') + "\"");
}

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

TEST_F(EcdEventFileTest, CountsLinesInALongFile) {
  // Lines of 10 to 14 bytes, in all more than the mebibyte that is read at once.
  constexpr int kLines = 200'000;
  std::string text;
  std::vector<std::int64_t> begins;
  for (int i = 0; i < kLines; ++i) {
    begins.push_back(std::ssize(text));
    text += std::to_string(i) + " 1 1 1\n";
  }
  begins.push_back(std::ssize(text));
  for (const bool ends_with_line : {true, false}) {
    testing::write_file(path_, ends_with_line ? text : text.substr(0, text.size() - 1));
    begins.back() = std::ssize(text) - (ends_with_line ? 0 : 1);
    const EcdEventFile file(path_);
    for (const int line : {0, 1, 7, 90'000, 150'000, kLines - 1, kLines}) {
      for (const int step : {-170'000, -1, 0, 1, 3, 170'000}) {
        const int there = std::clamp(line + step, 0, kLines);
        EXPECT_EQ(file.skip_lines(begins[line], step), begins[there]) << line << " " << step;
      }
    }
    EXPECT_EQ(file.span(), (std::array{0.0, kLines - 1.0}));
  }
}

TEST_F(EcdEventFileTest, NeedsNoEventsAndNoLastLineEnd) {
  EXPECT_EQ(file_of("").span(), std::nullopt);
  EXPECT_EQ(file_of("").skip_lines(0, -5), 0);
  EXPECT_TRUE(between(file_of(""), 0, 9).empty());
  EXPECT_EQ(between(file_of("1 0 0 1"), 0, 9).size(), 1u);
  EXPECT_TRUE(between(file_of("1 0 0 1"), 1, 9).empty());
  EXPECT_EQ(between(file_of("1 0 0 1\r\n2 0 0 0\r\n"), 0, 9).size(), 2u);
}

TEST_F(EcdEventFileTest, NamesTheLineThatIsWrong) {
  std::string far = many_lines(200'000);
  std::size_t at = 0;
  for (int line = 1; line < 150'000; ++line) at = far.find('\n', at) + 1;
  far[at] = 'x';
  const std::string in_path = "in " + path_.string();
  for (const auto& [text, words] :
       {std::pair<std::string, std::string>{"1 0 0 1\n2 0 0 1\n3 0 z 1\n",
                                            "got \"3 0 z 1\", " + in_path + " (line 3)"},
        {"1 0 0 1\n2 100 0 1\n", "(line 2)"},
        {"1 0 0 1\n\n2 0 0 1\n", "(line 2)"},
        {"1 0 0 1\n# by v2e\n", "(line 2)"},
        {"1 0 0 1\n3 0 0 1\n2 0 0 1\n4 0 0 1\n", "got 2 s after 3 s, " + in_path + " (line 3)"},
        {far, "(line 150000)"}}) {
    EXPECT_THROWS(between(file_of(text), -1, 1e9), InputError, words);
  }
  EXPECT_THROWS(file_of("1 0 0 1\nx 0 0 1\n").span(), InputError, "(line 2)");
}

TEST_F(EcdEventFileTest, RefusesStretchesThatTouchAFallAlone) {
  const EcdEventFile file = file_of("1 0 0 1\n3 0 0 1\n2 0 0 1\n4 0 0 1\n5 0 0 1\n");
  for (const auto& [after_s, until_s] : {std::pair(0.0, 1.5), {3.0, 4.0}, {4.0, 9.0}, {3.0, 9.0}}) {
    EXPECT_NO_THROW(file.require_order(after_s, until_s)) << after_s;
  }
  for (const auto& [after_s, until_s] : {std::pair(0.0, 2.0), {2.5, 2.6}, {2.9, 9.0}, {0.0, 9.0}}) {
    EXPECT_THROWS(file.require_order(after_s, until_s), InputError,
                  "got 2 s after 3 s, in " + path_.string() + " (line 3)");
  }
  EXPECT_EQ(between(file, 3, 9).size(), 2u);
}

// As v2e writes them.
TEST_F(EcdEventFileTest, PassesOverCommentsBeforeTheEvents) {
  const EcdEventFile file = file_of("#!events.txt\n# by v2e\n1 0 0 1\n2 1 0 1\n3 2 0 1\n");
  EXPECT_EQ(file.span(), (std::array{1.0, 3.0}));
  EXPECT_EQ(between(file, 0, 2).size(), 2u);
  EXPECT_EQ(file.skip_lines(file.first_byte_after(2), -9), 22);
  EXPECT_EQ(file_of("# none\n").span(), std::nullopt);
  EXPECT_EQ(file_of("#").span(), std::nullopt);
}

TEST_F(EcdEventFileTest, RefusesFilesThatAreNoText) {
  const char* const no_event = "expected an event \"t x y p\", got \"";
  for (const auto& [bytes, words] : {std::pair(std::string(100'000, '\0'), no_event),
                                     {std::string(3 << 20, 'x'), "expected lines of up to "}}) {
    const EcdEventFile file = file_of(bytes);
    const auto end = static_cast<std::int64_t>(bytes.size());
    EXPECT_THROWS(file.span(), InputError, no_event, path_.string());
    EXPECT_THROWS(file.events(0, end, EventCheck({1, 1}, 0, 9)), InputError, words);
  }
}

class EcdImageListTest : public ::testing::Test {
 protected:
  EcdImageList read(const std::string& text) {
    testing::write_file(path_, text);
    return read_ecd_image_list(path_);
  }
  testing::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "images.txt";
};

TEST_F(EcdImageListTest, ReadsTimesAndPaths) {
  const EcdImageList list = read("0.000000000 images/frame_0.png\r\n0.04 my images/b.png \n\n");
  EXPECT_THAT(list.times_s, ElementsAre(0, 0.04));
  EXPECT_THAT(list.paths, ElementsAre("images/frame_0.png", "my images/b.png"));
  EXPECT_THAT(read("1.5\ta.png").paths, ElementsAre("a.png"));
}

TEST_F(EcdImageListTest, NamesTheLineThatIsWrong) {
  for (const char* line : {"0.5", "a.png", "0.5a.png", "0.5 ", "x a.png", "0.5 /etc/a.png",
                           "0.5 ../a.png", "0.5 images/../../a.png", ""}) {
    EXPECT_THROWS(read(std::string("0 a.png\n") + line + "\n1 c.png\n"), InputError,
                  "images.txt (line 2)");
  }
  EXPECT_THROWS(read("0 a.png\n1 b.png\n1 c.png\n"), InputError, "images.txt (frame 2)");
  EXPECT_THROWS(read("nan a.png\n"), InputError, "finite");
  EXPECT_THROWS(read(""), InputError, "at least one frame");
  EXPECT_THROWS(read_ecd_image_list(folder_ / "absent.txt"), InputError, "absent.txt");
  EXPECT_THROWS(read_ecd_image_list(folder_.path()), InputError, "no readable file");
  ASSERT_EQ(::mkfifo((folder_ / "fifo").c_str(), 0600), 0);
  EXPECT_THROWS(read_ecd_image_list(folder_ / "fifo"), InputError, "Not a regular file");
}

class EcdRecordingTest : public ::testing::Test {
 protected:
  EcdRecordingTest() {
    write("images.txt", "1.0 a.pgm\n1.5 b.pgm\n2.0 c.pgm\n");
    write("a.pgm", "P5 4 3 255\n" + std::string(12, '\x0a'));
    write("b.pgm", "P5 4 3 255\n" + std::string(12, '\x14'));
    write("c.pgm", "P5 4 3 255\n" + std::string(12, '\xff'));
    write("events.txt",
          "0.5 0 0 1\n1.0 1 0 0\n1.25 2 1 1\n1.25 3 2 0\n1.75 0 2 1\n2.0 3 0 1\n2.5 1 1 0\n");
  }
  void write(const std::string& name, const std::string& bytes) {
    testing::write_file(folder_ / name, bytes);
  }
  EcdRecording open() { return EcdRecording(folder_.path()); }

  testing::TemporaryFolder folder_;
};

TEST_F(EcdRecordingTest, ReadsFramesAndTimes) {
  const EcdRecording recording = open();
  EXPECT_EQ(recording.name(), folder_.path().string());
  EXPECT_EQ(recording.size(), (ImageSize{3, 4}));
  EXPECT_EQ(recording.frame_count(), 3);
  EXPECT_EQ(recording.frame_time_s(1), 1.5);
  EXPECT_EQ(recording.frame(0).size, (ImageSize{3, 4}));
  EXPECT_THAT(recording.frame(0).pixels, Each(10));
  EXPECT_THAT(recording.frame(2).pixels, Each(255));
  EXPECT_FALSE(recording.flow(0).has_value());
}

TEST_F(EcdRecordingTest, ReadsEventsBetweenFramesOfAnyTimesAndSoManyAroundOne) {
  const EcdRecording recording = open();
  EXPECT_EQ(recording.events_between(0, 1),
            (std::vector<Event>{{2, 1, 1.25, true}, {3, 2, 1.25, false}}));
  EXPECT_EQ(recording.events_between(1, 2),
            (std::vector<Event>{{0, 2, 1.75, true}, {3, 0, 2.0, true}}));
  EXPECT_EQ(recording.events_between(0, 2).size(), 4u);
  EXPECT_THAT(recording.events_between(1, 1), IsEmpty());
  const std::vector<Event> all = recording.events_in(-1, 9);
  ASSERT_GE(all.size(), 4u);
  EXPECT_EQ(recording.event_span(), (std::array{all.front().t_s, all.back().t_s}));
  EXPECT_EQ(recording.events_around(all[1].t_s, 2, 1),
            (std::vector<Event>{all[0], all[1], all[2]}));
  EXPECT_EQ(recording.events_around(9, 1000, 1000), all);
  EXPECT_EQ(recording.events_in(all[0].t_s, all[1].t_s), (std::vector<Event>{all[1]}));
}

TEST_F(EcdRecordingTest, GivesFewerEventsWhereThereAreNone) {
  write("events.txt", "1.6 0 0 1\n");
  EXPECT_THAT(open().events_between(0, 1), IsEmpty());
  EXPECT_EQ(open().events_between(0, 2).size(), 1u);
  write("events.txt", "");
  EXPECT_THAT(open().events_between(0, 2), IsEmpty());
}

TEST_F(EcdRecordingTest, RefusesFramesThatAreNotThere) {
  const EcdRecording recording = open();
  EXPECT_THROWS(recording.frame(3), std::out_of_range, "expected a frame 0..2, got 3");
  EXPECT_THROWS(recording.frame_time_s(-1), std::out_of_range, "expected a frame 0..2, got -1");
  EXPECT_THROWS(recording.events_between(1, 0), std::out_of_range, "got 1 and 0, in");
  EXPECT_THROWS(recording.flow(2), std::out_of_range, "expected a frame 0..1, got 2");
}

TEST_F(EcdRecordingTest, MakesColourGreyAndSaysSo) {
  EXPECT_THAT(open().notes(), IsEmpty());
  // ITU-R BT.601: 0.299 x 200 + 0.587 x 100 + 0.114 x 50 = 124.2.
  std::string colour = "P6 4 3 255\n";
  for (int pixel = 0; pixel < 12; ++pixel) colour += "\xc8\x64\x32";
  write("b.pgm", colour);
  const EcdRecording late = open();
  EXPECT_THAT(late.notes(), IsEmpty());
  EXPECT_THAT(late.frame(1).pixels, Each(124));
  EXPECT_THAT(late.notes(),
              ElementsAre("frames in colour are made grey, in " + (folder_ / "b.pgm").string()));
  write("a.pgm", colour);
  EXPECT_THAT(open().notes(), ElementsAre(HasSubstr("a.pgm")));
}

TEST_F(EcdRecordingTest, RefusesOtherSizesAndDamage) {
  write("c.pgm", "P5 3 4 255\n" + std::string(12, '\x0a'));
  const EcdRecording recording = open();
  EXPECT_THROWS(recording.frame(2), InputError, "one size, 4x3, got 3x4");
  write("c.pgm", "no image");
  EXPECT_THROWS(recording.frame(2), InputError, "c.pgm");
}

TEST_F(EcdRecordingTest, OpensOnlyWholeFolders) {
  EXPECT_THROWS(EcdRecording recording(folder_ / "absent"), InputError,
                "expected a folder with images.txt");
  std::filesystem::remove(folder_ / "c.pgm");
  EXPECT_THROWS(open(), InputError, (folder_ / "c.pgm").string() + " (frame 2)");
  write("images.txt", "1.0 a.pgm\n");
  EXPECT_EQ(open().frame_count(), 1);
  EXPECT_THAT(open().events_between(0, 0), IsEmpty());
  std::filesystem::remove(folder_ / "events.txt");
  EXPECT_THROWS(open(), InputError, "events.txt");
  write("a.pgm", "no image");
  write("events.txt", "");
  EXPECT_THROWS(open(), InputError, "a.pgm");
}

}  // namespace
}  // namespace eventgan
