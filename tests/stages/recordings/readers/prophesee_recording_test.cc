#include "stages/recordings/readers/detail/prophesee_recording.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <string>

#include "manifests/values/faults.h"
#include "stages/base/archives/zip_archive.h"
#include "stages/recordings/readers/recording.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const std::string kDatHeader = std::string(
    "% Data file containing CD events\n% Version 2\n% Width 8\n% Height 6\n\x0c\x08", 68);
const std::string kEvt2Header = "% evt 2.0\n% geometry 8x6\n% end\n";
const std::string kEvt3Header = "% evt 3.0\n% format EVT3;height=6;width=40\n% end\n";

template <class Word>
std::string words(const std::vector<Word>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(Word)};
}

std::uint64_t dat(std::uint32_t time_us, std::uint64_t x, std::uint64_t y, std::uint64_t on) {
  return time_us | (x | y << 14 | on << 28) << 32;
}
std::uint32_t evt2(std::uint32_t low, std::uint32_t x, std::uint32_t y, std::uint32_t on) {
  return on << 28 | low << 22 | x << 11 | y;
}
std::uint32_t evt2_high(std::uint32_t high) { return 8u << 28 | high; }
std::uint16_t evt3(int type, int value, bool on = false) {
  return static_cast<std::uint16_t>(type << 12 | int{on} << 11 | value);
}
constexpr int kY = 0, kX = 2, kBase = 3, kVector12 = 4, kVector8 = 5, kLow = 6, kHigh = 8;

class PropheseeTest : public ::testing::Test {
 protected:
  std::unique_ptr<Recording> open(const std::string& bytes,
                                  std::optional<ImageSize> sensor = std::nullopt) {
    testing::write_file(path_, bytes);
    options_.sensor = sensor;
    return open_recording(path_, RecordingFormat::kProphesee, options_);
  }

  std::vector<Event> events_of(const std::string& bytes) { return open(bytes)->events_in(-1, 1e6); }

  void expect_refused(const std::string& bytes, const std::string& reason) {
    EXPECT_THROWS(events_of(bytes), InputError, reason, path_.string());
  }

  testing::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "recording";
  RecordingOptions options_{.time_shift = false};  // times are the camera's
};

TEST_F(PropheseeTest, ReadsDat) {
  const auto recording =
      open(kDatHeader + words<std::uint64_t>({dat(0, 7, 5, 1), dat(3, 0, 0, 0)}));
  EXPECT_EQ(recording->size(), (ImageSize{6, 8}));
  EXPECT_EQ(recording->frame_count(), 0);
  EXPECT_THAT(recording->events_in(-1, 1),
              ElementsAre(Event{7, 5, 0, true}, Event{0, 0, 3e-6, false}));
  EXPECT_THAT(recording->events_in(0, 1), ElementsAre(Event{0, 0, 3e-6, false}));
  EXPECT_THAT(events_of(kDatHeader), IsEmpty());
}

// 2^32 µs are 4294.967296 s.
TEST_F(PropheseeTest, GoesOnWhereDatWraps) {
  EXPECT_THAT(
      events_of(kDatHeader + words<std::uint64_t>({dat(0xffffffff, 1, 1, 1), dat(0, 1, 1, 1)})),
      ElementsAre(Event{1, 1, 4294.967295, true}, Event{1, 1, 4294.967296, true}));
  expect_refused(kDatHeader + words<std::uint64_t>({dat(2010, 1, 1, 1), dat(10, 1, 1, 1)}),
                 "in " + path_.string() + " (event 1)");
}

TEST_F(PropheseeTest, ReadsEvt2) {
  const auto recording = open(
      kEvt2Header + words<std::uint32_t>({evt2_high(3), evt2(5, 7, 5, 1), 0xa0000000, 0xe0000000,
                                          0xf0000000, evt2_high(4), evt2(0, 2, 3, 0)}));
  // 3 * 64 + 5 = 197 and 4 * 64 = 256 µs.
  EXPECT_THAT(recording->events_in(0, 1),
              ElementsAre(Event{7, 5, 197e-6, true}, Event{2, 3, 256e-6, false}));
  EXPECT_THAT(recording->notes(), IsEmpty());
}

