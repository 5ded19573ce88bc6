#include "pipeline/runtime/progress.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <memory>
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

ProgressDisplay::Columns columns(int count) {
  return [count] { return count; };
}

ProgressState state() { return {30, 120, 0, 60'000'000, 15, {}}; }

TEST(ProgressLine, GivesRatesAndTimeLeftOnceItIsKnown) {
  // 30 pairs in 15 s: 2 a second, 90 left: 45 s; 60 MB in 15 s: 4 MB/s.
  EXPECT_EQ(progress_line(state()), "30/120 pairs, 0m45s left, 2.00 pairs/s, 4.0 MB/s");
  ProgressState long_run = state();
  long_run.total = 30 + 2 * 3 * 3600;  // three hours more
  long_run.quarantined = 2;
  EXPECT_EQ(progress_line(long_run),
            "30/21630 pairs, 3h00m left, 2 quarantined, 2.00 pairs/s, 4.0 MB/s");
  EXPECT_EQ(progress_line({0, 10, 0, 0, 0, {}}), "0/10 pairs, ? left, 0.00 pairs/s, 0.0 MB/s");
}

TEST(ProgressLine, CountsWhatItIsToldTo) {
  ProgressState frames = state();
  frames.unit = {"frames", /*has_bytes=*/false, /*phase=*/{}};
  EXPECT_EQ(progress_line(frames), "30/120 frames, 0m45s left, 2.00 frames/s");
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
  Progress progress(out, ProgressStyle::kAuto, {}, 3, clock.get());
  clock.now += seconds(9);
  progress.advance(false, 10);
  EXPECT_EQ(out.str(), "");
  clock.now += seconds(1);
  progress.advance(true, 0);
  EXPECT_THAT(out.str(), ::testing::MatchesRegex("2/3 pairs.*1 quarantined.*\n"));
  progress.advance(false, 10);
  progress.finish();
  EXPECT_THAT(out.str(), ::testing::HasSubstr("3/3 pairs"));
}

TEST(Progress, OnATerminalRedrawsOneLine) {
  HandClock clock;
  std::ostringstream out;
  Progress progress(out, ProgressStyle::kAuto, columns(80), 2, clock.get());
  clock.now += milliseconds(100);
  progress.advance(false, 10);
  progress.advance(false, 10);
  progress.finish();
  EXPECT_THAT(out.str(), ::testing::MatchesRegex("\r.\\[K.\\[.7l\\[#+\\.+\\] 1/2 pairs[^\n]*\r"
                                                 "\r.\\[K.\\[.7l\\[#+\\] 2/2 pairs[^\n]*\r\n"));
}

TEST(FittedLine, KeepsToOneRowWhateverItsWidth) {
  const ProgressText text{30, 120, "30/120 pairs, 0m45s left, 2.00 pairs/s, 4.0 MB/s", ""};
  EXPECT_EQ(fitted_line(text, 200),
            "[" + std::string(7, '#') + std::string(23, '.') + "] " + text.line);
  // 80 - 1 - 48 - 3 = 28 columns for the bar, of which 30/120 is 7.
  EXPECT_EQ(fitted_line(text, 80),
            "[" + std::string(7, '#') + std::string(21, '.') + "] " + text.line);
  // Too narrow for the rates; then for a bar of ten columns, 13 with what is around it; then for
  // the line itself.
  EXPECT_EQ(fitted_line(text, 40), "[###.........] 30/120 pairs, 0m45s left");
  EXPECT_EQ(fitted_line(text, 38), "[##........] 30/120 pairs, 0m45s left");
  EXPECT_EQ(fitted_line(text, 37), "30/120 pairs, 0m45s left");
  EXPECT_EQ(fitted_line(text, 20), "30/120 pairs");
  EXPECT_EQ(fitted_line(text, 7), "30/120");
  EXPECT_EQ(fitted_line(text, 1), "");
  EXPECT_EQ(fitted_line(text, 0), "");
  for (int columns = 1; columns < 200; ++columns) {
    EXPECT_LT(static_cast<int>(fitted_line(text, columns).size()), columns);
  }
}

