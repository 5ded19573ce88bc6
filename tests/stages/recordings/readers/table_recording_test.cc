#include "stages/recordings/readers/detail/table_recording.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <string>

#include "manifests/values/faults.h"
#include "stages/base/archives/numpy_arrays.h"
#include "tests/testing/npy_bytes.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"
#include "tests/testing/zip_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// Three events of 4x3 pixels at 5, 7 and 7 µs, as each kind of table.
class TableRecordingTest : public ::testing::Test {
 protected:
  TableRecordingTest() { options_.sensor = ImageSize{3, 4}; }

  std::unique_ptr<Recording> open(const std::string& name) {
    return open_table_recording(folder_ / name, options_);
  }

  void holds_the_events(const std::string& name) {
    SCOPED_TRACE(name);
    EXPECT_EQ(find_recording_format(folder_ / name, options_), RecordingFormat::kTable);
    const auto recording = open(name);
    EXPECT_EQ(recording->size(), (ImageSize{3, 4}));
    EXPECT_EQ(recording->frame_count(), 0);
    EXPECT_EQ(recording->event_span(), (std::array{5e-6, 7e-6}));
    EXPECT_THAT(
        recording->events_in(0, 1),
        ElementsAre(Event{0, 2, 5e-6, true}, Event{3, 0, 7e-6, false}, Event{1, 1, 7e-6, true}));
    EXPECT_THAT(recording->events_around(6e-6, 9, 1),
                ElementsAre(Event{0, 2, 5e-6, true}, Event{3, 0, 7e-6, false}));
  }

  void refuses(const std::string& name, const std::string& text, const std::string& what) {
    testing::write_file(folder_ / name, text);
    EXPECT_THROWS(open(name)->events_in(-1, 1e9), InputError, what, name) << text;
  }

  testing::TemporaryFolder folder_;
  RecordingOptions options_;
};

/// Rows of t <u8, x <u2, three bytes of nothing, y <i2, p |i1.
std::string structured(const std::vector<std::array<std::int64_t, 4>>& rows) {
  std::string bytes;
  for (const auto& [t, x, y, p] : rows) {
    bytes.append(reinterpret_cast<const char*>(&t), 8);
    bytes.append(reinterpret_cast<const char*>(&x), 2);
    bytes.append(3, '\x7f');
    bytes.append(reinterpret_cast<const char*>(&y), 2);
    bytes.append(reinterpret_cast<const char*>(&p), 1);
  }
  return testing::npy_file(
      "{'descr': [('t', '<u8'), ('x', '<u2'), ('', '|V3'), ('y', '<i2'), ('p', '|i1')], "
      "'fortran_order': False, 'shape': (" +
          std::to_string(rows.size()) + ",), }",
      bytes);
}

TEST_F(TableRecordingTest, IsAStructuredArray) {
  testing::write_file(folder_ / "a.npy", structured({{5, 0, 2, 1}, {7, 3, 0, -1}, {7, 1, 1, 1}}));
  holds_the_events("a.npy");
}

TEST_F(TableRecordingTest, IsAnArrayOfFourColumns) {
  testing::write_file(folder_ / "a.npy",
                      testing::npy_doubles({3, 4}, {5, 0, 2, 1, 7, 3, 0, 0, 7, 1, 1, 1}));
  holds_the_events("a.npy");
  // x, y, t, p, in seconds.
  testing::write_file(folder_ / "b.npy",
                      testing::npy_doubles({3, 4}, {0, 2, 5e-6, 1, 3, 0, 7e-6, 0, 1, 1, 7e-6, 1}));
  options_.columns = {"2", "0", "1", "3", 1};
  holds_the_events("b.npy");
  options_.columns.x = "2";
  EXPECT_THROWS(open("b.npy"), InputError, "each of the columns 0 to 3 once, got 2 twice");
  options_.columns.x = "column";
  EXPECT_THROWS(open("b.npy"), InputError, "got an array [N, 4]");
}