// 2^34 µs are 17179.869184 s.
TEST_F(PropheseeTest, GoesOnWhereEvt2Wraps) {
  EXPECT_THAT(events_of(kEvt2Header + words<std::uint32_t>({evt2_high(0xfffffff), evt2(63, 1, 1, 1),
                                                            evt2_high(0), evt2(1, 1, 1, 1)})),
              ElementsAre(Event{1, 1, 17179.869183, true}, Event{1, 1, 17179.869185, true}));
  // A step back: the windows that touch it are refused, the others are not.
  const auto stepped =
      open(kEvt2Header +
           words<std::uint32_t>({evt2_high(8), evt2(0, 1, 1, 1), evt2_high(49), evt2(3, 1, 1, 1),
                                 evt2_high(9), evt2(3, 1, 1, 1), evt2_high(60), evt2(0, 2, 1, 1)}));
  EXPECT_THROWS(stepped->events_in(0, 1), InputError, "expected times that never decrease");
  EXPECT_EQ(stepped->events_in(0, 577e-6).size(), 1u);
  EXPECT_EQ(stepped->events_in(3139e-6, 1).size(), 1u);
  EXPECT_THAT(stepped->notes(), ElementsAre(HasSubstr("before an earlier one, and their windows at "
                                                      "fault: 1, in ")));
}

// As Metavision's readers do: EVT 3.0 begins at the upper part before the first.
TEST_F(PropheseeTest, CountsTimesFromTheRecordingsStart) {
  options_.time_shift = true;
  const auto evt3_file = open(
      kEvt3Header + words<std::uint16_t>({evt3(kHigh, 489), evt3(kLow, 7), evt3(kY, 1), evt3(kX, 3),
                                          evt3(kHigh, 490), evt3(kX, 4), evt3(kHigh, 3)}));
  EXPECT_THAT(evt3_file->events_in(0, 1),
              ElementsAre(Event{3, 1, 4103e-6, false}, Event{4, 1, 8192e-6, false}));
  EXPECT_THAT(evt3_file->notes(), ElementsAre(HasSubstr("1.998848 s are taken off")));
  const auto evt2_file =
      open(kEvt2Header + words<std::uint32_t>({evt2_high(31250), evt2(5, 7, 5, 1), evt2_high(31251),
                                               evt2(0, 2, 3, 0)}));
  EXPECT_THAT(evt2_file->events_in(0, 1),
              ElementsAre(Event{7, 5, 5e-6, true}, Event{2, 3, 64e-6, false}));
  EXPECT_THAT(evt2_file->notes(), ElementsAre(HasSubstr("2.000000 s are taken off")));
  // DAT is made by these readers.
  const auto dat_file = open(kDatHeader + words<std::uint64_t>({dat(5000, 7, 5, 1)}));
  EXPECT_THAT(dat_file->events_in(0, 1), ElementsAre(Event{7, 5, 5e-3, true}));
  EXPECT_THAT(dat_file->notes(), IsEmpty());
  // A clock that begins with the recording.
  EXPECT_THAT(open(kEvt3Header + words<std::uint16_t>({evt3(kHigh, 0), evt3(kHigh, 1)}))->notes(),
              IsEmpty());
}

