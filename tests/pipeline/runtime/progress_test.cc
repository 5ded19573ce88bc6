#include "pipeline/runtime/progress.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

namespace eventgan {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

/// A clock that a test moves by hand.
struct HandClock {
  std::chrono::steady_clock::time_point now;
  Progress::Clock get() {
    return [this] { return now; };
  }
};

ProgressState state() { return {30, 120, 0, 60'000'000, 15, {}}; }

TEST(ProgressLine, GivesRatesAndTimeLeft) {
  // 30 pairs in 15 s: 2 a second, 90 left: 45 s; 60 MB in 15 s: 4 MB/s.
  EXPECT_EQ(progress_line(state()), "30/120 pairs, 2.00 pairs/s, 4.0 MB/s, 0m45s left");
  ProgressState long_run = state();
  long_run.total = 30 + 2 * 3 * 3600;  // three hours more
  long_run.quarantined = 2;
  EXPECT_EQ(progress_line(long_run),
            "30/21630 pairs, 2.00 pairs/s, 4.0 MB/s, 3h00m left, 2 quarantined");
}

TEST(ProgressLine, AtTheStartTimeLeftIsUnknown) {
  EXPECT_EQ(progress_line({0, 10, 0, 0, 0, {}}), "0/10 pairs, 0.00 pairs/s, 0.0 MB/s, ? left");
}

TEST(ProgressLine, CountsWhatItIsToldTo) {
  ProgressState frames = state();
  frames.unit = {"frames", /*has_bytes=*/false};
  EXPECT_EQ(progress_line(frames), "30/120 frames, 2.00 frames/s, 0m45s left");
  const std::string json = progress_json(frames);
  EXPECT_THAT(json, ::testing::HasSubstr("\"frames_per_s\":2.0"));
  EXPECT_THAT(json, ::testing::Not(::testing::HasSubstr("mb_per_s")));
}

TEST(ProgressBar, FillsInProportion) {
  EXPECT_EQ(progress_bar(30, 120, 8), "[##......]");
  EXPECT_EQ(progress_bar(0, 0, 4), "[....]");
  EXPECT_EQ(progress_bar(7, 7, 4), "[####]");
}

TEST(ProgressJson, IsOneLineThatMachinesRead) {
  EXPECT_THAT(progress_json(state()), ::testing::AllOf(::testing::HasSubstr("\"done\":30"),
                                                       ::testing::HasSubstr("\"pairs_per_s\":2.0"),
                                                       ::testing::Not(::testing::HasSubstr("\n"))));
}

TEST(Progress, OffATerminalGivesAPlainLineEveryTenSeconds) {
  HandClock clock;
  std::ostringstream out;
  Progress progress(out, ProgressStyle::kAuto, false, 3, clock.get());
  clock.now += seconds(9);
  progress.advance(false, 10);
  EXPECT_EQ(out.str(), "");
  clock.now += seconds(1);
  progress.advance(true, 0);
  EXPECT_THAT(out.str(), ::testing::MatchesRegex("2/3 pairs.*1 quarantined\n"));
  progress.advance(false, 10);
  progress.finish();
  EXPECT_THAT(out.str(), ::testing::HasSubstr("3/3 pairs"));
}

TEST(Progress, OnATerminalRedrawsOneLine) {
  HandClock clock;
  std::ostringstream out;
  Progress progress(out, ProgressStyle::kAuto, true, 2, clock.get());
  clock.now += milliseconds(100);
  progress.advance(false, 10);
  progress.advance(false, 10);
  progress.finish();
  EXPECT_THAT(out.str(), ::testing::MatchesRegex("\r\\[.*1/2 pairs.*\r\\[.*2/2 pairs.* \n"));
}

TEST(ProgressDisplay, AShorterLineWipesALongerOne) {
  std::ostringstream out;
  HandClock clock;
  ProgressDisplay display(out, ProgressStyle::kBar, true, 2, clock.get());
  display.show(clock.now, 0, 2, "a long line", "");
  display.show(clock.now, 2, 2, "done", "");
  EXPECT_EQ(out.str(), "\r[..] a long line   \r[##] done       ");
  display.end_line();
  display.end_line();
  EXPECT_TRUE(out.str().ends_with("done       \n"));
}

TEST(Progress, AnErrorDoesNotWriteIntoTheBarsLine) {
  HandClock clock;
  std::ostringstream out;
  {
    Progress progress(out, ProgressStyle::kBar, true, 2, clock.get());
    clock.now += seconds(1);
    progress.advance(false, 10);
  }
  EXPECT_TRUE(out.str().ends_with("\n"));
}

TEST(Progress, TheTotalMayTurnOutSmaller) {
  HandClock clock;
  std::ostringstream out;
  Progress progress(out, ProgressStyle::kLines, false, 10, clock.get());
  progress.advance(false, 10);
  progress.set_total(1);
  progress.finish();
  EXPECT_THAT(out.str(), ::testing::StartsWith("1/1 pairs"));
}

TEST(MessageJson, IsOneLine) {
  EXPECT_EQ(message_json("note", "part 1 of 2"), R"({"event":"note","text":"part 1 of 2"})");
  EXPECT_EQ(message_json("warning", "no \"weights\""),
            R"({"event":"warning","text":"no \"weights\""})");
  EXPECT_EQ(message_json("error", "a\nb \xff"),
            "{\"event\":\"error\",\"text\":\"a\\nb \xef\xbf\xbd\"}");
}

TEST(DurationText, BeginsWithTheLargestUnitThatMay) {
  EXPECT_EQ(duration_text(45, "dhms"), "45s");
  EXPECT_EQ(duration_text(45, "hm"), "0m45s");
  EXPECT_EQ(duration_text(45, "h", 3), "0h00m45s");
  EXPECT_EQ(duration_text(59.5, "dhms"), "1m00s");  // rounded first
  EXPECT_EQ(duration_text(3 * 3600 + 59, "hm"), "3h00m");
  EXPECT_EQ(duration_text(50 * 3600, "hm"), "50h00m");
  EXPECT_EQ(duration_text(50 * 3600, "dhms"), "2d02h");
  EXPECT_EQ(duration_text(50 * 3600 + 61, "h", 3), "50h01m01s");
}

TEST(Progress, NoneIsSilent) {
  HandClock clock;
  std::ostringstream out;
  Progress progress(out, ProgressStyle::kNone, true, 1, clock.get());
  clock.now += seconds(100);
  progress.advance(false, 10);
  progress.finish();
  EXPECT_EQ(out.str(), "");
}

}  // namespace
}  // namespace eventgan