TEST_F(TableRecordingTest, IsAnArchiveOfArrays) {
  const std::string t = npy_file("<i8", {3}, std::vector<std::int64_t>{5, 7, 7});
  const std::string x = npy_file("<u2", {3}, std::vector<std::uint16_t>{0, 3, 1});
  const std::string y = npy_file("<i4", {3}, std::vector<std::int32_t>{2, 0, 1});
  const std::string p = npy_file("|u1", {3}, std::vector<std::uint8_t>{1, 0, 1});
  testing::write_zip(folder_ / "a.npz",
                     {{"t_us.npy", t, true}, {"x.npy", x}, {"y.npy", y}, {"p.npy", p}});
  EXPECT_EQ(find_recording_format(folder_ / "a.npz", options_), std::nullopt);
  EXPECT_THROWS(open("a.npz"), InputError, "expected an array \"t\", got none");
  options_.columns.t = "t_us";
  holds_the_events("a.npz");
  const std::string two = npy_file("<u2", {2}, std::vector<std::uint16_t>{0, 3});
  testing::write_zip(folder_ / "b.npz",
                     {{"t_us.npy", t}, {"x.npy", two}, {"y.npy", y}, {"p.npy", p}});
  EXPECT_THROWS(open("b.npz"), InputError, "expected numbers [3], got [2]", "b.npz (x)");
  const std::string text = npy_texts({"a", "b", "c"});
  testing::write_zip(folder_ / "c.npz",
                     {{"t_us.npy", t}, {"x.npy", text}, {"y.npy", y}, {"p.npy", p}});
  EXPECT_THROWS(open("c.npz"), InputError, "got text [3]");
}

TEST_F(TableRecordingTest, IsATextWithAHeader) {
  testing::write_file(folder_ / "a.csv",
                      "\xEF\xBB\xBFx, y ,p,note,t\r\n0,2,1,,5\r\n3,0,0,a,7\n\n1,1,1,,7");
  holds_the_events("a.csv");
  testing::write_file(folder_ / "empty.csv", "t,x,y,p\n");
  EXPECT_EQ(open("empty.csv")->event_span(), std::nullopt);
}

TEST_F(TableRecordingTest, LabelsAndOtherArraysAreNoTables) {
  const RecordingOptions options;
  testing::write_file(folder_ / "labels.csv", "time_s,left,top,right,bottom,class\n");
  testing::write_file(folder_ / "twice.csv", "t,x,y,p,t\n");
  testing::write_file(folder_ / "matrix.npy",
                      testing::npy_doubles({4, 3}, std::vector<double>(12)));
  testing::write_file(folder_ / "broken.npy", "\x93NUMPY");
  testing::write_file(folder_ / "broken.npz", "PK");
  for (const char* name :
       {"labels.csv", "twice.csv", "matrix.npy", "broken.npy", "broken.npz", "absent.npy"}) {
    EXPECT_EQ(find_recording_format(folder_ / name, options), std::nullopt) << name;
  }
}