// A word of 64 bits: type, 6 bits of time, x, y, then a bit for each of 32 pixels from x on.
TEST_F(PropheseeTest, ReadsEvt21) {
  const auto word = [](std::uint64_t type, std::uint64_t upper, std::uint64_t valid) {
    return (type << 28 | upper) << 32 | valid;
  };
  const auto cd = [&](std::uint64_t on, std::uint64_t low, std::uint64_t x, std::uint64_t y,
                      std::uint64_t valid) { return word(on, low << 22 | x << 11 | y, valid); };
  std::vector<std::uint64_t> stored = {
      cd(1, 1, 0, 0, 3), word(8, 10, 0),     cd(1, 5, 4, 2, 0x80000005),
      word(0xa, 0, 0),   word(0xe, 0, 0),    word(0x9, 0, 0),
      word(8, 11, 0),    cd(0, 63, 39, 5, 3)};
  const std::string header = "% evt 2.1\n% format EVT21;height=6;width=40";
  const auto expect_read = [&](const std::string& bytes) {
    const auto recording = open(bytes);
    EXPECT_EQ(recording->size(), (ImageSize{6, 40}));
    EXPECT_THAT(recording->events_in(0, 1),
                ElementsAre(Event{4, 2, 645e-6, true}, Event{6, 2, 645e-6, true},
                            Event{35, 2, 645e-6, true}, Event{39, 5, 767e-6, false}));
    EXPECT_THAT(recording->notes(), ElementsAre(HasSubstr("left out: 2, in "),
                                                HasSubstr("reserved types are passed over: 1")));
    EXPECT_THAT(recording->warnings(), ElementsAre(HasSubstr("left out: 1, in ")));
  };
  expect_read(header + ";endianness=little\n% end\n" + words(stored));
  for (std::uint64_t& value : stored) value = value << 32 | value >> 32;
  expect_read(header + ";endianness=legacy\n% end\n" + words(stored));
}

// As OpenEB knows it by the header; where that is wrong the words tell.
TEST_F(PropheseeTest, KnowsExchangedHalvesOfEvt21) {
  const std::string made = "% integrator_name Prophesee\n";
  const std::string by_two = "% camera_integrator_name Prophesee\n% plugin_integrator_name ";
  const std::string evk4 = "% system_ID 49\n";
  struct Case {
    std::string lines;
    bool is_exchanged;
    std::string warning = {};
  };
  for (const Case& each : {Case{evk4, true},
                           {evk4 + made, true},
                           {"% system_ID 54\n" + by_two + "Prophesee\n", true},
                           {"% system_ID 55\n" + by_two + "Prophesee\n", false},
                           {evk4 + by_two + "Another\n", false},
                           {evk4 + "% integrator_name Another\n", false},
                           {evk4 + "% endianness little\n", false},
                           {made, false},
                           {evk4, false, R"("endianness=little")"},
                           {made, true, R"("endianness=legacy")"},
                           {"% endianness little\n", true, R"("endianness=legacy")"}}) {
    SCOPED_TRACE(each.lines);
    std::vector<std::uint64_t> stored;
    for (std::uint64_t i = 0; i < 20; ++i) {  // of the upper part i: pixels 4 and 6 of row 2
      stored.push_back((std::uint64_t{8} << 28 | i) << 32);
      stored.push_back((std::uint64_t{1} << 28 | 4 << 11 | 2) << 32 | 5);
    }
    for (std::uint64_t& word : stored) {
      if (each.is_exchanged) word = word << 32 | word >> 32;
    }
    const auto recording =
        open("% evt 2.1\n% geometry 40x6\n" + each.lines + "% end\n" + words(stored));
    const std::vector<Event> events = recording->events_in(-1, 1);
    ASSERT_EQ(events.size(), 40u);
    EXPECT_EQ(events[39], (Event{6, 2, 1216e-6, true}));
    EXPECT_THAT(recording->notes(), IsEmpty());
    if (each.warning.empty()) {
      EXPECT_THAT(recording->warnings(), IsEmpty());
    } else {
      EXPECT_THAT(recording->warnings(), ElementsAre(HasSubstr(each.warning)));
    }
  }
}

TEST_F(PropheseeTest, LiftsTimesThatStepBackALittle) {
  const auto recording =
      open(kDatHeader + words<std::uint64_t>({dat(30, 1, 1, 1), dat(0, 2, 1, 1), dat(4000, 3, 1, 1),
                                              dat(2001, 4, 1, 1), dat(4001, 5, 1, 1)}));
  EXPECT_THAT(
      recording->events_in(0, 1),
      ElementsAre(Event{1, 1, 30e-6, true}, Event{2, 1, 30e-6, true}, Event{3, 1, 4000e-6, true},
                  Event{4, 1, 4000e-6, true}, Event{5, 1, 4001e-6, true}));
  EXPECT_THAT(recording->notes(),
              ElementsAre(HasSubstr("2 are lifted to the latest before, in " + path_.string())));
}

