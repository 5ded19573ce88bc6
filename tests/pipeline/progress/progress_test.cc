#include "pipeline/progress/progress.h"

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
  EXPECT_THAT(progress_bar(state(), 8), ::testing::StartsWith("[##......] 30/120"));
  EXPECT_THAT(progress_bar({0, 0, 0, 0, 0, {}}, 4), ::testing::StartsWith("[....]"));
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

TEST(NoteJson, IsOneLine) {
  EXPECT_EQ(note_json("part 1 of 2"), R"({"event":"note","text":"part 1 of 2"})");
}

TEST(WarningJson, IsOneLine) {
  EXPECT_EQ(warning_json("no \"weights\""), R"({"event":"warning","text":"no \"weights\""})");
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