TEST_F(TableRecordingTest, NamesWhatIsWrong) {
  refuses("a.csv", "t,x,y\n",
          "expected a header line with t, x, y and p (\"columns\" in the manifest names others), "
          "got another");
  refuses("b.csv", "", "expected a header line, got none");
  refuses("c.csv", "t,x,y,p\n1,2\n", "expected 4 fields, got 2, in");
  refuses("d.csv", "t,x,y,p\n1,2,1,1\n1,2,one,1\n", "expected a number of y, got another field");
  refuses("e.csv", "t,x,y,p\n1,2,1,1\n1,4,1,1\n", "got x = 4, y = 1");
  refuses("f.csv", "t,x,y,p\n1,2,1,1\n1,1.5,1,1\n", "got x = 1.5, y = 1");
  refuses("g.csv", "t,x,y,p\n3,2,1,1\ninf,2,1,1\n4,2,1,1\n", "got inf");
  refuses("h.csv", "t,x,y,p\n3,2,1,1\nnan,2,1,1\n", "expected a finite time, got nan");
  refuses("i.csv", "t,x,y,p\n3,2,1,0\n4,2,1,-1\n", "got -1 after 0");
  refuses("j.npy", structured({{5, 0, 2, 1}}) + "x", "expected 1 rows of 16 bytes");
  refuses("k.npy", structured({{-1, 0, 2, 1}}), "expected numbers below 2^63");
  refuses("l.npy",
          testing::npy_file("{'descr': [('t', '<u8'), ('t', '<u2')], 'fortran_order': False, "
                            "'shape': (0,), }",
                            ""),
          "expected each field once");
  refuses("m.npy",
          testing::npy_file("{'descr': [('t', '<u8', (3,))], 'fortran_order': False, "
                            "'shape': (0,), }",
                            ""),
          "in the .npy header");
  options_.sensor.reset();
  refuses("n.csv", "t,x,y,p\n3,2,1,0\n", "expected the sensor's size in the file, or ");
}

TEST_F(TableRecordingTest, ATimeThatIsInfiniteHidesNoOther) {
  testing::write_file(folder_ / "a.csv",
                      "t,x,y,p\n0.1,0,0,1\ninf,0,0,1\n0.12,1,0,1\n0.2,2,0,1\n0.3,3,0,1\n");
  const auto recording = open("a.csv");
  EXPECT_THROWS(recording->events_in(0.05, 0.15), InputError, "got inf");
  EXPECT_THAT(recording->events_in(0.15, 0.25), ElementsAre(Event{2, 0, 0.2, true}));
  EXPECT_THAT(recording->events_in(0.25, 0.35), ElementsAre(Event{3, 0, 0.3, true}));
}

TEST_F(TableRecordingTest, IsSortedByTimeAndSaysSo) {
  testing::write_file(folder_ / "a.csv", "t,x,y,p\n7,3,0,0\n7,1,1,1\n5,0,2,1\n");
  holds_the_events("a.csv");
  EXPECT_THAT(open("a.csv")->notes(),
              ElementsAre(HasSubstr("microseconds, since they are whole numbers"),
                          AllOf(HasSubstr("first at event 2"), HasSubstr("sorted by time"))));
  testing::write_file(folder_ / "b.csv", "t,x,y,p\n5,0,2,1\n7,1,1,1\n");
  EXPECT_EQ(open("b.csv")->notes().size(), 1u);
}

TEST_F(TableRecordingTest, MetavisionsCsvHasNoHeader) {
  testing::write_file(folder_ / "a.csv", "%geometry:4,3\n0,2,1,5\n3,0,0,7\n1,1,1,7\n");
  holds_the_events("a.csv");
  options_.sensor.reset();
  holds_the_events("a.csv");
  testing::write_file(folder_ / "b.csv", "0,2,1,5\n3,0,0,7\n1,1,1,7\n");
  EXPECT_THROWS(open("b.csv"), InputError, "the sensor's size");
  options_.sensor = ImageSize{3, 4};
  holds_the_events("b.csv");
  testing::write_file(folder_ / "c.csv", "%geometry:4,3\n0,2,1,5\n3,x,0,7\n");
  EXPECT_THROWS(open("c.csv"), InputError, "(line 3)");
  options_.sensor.reset();
  testing::write_file(folder_ / "d.csv", "%geometry:4,3\n");
  EXPECT_EQ(find_recording_format(folder_ / "d.csv"), RecordingFormat::kTable);
  EXPECT_EQ(open("d.csv")->event_span(), std::nullopt);
}