TEST_F(PropheseeTest, CountsEventsBeforeTheFirstTime) {
  const auto evt2_file =
      open(kEvt2Header + words<std::uint32_t>({evt2(5, 7, 5, 1), evt2_high(3), evt2(5, 7, 5, 1)}));
  EXPECT_EQ(evt2_file->events_in(0, 1).size(), 1u);
  EXPECT_THAT(evt2_file->notes(), ElementsAre(HasSubstr("left out: 1, in ")));
  // One without a time, one without a row, three of a vector without a first pixel.
  const auto evt3_file =
      open(kEvt3Header + words<std::uint16_t>({evt3(kX, 1), evt3(kHigh, 1), evt3(kX, 1),
                                               evt3(kVector12, 7), evt3(kY, 2), evt3(kX, 1)}));
  EXPECT_THAT(evt3_file->events_in(0, 1), ElementsAre(Event{1, 2, 4096e-6, false}));
  EXPECT_THAT(evt3_file->notes(), ElementsAre(HasSubstr("left out: 5, in ")));
}

TEST_F(PropheseeTest, ReadsEvt3) {
  const auto recording = open(
      kEvt3Header + words<std::uint16_t>(
                        {evt3(kHigh, 1), evt3(kLow, 10), evt3(kY, 5), evt3(kX, 39, true),
                         // Bits 0, 11; then 8 further, bit 7; then a single one.
                         evt3(kBase, 3, true), evt3(kVector12, 0x801), evt3(kVector8, 0xf80),
                         evt3(kX, 1), evt3(kVector8, 1),
                         // Of a trigger; then said again, and a new time.
                         evt3(kLow, 20), evt3(0xa, 1), evt3(kHigh, 1), evt3(kLow, 12), evt3(0xe, 1),
                         evt3(0xf, 1), evt3(7, 1), evt3(kX, 2), evt3(kHigh, 2), evt3(kX, 3)}));
  EXPECT_EQ(recording->size(), (ImageSize{6, 40}));
  EXPECT_THAT(recording->events_in(0, 1),
              ElementsAre(Event{39, 5, 4106e-6, true}, Event{3, 5, 4106e-6, true},
                          Event{14, 5, 4106e-6, true}, Event{22, 5, 4106e-6, true},
                          Event{1, 5, 4106e-6, false}, Event{23, 5, 4106e-6, true},
                          Event{2, 5, 4108e-6, false}, Event{3, 5, 8192e-6, false}));
}

// 2^24 µs are 16.777216 s.
TEST_F(PropheseeTest, GoesOnWhereEvt3Wraps) {
  EXPECT_THAT(
      events_of(kEvt3Header +
                words<std::uint16_t>({evt3(kHigh, 4095), evt3(kLow, 4095), evt3(kY, 0), evt3(kX, 1),
                                      evt3(kHigh, 0), evt3(kX, 1), evt3(kHigh, 3000),
                                      evt3(kHigh, 4000), evt3(kHigh, 1), evt3(kX, 1)})),
      ElementsAre(Event{1, 0, 16.777215, false}, Event{1, 0, 16.777216, false},
                  Event{1, 0, 33.558528, false}));
  // A fall of half the range is a wrap, as where words were lost; a smaller one a step back.
  for (const int fallen : {1792, 1793}) {
    const auto fell =
        open(kEvt3Header + words<std::uint16_t>({evt3(kHigh, 3840), evt3(kY, 0), evt3(kX, 1),
                                                 evt3(kHigh, fallen), evt3(kX, 2)}));
    const double fallen_s = 4096e-6 * (fallen + 4096);
    if (fallen == 1792) {
      EXPECT_THAT(fell->events_in(16, 99), ElementsAre(Event{2, 0, fallen_s, false}));
    } else {
      EXPECT_THROWS(fell->events_in(0, 16), InputError, "expected times that never decrease");
    }
  }
  expect_refused(kEvt3Header + words<std::uint16_t>({evt3(kHigh, 1), evt3(kLow, 3009), evt3(kY, 0),
                                                     evt3(kX, 1), evt3(kLow, 9), evt3(kX, 1)}),
                 "expected times that never decrease");
}