TEST(ProgressDisplay, IsDrawnAnewWhenTheTerminalIsResized) {
  HandClock clock;
  std::ostringstream out;
  int width = 80;
  const ProgressText text{1, 2, "1/2 pairs, 1m00s left", ""};
  ProgressDisplay display(
      out, ProgressStyle::kAuto, [&] { return width; }, clock.get(), [&](auto) { return text; });
  width = 60;
  display.refresh();
  EXPECT_EQ(out.str(), "");  // nothing is there yet
  display.update([](auto) {}, /*at_once=*/true);
  const std::string drawn = "\r\x1b[K\x1b[?7l" + fitted_line(text, 60) + "\x1b[?7h\r";
  EXPECT_EQ(out.str(), drawn);
  display.refresh();
  EXPECT_EQ(out.str(), drawn);
  width = 20;
  display.refresh();
  // 59 columns were wrapped to three rows of 20 or less: two are below the cursor.
  EXPECT_EQ(out.str(), drawn + "\r\x1b" + "7\x1b[B\x1b[K\x1b[B\x1b[K\x1b" +
                           "8\x1b[K\x1b[?7l1/2 pairs\x1b[?7h\r");
}

TEST(ProgressDisplay, KeepsUpByItselfWhileNothingChanges) {
  std::ostringstream out;
  std::atomic<int> described = 0;
  ProgressDisplay display(out, ProgressStyle::kAuto, columns(80), std::chrono::steady_clock::now,
                          [&](auto) {
                            ++described;
                            described.notify_all();
                            return ProgressText{0, 1, "0/1", ""};
                          });
  display.keep_up();
  described.wait(0);  // for ever, if it does not
  display.finish(/*passing=*/true);
  EXPECT_TRUE(out.str().ends_with(kWipeRow));
}

TEST(Progress, APhaseIsToldOnlyWhileItTakesTime) {
  for (const auto style : {ProgressStyle::kLines, ProgressStyle::kBar}) {
    HandClock clock;
    std::ostringstream out;
    const ShowPhase show = [&](const ProgressUnit& unit, std::int64_t total) {
      return std::make_unique<Progress>(out, style, columns(80), total, clock.get(), unit);
    };
    {
      Phase quick(show, {"shards", /*has_bytes=*/true, "hashing"}, 2);
      quick.advance(1'000'000);
      quick.advance(1'000'000);
    }
    { const Phase nothing_to_do(show, {"shards", true, "hashing"}, 0); }
    EXPECT_EQ(out.str(), "");
    {
      Phase slow(show, {"shards", /*has_bytes=*/true, "hashing"}, 2);
      clock.now += seconds(10);
      slow.advance(1'000'000);  // in 10 s: 0.1 shards/s, 0.1 MB/s
      EXPECT_THAT(out.str(),
                  ::testing::HasSubstr("hashing 1/2 shards, 0m10s left, 0.10 shards/s, 0.1 MB/s"));
      slow.advance(1'000'000);
    }
    if (style == ProgressStyle::kBar) {
      EXPECT_TRUE(out.str().ends_with(kWipeRow));
    } else {
      EXPECT_THAT(out.str(),
                  ::testing::EndsWith("hashing 2/2 shards, 0m00s left, 0.20 shards/s, 0.2 MB/s\n"));
    }
  }
}

TEST(Progress, AnErrorDoesNotWriteIntoTheBarsLine) {
  HandClock clock;
  std::ostringstream out;
  {
    Progress progress(out, ProgressStyle::kBar, columns(80), 2, clock.get());
    clock.now += seconds(1);
    progress.advance(false, 10);
  }
  EXPECT_TRUE(out.str().ends_with("\n"));
}

TEST(Progress, TheTotalMayTurnOutSmaller) {
  HandClock clock;
  std::ostringstream out;
  Progress progress(out, ProgressStyle::kLines, {}, 10, clock.get());
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
  Progress progress(out, ProgressStyle::kNone, columns(80), 1, clock.get());
  clock.now += seconds(100);
  progress.advance(false, 10);
  progress.finish();
  EXPECT_EQ(out.str(), "");
}

}  // namespace
}  // namespace eventgan