TEST_F(TableRecordingTest, TellsWhatItsTimesCount) {
  const auto table = [&](const std::string& times, const std::string& t = "t") {
    std::string text = t + ",x,y,p\n";
    for (std::size_t at = 0; at < times.size(); at = times.find(' ', at) + 1) {
      text += times.substr(at, times.find(' ', at) - at) + ",0,0,1\n";
      if (times.find(' ', at) == std::string::npos) break;
    }
    testing::write_file(folder_ / "t.csv", text);
    options_.columns.t = t;
    return *open("t.csv")->event_span();
  };
  EXPECT_EQ(table("0 2000000"), (std::array{0.0, 2.0}));
  EXPECT_THAT(open("t.csv")->notes(), ElementsAre(HasSubstr("microseconds, since they are whole")));
  EXPECT_EQ(table("0 0.25 2"), (std::array{0.0, 2.0}));
  EXPECT_THAT(open("t.csv")->notes(),
              ElementsAre(AllOf(HasSubstr("seconds"), HasSubstr("decimals"))));
  EXPECT_EQ(table("1700000000000000000 1700000002000000000"),
            (std::array{1'700'000'000.0, 1'700'000'002.0}));
  EXPECT_EQ(table("0 2000000000", "t_ns"), (std::array{0.0, 2.0}));
  EXPECT_EQ(table("0 2000", "time_ms"), (std::array{0.0, 2.0}));
  EXPECT_EQ(table("0 2", "t_s"), (std::array{0.0, 2.0}));
  const auto refused = [&](const std::string& times, const std::string& what) {
    EXPECT_THROWS(table(times), InputError, "expected \"unit\"", what);
  };
  refused("0 300000000000", "us (then 2 events take 300000 s) or ns (300 s)");
  refused("0.5 300000000", "s (then 2 events take 3e+08 s) or us (300 s)");
  options_.columns.tick_s = 1e-9;
  EXPECT_EQ(table("0 300000000000"), (std::array{0.0, 300.0}));
}

TEST_F(TableRecordingTest, AsksWhatTimesCountThatMayBeTwoThings) {
  const auto open_evenly = [&](int events, double span) {  // whole numbers 0..span
    std::string text = "t,x,y,p\n";
    for (int i = 0; i < events; ++i) {
      text += std::to_string(static_cast<std::int64_t>(span * i / (events - 1))) + ",0,0,1\n";
    }
    testing::write_file(folder_ / "t.csv", text);
    return open("t.csv");
  };
  const auto asks = [&](int events, double span, const std::string& readings) {
    EXPECT_THROWS(open_evenly(events, span), InputError, readings);
  };
  asks(100'000, 9'999, "us (then 100000 events take 0.009999 s) or ms (9.999 s)");
  asks(2'000, 0, "or ms (0 s)");
  asks(100'000, 6e9, "us (then 100000 events take 6000 s) or ns (6 s)");
  asks(2'000, 61e6, "us (then 2000 events take 61 s) or ns (0.061 s)");
  EXPECT_EQ(open_evenly(4'000, 100e3)->event_span()->at(1), 0.1);  // as of N-CARS
  EXPECT_EQ(open_evenly(20'000, 150e6)->event_span()->at(1), 150);
  EXPECT_EQ(open_evenly(900, 9e9)->event_span()->at(1), 9000);  // too few to tell
  testing::write_file(folder_ / "t.csv", "t,x,y,p\n");
  EXPECT_THAT(open("t.csv")->notes(), ElementsAre());
}

TEST_F(TableRecordingTest, AFileIsReadAgainWhenItIsOpenedAgain) {
  testing::write_file(folder_ / "a.csv", "t,x,y,p\n1,2,1,1\n");
  const auto recording = open("a.csv");
  testing::write_file(folder_ / "a.csv", "t,x,y,p\n1,2,1,1\n2,2,1,1\n");
  EXPECT_EQ(open("a.csv")->events_in(0, 1).size(), 2u);
  EXPECT_EQ(recording->events_in(0, 1).size(), 1u);  // as it was
}

}  // namespace
}  // namespace eventgan