// As a wrap it would move all that follows away from the labels: windows of nothing.
TEST_F(PropheseeTest, OneDamagedTimeIsNoWrapAndIsSaid) {
  const auto expect_last_at = [&](const std::string& bytes, double last_s) {
    const auto recording = open(bytes);
    EXPECT_THROWS(recording->events_in(last_s - 1e-6, last_s), InputError,
                  "expected times that never decrease, got ");
    EXPECT_THAT(recording->notes(), ElementsAre(HasSubstr("before an earlier one")));
  };
  for (const std::uint32_t damaged : {0xff000005u, 0x80000005u}) {
    expect_last_at(kDatHeader + words<std::uint64_t>({dat(5, 1, 1, 1), dat(damaged, 1, 1, 1),
                                                      dat(6, 1, 1, 1), dat(2000, 1, 1, 1)}),
                   0.002);
    expect_last_at(kDatHeader + words<std::uint64_t>({dat(damaged, 1, 1, 1), dat(5, 1, 1, 1),
                                                      dat(damaged + 1, 1, 1, 1),
                                                      dat(damaged + 2000, 1, 1, 1)}),
                   (damaged + 2000.0) / 1e6);
  }
  expect_last_at(
      kEvt2Header + words<std::uint32_t>({evt2_high(7), evt2(0, 1, 1, 1), evt2_high(0xf000007),
                                          evt2(0, 1, 1, 1), evt2_high(8), evt2(0, 1, 1, 1)}),
      512e-6);
  // EVT 3.0's counter is of 4096 µs, half of its range 8.4 s: a 32nd of that is 64 counts.
  for (const int later : {63, 64}) {
    const auto recording =
        open(kEvt3Header +
             words<std::uint16_t>({evt3(kY, 0), evt3(kHigh, 100), evt3(kX, 1), evt3(kHigh, 4000),
                                   evt3(kX, 1), evt3(kHigh, 100 + later), evt3(kX, 1)}));
    EXPECT_EQ(recording->notes().size(), later == 63 ? 1u : 0u);
    EXPECT_EQ(recording->event_span()->at(1),
              later == 63 ? 4000 * 4096e-6 : (100 + later + 4096) * 4096e-6);
  }
}

// What comes after it has its own times, not those of the next range.
TEST_F(PropheseeTest, StepsBackOverAWrap) {
  const auto expect_last_at = [&](const std::string& bytes, double wrap_s, double last_s) {
    const auto recording = open(bytes);
    EXPECT_THROWS(recording->events_in(wrap_s - 1e-5, wrap_s + 1e-5), InputError,
                  "expected times that never decrease");
    EXPECT_EQ(recording->event_span()->at(1), last_s);
    EXPECT_EQ(recording->events_in(last_s - 1e-6, last_s).size(), 1u);
    EXPECT_THAT(recording->notes(), ElementsAre(HasSubstr("before an earlier one")));
  };
  for (const std::uint32_t back : {1, 2, 1000}) {
    SCOPED_TRACE(back);
    expect_last_at(
        kDatHeader + words<std::uint64_t>({dat(0xffffffff, 1, 1, 1), dat(0, 1, 1, 1),
                                           dat(0 - 2000 * back, 1, 1, 1), dat(99, 1, 1, 1)}),
        4294.967296, (4294967296 + 99) / 1e6);
    const auto high = [](std::uint32_t value) { return evt2_high(value & 0xfffffff); };
    expect_last_at(
        kEvt2Header + words<std::uint32_t>({high(0xfffffff), evt2(0, 1, 1, 1), high(0),
                                            evt2(0, 1, 1, 1), high(0 - 32 * back), evt2(0, 1, 1, 1),
                                            high(1), evt2(0, 1, 1, 1)}),
        17179.869184, (17179869184 + 64) / 1e6);
    const int late = 4096 - static_cast<int>(back);
    expect_last_at(
        kEvt3Header + words<std::uint16_t>({evt3(kY, 0), evt3(kHigh, 4095), evt3(kX, 1),
                                            evt3(kHigh, 0), evt3(kX, 1), evt3(kHigh, late),
                                            evt3(kX, 1), evt3(kHigh, 1), evt3(kX, 1)}),
        16.777216, (16777216 + 4096) / 1e6);
  }
}

