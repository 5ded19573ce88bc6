#include "stages/recordings/readers/detail/table_recording.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <tuple>

#include "manifests/values/faults.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/recordings/readers/detail/event_parts.h"
#include "tests/testing/npy_bytes.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"
#include "tests/testing/zip_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::ElementsAreArray;
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
              ElementsAre(HasSubstr("microseconds: 2e-06 s, 3 events, "),
                          AllOf(HasSubstr("first at event 2"), HasSubstr("sorted by time"))));
  // So it is where it is read again, since others have taken its place in memory.
  const auto recording = open("a.csv");
  const auto* const last = reinterpret_cast<const EventParts*>(UINTPTR_MAX);
  recent_events().forget({nullptr, 0}, {last, SIZE_MAX});
  EXPECT_THAT(
      recording->events_in(0, 1),
      ElementsAre(Event{0, 2, 5e-6, true}, Event{3, 0, 7e-6, false}, Event{1, 1, 7e-6, true}));
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
  EXPECT_THAT(open("t.csv")->notes(),
              ElementsAre(HasSubstr("microseconds: 2 s, 2 events, 1 a second, in ")));
  EXPECT_EQ(table("0 0.25 2"), (std::array{0.0, 2.0}));
  EXPECT_THAT(open("t.csv")->notes(), ElementsAre(HasSubstr("seconds: 2 s, 3 events, ")));
  EXPECT_EQ(table("1700000000000000000 1700000002000000000"),
            (std::array{1'700'000'000.0, 1'700'000'002.0}));
  EXPECT_EQ(table("0 2000000000", "t_ns"), (std::array{0.0, 2.0}));
  EXPECT_EQ(table("0 2000", "time_ms"), (std::array{0.0, 2.0}));
  EXPECT_EQ(table("0 2", "t_s"), (std::array{0.0, 2.0}));
  EXPECT_THROWS(table("0 300000000000"), InputError, "expected \"unit\"");
  options_.columns.tick_s = 1e-9;
  EXPECT_EQ(table("0 300000000000"), (std::array{0.0, 300.0}));
}

/// Rows of t, x, y, p of 100x80 pixels in the order of `columns` ("xytp").
std::string rows_in_order(const std::string& columns, int rows, bool are_seconds = false) {
  std::string text;
  for (int i = 0; i < rows; ++i) {
    for (const char column : columns) {
      if (column != columns[0]) text += ',';
      if (column == 't')
        text += are_seconds ? fmt::format("{:.6f}", i * 1e-3) : std::to_string(i * 1000);
      if (column == 'x') text += std::to_string(i * 37 % 100);
      if (column == 'y') text += std::to_string(i * 53 % 80);
      if (column == 'p') text += std::to_string(i * 7 % 3 % 2);
    }
    text += '\n';
  }
  return text;
}

TEST_F(TableRecordingTest, ColumnsWithoutNamesTellTheirOrder) {
  options_.sensor = ImageSize{80, 100};
  testing::write_file(folder_ / "named.csv", "t,x,y,p\n" + rows_in_order("txyp", 90));
  const auto events = open("named.csv")->events_in(-1, 1);
  ASSERT_EQ(events.size(), 90u);
  for (const auto& [columns, are_seconds, note] :
       {std::tuple("xypt", false, ""),
        {"xytp", false, "are taken as x, y, t, p, since"},
        {"txyp", false, "are taken as t, x, y, p, since"},
        {"ptxy", true, "are taken as p, t, x, y"},
        {"txyp", true, "are taken as t, x, y, p"}}) {
    SCOPED_TRACE(columns);
    testing::write_file(folder_ / "a.csv", rows_in_order(columns, 90, are_seconds));
    EXPECT_EQ(find_recording_format(folder_ / "a.csv", options_), RecordingFormat::kTable);
    const auto read = open("a.csv");
    EXPECT_THAT(read->events_in(-1, 1), ElementsAreArray(events));
    EXPECT_EQ(read->notes().size(), *note == '\0' ? 1u : 2u);
    EXPECT_THAT(read->notes()[0], HasSubstr(note));
  }
  std::vector<double> values;
  for (const Event& event : events) {
    for (const double value :
         {event.x * 1.0, event.y * 1.0, std::round(event.t_s * 1e6), event.positive ? 1.0 : -1.0}) {
      values.push_back(value);
    }
  }
  testing::write_file(folder_ / "a.npy", testing::npy_doubles({90, 4}, values));
  EXPECT_THAT(open("a.npy")->events_in(-1, 1), ElementsAreArray(events));
  // None has polarities.
  std::string text = rows_in_order("txyp", 90);
  for (std::size_t at = 0; (at = text.find('\n', at)) != text.npos; at += 3) text.insert(at, "7");
  refuses("b.csv", text, "expected columns x, y, p, t as of tables without names");
  options_.columns = {"0", "1", "2", "3"};
  EXPECT_THROWS(open("b.csv")->events_in(-1, 1), InputError, "polarities");
  testing::write_file(folder_ / "b.csv", rows_in_order("txyp", 90));
  EXPECT_THAT(open("b.csv")->events_in(-1, 1), ElementsAreArray(events));
}

TEST_F(TableRecordingTest, ANegativePolarityMayHaveLostItsSign) {
  for (const char* minus : {"-1", "255", "65535", "4294967295"}) {
    testing::write_file(folder_ / "a.csv",
                        fmt::format("t,x,y,p\n5,0,2,1\n7,3,0,{}\n7,1,1,1\n", minus));
    holds_the_events("a.csv");
  }
  refuses("b.csv", "t,x,y,p\n3,2,1,254\n", "got 254");
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