TEST_F(PropheseeTest, PassesOverWordsThatMeanNothing) {
  const auto evt3_file = open(kEvt3Header +
                              words<std::uint16_t>({0x9999, evt3(kHigh, 1), 0x9999, evt3(kY, 0),
                                                    evt3(kX, 1), evt3(1, 0), evt3(kX, 2)}) +
                              "x");
  EXPECT_EQ(evt3_file->events_in(0, 1).size(), 2u);
  EXPECT_THAT(evt3_file->notes(),
              ElementsAre(HasSubstr("reserved types are passed over: 3, in "),
                          HasSubstr("behind the last word are passed over: 1")));
  EXPECT_THAT(
      open(kEvt2Header + words<std::uint32_t>({evt2_high(1), evt2(0, 1, 1, 1), 0x20000000}) + "123")
          ->notes(),
      ElementsAre(HasSubstr("passed over: 1, in "), HasSubstr("passed over: 3, in ")));
  EXPECT_THAT(open(kDatHeader + words<std::uint64_t>({dat(0, 1, 1, 1)}) + "123")->notes(),
              ElementsAre(HasSubstr("over: 3, in ")));
}

TEST_F(PropheseeTest, LeavesOutEventsBesideTheSensor) {
  std::vector<std::uint64_t> stored(200, dat(0, 7, 5, 1));
  stored.push_back(dat(0, 8, 5, 1));
  const auto recording = open(kDatHeader + words(stored));
  EXPECT_EQ(recording->events_in(-1, 1).size(), 200u);
  EXPECT_THAT(recording->notes(),
              ElementsAre(HasSubstr("beside the sensor of 8x6 are left out: 1, in ")));
  // Many speak of another size: the manifest's counts, but that is worth a warning.
  stored.push_back(dat(0, 4, 5, 1));
  const auto small = open(kDatHeader + words(stored), ImageSize{6, 5});
  EXPECT_EQ(small->size(), (ImageSize{6, 5}));
  EXPECT_EQ(small->events_in(-1, 1).size(), 1u);
  EXPECT_THAT(
      small->warnings(),
      ElementsAre(HasSubstr("the file tells a sensor of 8x6, the manifest's \"sensor\" is 5x6"),
                  HasSubstr("left out: 201, in ")));
  EXPECT_THROWS(open(kDatHeader + words(stored), ImageSize{4, 5}), InputError,
                "expected events on the sensor of 5x4, got none: 202 beside it");
}

TEST_F(PropheseeTest, RefusesWhatIsNoEvent) {
  expect_refused(kEvt3Header + words<std::uint16_t>({evt3(kY, 0), evt3(kY, 0, true)}),
                 "expected events of one camera");
  expect_refused(kDatHeader + words<std::uint64_t>({dat(0, 7, 5, 2)}), "expected polarities");
}

TEST_F(PropheseeTest, ReadsHeaders) {
  const std::string word = words<std::uint32_t>({evt2_high(1)});
  EXPECT_EQ(open("% evt 2.0\r\n% width 640\n% height 480\n" + word)->size(), (ImageSize{480, 640}));
  EXPECT_EQ(open("% format EVT2;width=9;endianness=little;height=8\n" + word)->size(),
            (ImageSize{8, 9}));
  EXPECT_EQ(open("% evt 2.0\n" + word, ImageSize{7, 3})->size(), (ImageSize{7, 3}));
  EXPECT_EQ(open(kEvt2Header + word, ImageSize{6, 8})->size(), (ImageSize{6, 8}));
  EXPECT_EQ(find_recording_format(path_), RecordingFormat::kProphesee);
  testing::write_file(path_, "% text\n");
  EXPECT_EQ(find_recording_format(path_), std::nullopt);
  // The end of the header is what the words begin behind, also if they begin as a line would.
  EXPECT_THAT(open("% evt 3.0\n% geometry 40x6\n% end\n% " +
                   words<std::uint16_t>({evt3(kHigh, 1), evt3(kY, 1), evt3(kX, 1)}))
                  ->notes(),
              ElementsAre(HasSubstr("left out: 1")));
}

TEST_F(PropheseeTest, RefusesHeaders) {
  expect_refused("", "expected a header");
  expect_refused("% text\n", "expected a header");
  expect_refused("% evt 2.0", "expected a line of text, got no end of it");
  expect_refused(
      "% evt 2.0\n",
      R"("sensor": {"width": ..., "height": ...} in the manifest, got none, in )" + path_.string());
  expect_refused("% evt 4.0\n", "expected 2.0, 2.1 or 3.0, got another encoding, in " +
                                    path_.string() + " (byte 0)");
  expect_refused("% evt 2.0\n% format EVT3;height=1;width=1\n", "expected lines that agree");
  expect_refused("% format EVT4;height=1;width=1\n", "expected EVT2, EVT21 or EVT3");
  expect_refused("% evt 3.0\n% endianness legacy\n% geometry 8x6\n", "little-endian");
  expect_refused("% evt 2.0\n% endianness big\n", "little-endian");
  expect_refused("% format EVT2;endianness=big\n", "little-endian");
  for (const char* geometry : {"8", "8x", "x6", "0x6", "8193x6", "8x6x", "-8x6", "99999999999x6"}) {
    expect_refused(std::string("% evt 2.0\n% geometry ") + geometry + "\n",
                   "expected pixels 1..8192");
  }
  expect_refused("% Data file containing CD events\n% Version 1\n" + std::string("\x0c\x08", 2),
                 "% Version 2");
  expect_refused("% Data file containing CD events\n" + std::string("\x0c\x08", 2), "% Version 2");
  expect_refused(kDatHeader.substr(0, 67), "expected events of type 0 or 12 of 8 bytes");
  std::string other = kDatHeader;
  other[66] = '\x0e';
  expect_refused(other, "expected events of type 0 or 12 of 8 bytes");
}

// More events than between two places where decoding can begin: any part is as of the whole.
TEST_F(PropheseeTest, ReadsPartsOfALongRecording) {
  std::mt19937 random(5);
  std::vector<std::uint16_t> stored;
  std::vector<Event> expected;
  std::int64_t time_us = 4'000 * 4096;  // wraps on the way
  std::int64_t high = -1;
  int y = -1;
  while (expected.size() < 200'000) {
    time_us += random() % 40;
    if (time_us >> 12 != high)
      stored.push_back(evt3(kHigh, static_cast<int>((high = time_us >> 12) & 4095)));
    stored.push_back(evt3(kLow, static_cast<int>(time_us & 4095)));
    if (random() % 3 == 0 || y < 0) stored.push_back(evt3(kY, y = static_cast<int>(random() % 6)));
    const bool on = random() % 2 == 0;
    const int x = static_cast<int>(random() % 28);
    const double time_s = static_cast<double>(time_us) / 1e6;
    if (random() % 2 == 0) {
      stored.push_back(evt3(kX, x, on));
      expected.push_back({x, y, time_s, on});
    } else {
      const int valid = static_cast<int>(random() % 4096);
      stored.insert(stored.end(), {evt3(kBase, x, on), evt3(kVector12, 0)});
      stored.back() = static_cast<std::uint16_t>(kVector12 << 12 | valid);
      for (int i = 0; i < 12; ++i) {
        if (valid >> i & 1) expected.push_back({x + i, y, time_s, on});
      }
    }
  }
  const auto recording = open(kEvt3Header + words(stored));
  EXPECT_EQ(recording->events_in(0, 1e6), expected);
  EXPECT_GT(expected.back().t_s, 16.8);
  const StoredParts parts = open_prophesee(path_, options_);
  ASSERT_EQ(parts.events->count(), std::ssize(expected));
  for (int i = 0; i < 30; ++i) {
    const std::int64_t first = static_cast<std::int64_t>(random() % expected.size());
    const std::int64_t count = std::min<std::int64_t>(static_cast<std::int64_t>(random() % 3000),
                                                      std::ssize(expected) - first);
    const std::vector<StoredEvent> part = parts.events->read(first, count);
    ASSERT_EQ(std::ssize(part), count);
    for (std::int64_t j = 0; j < count; ++j) {
      const Event& event = expected[static_cast<std::size_t>(first + j)];
      const StoredEvent& stored_event = part[static_cast<std::size_t>(j)];
      ASSERT_EQ(stored_event.t_s, event.t_s);
      ASSERT_EQ(stored_event.x, event.x);
    }
  }
}

TEST_F(PropheseeTest, ReadsCamerasFiles) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto fixtures = data / "real_labels/fixtures";
  RecordingOptions vga;
  vga.sensor = ImageSize{480, 640};
  vga.time_shift = false;
  const auto evt2_file = open_recording(fixtures / "evt2.raw", RecordingFormat::kProphesee, vga);
  const std::vector<Event> events = evt2_file->events_in(0, 1e6);
  ASSERT_EQ(events.size(), 539'481u);
  EXPECT_EQ(events.front(), (Event{237, 121, 1.317888, true}));
  EXPECT_EQ(events.back(), (Event{210, 142, 1.367888, true}));
  EXPECT_THAT(evt2_file->notes(), IsEmpty());
  RecordingOptions ncars;
  ncars.sensor = ImageSize{100, 120};
  const auto dat_file = open_recording(fixtures / "ncars.dat", RecordingFormat::kProphesee, ncars);
  EXPECT_EQ(dat_file->events_in(-1, 1e6).size(), 2009u);
  EXPECT_EQ((*dat_file->event_span())[1], 0.099952);
  for (const char* name : {"evt2.raw", "evt3.raw", "ncars.dat"}) {
    EXPECT_EQ(find_recording_format(fixtures / name), RecordingFormat::kProphesee);
  }
}

// As another program has decoded it. Its times lie 4096 µs later for each of eleven words of the
// lower part that step back, whatever the upper part says: nine of them are of a signal of 1 kHz
// and not of an event, two are where the upper part goes on too. The upper part is said every
// 16 µs, 551 times, so that the recording is of 8.8 ms, as here, not of the other's 54 ms.
TEST_F(PropheseeTest, ReadsEvt3AsAnotherProgram) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto fixtures = data / "real_labels/fixtures";
  RecordingOptions options;
  options.sensor = ImageSize{720, 1280};
  options.time_shift = false;
  const auto recording =
      open_recording(fixtures / "evt3.raw", RecordingFormat::kProphesee, options);
  const std::vector<Event> events = recording->events_in(0, 1e6);
  EXPECT_NEAR(events.back().t_s - events.front().t_s, 550 * 16e-6, 16e-6);
  const std::vector<std::byte> npy = ZipArchive(fixtures / "evt3_decoded.npz").read("arr_0.npy");
  struct Row {
    std::int64_t t_us;
    std::int16_t x, y;
    std::uint8_t on;
  };
  std::uint16_t header_bytes = 0;
  std::memcpy(&header_bytes, npy.data() + 8, 2);
  const std::size_t first = 10 + header_bytes;
  ASSERT_EQ((npy.size() - first) / sizeof(Row), events.size());
  std::int64_t later_us = 0;
  for (std::size_t i = 0; i < events.size(); ++i) {
    Row row;
    std::memcpy(&row, npy.data() + first + i * sizeof(Row), sizeof(row));
    ASSERT_EQ((Event{row.x, row.y, events[i].t_s, row.on == 1}), events[i]) << i;
    const std::int64_t difference_us = row.t_us - std::llround(events[i].t_s * 1e6);
    ASSERT_EQ(difference_us % 4096, 0) << i;
    ASSERT_GE(difference_us, later_us) << i;
    later_us = difference_us;
  }
  EXPECT_EQ(later_us, 11 * 4096);
}

}  // namespace
}  // namespace eventgan
