#include "stages/recordings/readers/detail/hdf5_recording.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "manifests/values/faults.h"
#include "stages/recordings/readers/detail/hdf5_table.h"
#include "stages/recordings/writers/mvsec_writer.h"
#include "tests/stages/recordings/small_recording.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class Hdf5TableTest : public ::testing::Test {
 protected:
  Hdf5TableTest()
      : file_(H5Fcreate((folder_ / "f.h5").c_str(), H5F_ACC_EXCL, H5P_DEFAULT, H5P_DEFAULT),
              H5Fclose) {}

  /// A chunked, compressed dataset.
  Hdf5Handle create(const char* name, hid_t type, const Dims& dims, const Dims& chunk) {
    const Hdf5Handle how(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    H5Pset_chunk(how, static_cast<int>(chunk.size()), chunk.data());
    H5Pset_deflate(how, 1);
    const Hdf5Handle space(H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr),
                           H5Sclose);
    return {H5Dcreate2(file_, name, type, space, H5P_DEFAULT, how, H5P_DEFAULT), H5Dclose};
  }

  const Hdf5Lock lock_;
  testing::TemporaryFolder folder_;
  Hdf5Handle file_;
};

TEST_F(Hdf5TableTest, ReadsBlocksAndConverts) {
  std::vector<float> values(12);
  std::iota(values.begin(), values.end(), 0.0f);
  H5Dwrite(create("t", H5T_IEEE_F32BE, {3, 4}, {2, 1}), H5T_NATIVE_FLOAT, H5S_ALL, H5S_ALL,
           H5P_DEFAULT, values.data());
  const Hdf5Table table(file_, "t", "f.h5");
  EXPECT_THAT(table.dims(), ElementsAre(3, 4));
  EXPECT_TRUE(table.is_float());
  EXPECT_FALSE(table.is_uint8());
  std::vector<double> block(4);
  table.read({1, 2}, {2, 2}, block.data());
  EXPECT_THAT(block, ElementsAre(6, 7, 10, 11));
  EXPECT_THROWS(table.read({2, 0}, {2, 2}, block.data()), Hdf5Error, "cannot ");
}

TEST_F(Hdf5TableTest, RefusesAClaimBeyondWhatIsStored) {
  create("huge", H5T_NATIVE_DOUBLE, {hsize_t{1} << 50, 4}, {1024, 4});
  EXPECT_THROWS(Hdf5Table(file_, "huge", "f.h5"), InputError, "0 stored bytes",
                "f.h5 (dataset huge)");
}

TEST_F(Hdf5TableTest, RefusesWhatIsNoDatasetOfNumbers) {
  const Hdf5Handle group(H5Gcreate2(file_, "g", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
  H5Lcreate_soft("/nowhere", file_, "link", H5P_DEFAULT, H5P_DEFAULT);
  const Hdf5Handle pair(H5Tcreate(H5T_COMPOUND, 8), H5Tclose);
  H5Tinsert(pair, "x", 0, H5T_NATIVE_INT);
  create("pair", pair, {1}, {1});
  for (const auto& [name, got] : {std::pair("g", "a readable dataset, got damage"),
                                  {"g/none", "a dataset, got none"},
                                  {"none/none", "a dataset, got none"},
                                  {"link", "a dataset, got none"},
                                  {"pair", "numbers, got no numbers [1]"}}) {
    EXPECT_THROWS(Hdf5Table(file_, name, "f.h5"), InputError,
                  std::string("expected ") + got + ", in f.h5 (dataset " + name + ")");
  }
}

const std::string kHdf5Events = "davis/left/events";
const std::string kFrames = "davis/left/image_raw";
const std::string kTimes = "davis/left/image_raw_ts";
const std::string kIndex = "davis/left/image_raw_event_inds";
const std::string kFlow = "davis/left/flow_dist";

class Hdf5RecordingTest : public ::testing::Test {
 protected:
  Hdf5RecordingTest() : datasets_(testing::small_mvsec()) {}

  std::unique_ptr<Recording> open() {
    testing::write_hdf5(path_, datasets_);
    return open_hdf5_recording(path_, mvsec_layout("left"));
  }
  /// A cell of the events' table.
  double& cell(std::size_t event, std::size_t column) {
    return std::get<std::vector<double>>(datasets_[kHdf5Events].values)[4 * event + column];
  }
  /// Opening fails with all of `parts` in the message.
  void expect_refused(const std::string& expected, const std::string& got) {
    EXPECT_THROWS(open(), InputError, "expected " + expected, "got " + got, "in " + path_.string());
  }

  testing::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "small.hdf5";
  std::map<std::string, testing::Hdf5Dataset> datasets_;
};

TEST_F(Hdf5RecordingTest, ReadsFramesTimesAndFlow) {
  const auto recording = open();
  EXPECT_EQ(recording->name(), path_.string());
  EXPECT_EQ(recording->size(), (ImageSize{3, 4}));
  EXPECT_EQ(recording->frame_count(), 3);
  EXPECT_EQ(recording->frame_time_s(2), 2.0);
  EXPECT_EQ(recording->frame(1).size, (ImageSize{3, 4}));
  EXPECT_THAT(recording->frame(1).pixels, Each(20));
  const auto flow = recording->flow(1);
  ASSERT_TRUE(flow.has_value());
  EXPECT_EQ(flow->size, recording->size());
  EXPECT_THAT(flow->x_px, Each(2.0f));
  EXPECT_THAT(flow->y_px, Each(-2.0f));
}

// The index of files of others counts differently, or is not there.
TEST_F(Hdf5RecordingTest, ReadsEventsBetweenFramesOfAnyTimesAndSoManyAroundOne) {
  const auto recording = open();
  const std::vector<Event> all = testing::small_events();  // 0.5 1 1.25 1.25 1.75 2 2.5 s
  EXPECT_EQ(recording->events_between(0, 1), (std::vector<Event>{all[2], all[3]}));
  EXPECT_EQ(recording->events_between(1, 2), (std::vector<Event>{all[4], all[5]}));
  EXPECT_EQ(recording->events_between(0, 2).size(), 4u);
  EXPECT_THAT(recording->events_between(2, 2), IsEmpty());
  EXPECT_THAT(recording->events_in(1.0, 1.25), ElementsAre(all[2], all[3]));
  EXPECT_THAT(recording->events_in(0.4, 1.1), ElementsAre(all[0], all[1]));
  EXPECT_THAT(recording->events_in(2.4, 9.0), ElementsAre(all[6]));
  EXPECT_THAT(recording->events_in(1.25, 1.7), IsEmpty());
  EXPECT_THAT(recording->events_in(7, 9), IsEmpty());
  EXPECT_EQ(recording->event_span(), (std::array{0.5, 2.5}));
  EXPECT_THAT(recording->events_around(1.3, 2, 0), ElementsAre(all[2], all[3]));
  EXPECT_THAT(recording->events_around(1.25, 1, 1), ElementsAre(all[3], all[4]));
  EXPECT_THAT(recording->events_around(1.0, 9, 1), ElementsAre(all[0], all[1], all[2]));
  EXPECT_THAT(recording->events_around(2.1, 0, 9), ElementsAre(all[6]));
  EXPECT_THAT(recording->events_around(0.1, 5, 0), IsEmpty());
}

TEST_F(Hdf5RecordingTest, MayHaveNoEvents) {
  datasets_[kHdf5Events] = {{1, 4}, std::vector<double>{0, 0, 1.75, 1}};
  EXPECT_THAT(open()->events_between(0, 1), IsEmpty());
  EXPECT_EQ(open()->events_between(0, 2).size(), 1u);
  datasets_[kHdf5Events] = {{0, 4}, std::vector<double>{}};
  datasets_[kIndex] = {{3}, std::vector<std::int64_t>{-1, -1, -1}};
  const auto empty = open();
  EXPECT_THAT(empty->events_around(1, 5, 5), IsEmpty());
  EXPECT_THAT(empty->events_in(0, 5), IsEmpty());
  EXPECT_THAT(empty->events_between(0, 2), IsEmpty());
  EXPECT_EQ(empty->event_span(), std::nullopt);
}

TEST_F(Hdf5RecordingTest, TrustsTimesMoreThanTheEventIndex) {
  for (const std::vector<std::int64_t>& index :
       {std::vector<std::int64_t>{2, 4, 6}, {0, 0, 0}, {-9, 700, std::int64_t{1} << 62}}) {
    datasets_[kIndex].values = index;
    EXPECT_EQ(open()->events_between(0, 1).size(), 2u);
  }
  datasets_.erase(kIndex);
  EXPECT_EQ(open()->events_between(0, 1).size(), 2u);
}

TEST_F(Hdf5RecordingTest, ReadsFloat32AndPolarityZero) {
  for (std::size_t i = 0; i < 7; ++i) cell(i, 3) = cell(i, 3) > 0 ? 1 : 0;
  const auto wide = std::get<std::vector<double>>(datasets_[kHdf5Events].values);
  datasets_[kHdf5Events].values = std::vector<float>(wide.begin(), wide.end());
  const std::vector<Event> all = testing::small_events();
  EXPECT_EQ(open()->events_between(0, 2), (std::vector<Event>{all[2], all[3], all[4], all[5]}));
}

TEST_F(Hdf5RecordingTest, NeedsOneFrameOnly) {
  datasets_[kFrames] = {{1, 3, 4}, std::vector<std::uint8_t>(12, 7)};
  datasets_[kTimes] = {{1}, std::vector<double>{1}};
  datasets_[kIndex] = {{1}, std::vector<std::int64_t>{1}};
  datasets_.erase(kFlow);
  const auto recording = open();
  EXPECT_EQ(recording->frame_count(), 1);
  EXPECT_THAT(recording->events_between(0, 0), IsEmpty());
  EXPECT_THROWS(recording->flow(0), std::out_of_range, "got 0, in " + path_.string());
}

TEST_F(Hdf5RecordingTest, RefusesFramesThatAreNotThere) {
  datasets_.erase(kFlow);
  const auto recording = open();
  EXPECT_FALSE(recording->flow(1).has_value());
  EXPECT_THROWS(recording->flow(2), std::out_of_range, "expected a frame 0..1, got 2");
  EXPECT_THROWS(recording->frame(3), std::out_of_range, "expected a frame 0..2, got 3");
  EXPECT_THROWS(recording->frame(-1), std::out_of_range, "expected a frame 0..2, got -1");
  EXPECT_THROWS(recording->frame_time_s(3), std::out_of_range, "expected a frame 0..2, got 3");
  EXPECT_THROWS(recording->events_between(2, 0), std::out_of_range, "got 2 and 0, in");
}

TEST_F(Hdf5RecordingTest, NamesTheEventThatIsWrong) {
  struct Wrong {
    std::size_t event, column;
    double value;
    const char* words;
  };
  for (const Wrong& wrong : {Wrong{3, 0, 4, "expected a pixel"},
                             {4, 1, 0.5, "expected a pixel"},
                             {4, 1, std::nan(""), "expected a pixel"},
                             {3, 2, 1.125, "times that never decrease"},  // behind one at 1.25
                             {3, 2, std::nan(""), "a finite time"},
                             {2, 3, 2, "expected polarities"},
                             {4, 3, 0, "expected polarities"}}) {  // event 3 has -1
    datasets_ = testing::small_mvsec();
    cell(wrong.event, wrong.column) = wrong.value;
    EXPECT_THROWS(open()->events_between(0, 2), InputError, wrong.words,
                  "small.hdf5 (event " + std::to_string(wrong.event) + ")");
  }
}

TEST_F(Hdf5RecordingTest, RefusesFlowThatIsNotFinite) {
  std::get<std::vector<float>>(datasets_[kFlow].values)[13] = std::nanf("");
  const auto recording = open();
  EXPECT_THROWS(recording->flow(0), InputError, "small.hdf5 (flow of frame 0)");
}

TEST_F(Hdf5RecordingTest, TellsOfDamagedValuesWithTheCause) {
  {
    MvsecWriter writer(path_, {3, 4}, "");
    writer.add_frame({{3, 4}, std::vector<std::uint8_t>(12)}, 0, nullptr);
    std::vector<Event> events;
    for (int i = 0; i < 100'000; ++i) events.push_back({i * 3 % 4, 0, 0.001 * (i + 1), i % 7 < 3});
    writer.add_events(events);
    writer.add_frame({{3, 4}, std::vector<std::uint8_t>(12)}, 101, nullptr);
    writer.commit();
  }
  std::string bytes = testing::read_file(path_);
  bytes[bytes.size() / 2] ^= 1;  // the middle of the file is events
  testing::write_file(path_, bytes);
  const auto recording = open_hdf5_recording(path_, mvsec_layout("left"));
  EXPECT_THAT(recording->frame(1).pixels, Each(0));
  EXPECT_THROWS(recording->events_between(0, 1), InputError,
                "got damage, in " + path_.string() + " (events ", "): cannot read ");
}

TEST_F(Hdf5RecordingTest, NamesTheDatasetThatIsMissing) {
  for (const std::string& name : {kHdf5Events, kFrames, kTimes}) {
    datasets_.erase(name);
    expect_refused("a dataset", "none");
    datasets_ = testing::small_mvsec();
  }
  testing::write_hdf5(path_, datasets_);
  EXPECT_THROWS(open_hdf5_recording(path_, mvsec_layout("right")), InputError,
                "(dataset davis/right/events)");
  EXPECT_THROWS(open_hdf5_recording(path_, eventgan_layout()), InputError,
                "(dataset davis/events/data)");
}

TEST_F(Hdf5RecordingTest, RefusesColourAndFloatFrames) {
  datasets_[kFrames] = {{3, 3, 4, 3}, std::vector<std::uint8_t>(108)};
  expect_refused("grey images, uint8 [frames, height, width], and no colour", "uint8 [3, 3, 4, 3]");
  datasets_[kFrames] = {{3, 3, 4}, std::vector<float>(36)};
  expect_refused("grey images, uint8", "float32 [3, 3, 4]");
  datasets_[kFrames] = {{3, 3, 4}, std::vector<std::int64_t>(36)};
  expect_refused("grey images, uint8", "int64 [3, 3, 4]");
}

TEST_F(Hdf5RecordingTest, RefusesOtherShapesAndTypes) {
  const auto refused = [&](const std::string& name, testing::Hdf5Dataset dataset,
                           const std::string& got) {
    datasets_[name] = std::move(dataset);
    expect_refused("", got);
    datasets_ = testing::small_mvsec();
  };
  refused(kHdf5Events, {{7, 5}, std::vector<double>(35)}, "float64 [7, 5]");
  refused(kHdf5Events, {{28}, std::vector<double>(28)}, "float64 [28]");
  refused(kHdf5Events, {{7, 4}, std::vector<std::int64_t>(28)}, "int64 [7, 4]");
  refused(kHdf5Events, {{1}, std::vector<std::string>{"x y t p"}}, "text [1]");
  refused(kFrames, {{36}, std::vector<std::uint8_t>(36)}, "uint8 [36]");
  refused(kFrames, {{3, 0, 4}, std::vector<std::uint8_t>{}}, "uint8 [3, 0, 4]");
  refused(kTimes, {{2}, std::vector<double>{1, 2}}, "float64 [2]");
  refused(kTimes, {{3}, std::vector<std::int64_t>{1, 2, 3}}, "int64 [3]");
  refused(kTimes, {{3}, std::vector<double>{1, 2, 2}}, "2.000000 s");
  refused(kFlow, {{3, 2, 3, 4}, std::vector<float>(72)}, "float32 [3, 2, 3, 4]");
  refused(kFlow, {{2, 2, 3, 4}, std::vector<std::uint8_t>(48)}, "uint8 [2, 2, 3, 4]");
  datasets_[kFrames] = {{0, 3, 4}, std::vector<std::uint8_t>{}};
  datasets_[kTimes] = {{0}, std::vector<double>{}};
  datasets_[kIndex] = {{0}, std::vector<std::int64_t>{}};
  expect_refused("at least one frame", "none");
}

TEST_F(Hdf5RecordingTest, RefusesWhatIsNoHdf5File) {
  const auto open_it = [&] { open_hdf5_recording(path_, mvsec_layout("left")); };
  EXPECT_THROWS(open_it(), InputError, "got none, in " + path_.string());
  testing::write_hdf5(path_, datasets_);
  const std::string whole = testing::read_file(path_);
  for (const std::string& bytes : {std::string(), std::string("no HDF5"), whole.substr(0, 3000)}) {
    testing::write_file(path_, bytes);
    EXPECT_THROWS(open_it(), InputError, "one that does not open");
  }
  EXPECT_THROWS(open_hdf5_recording(folder_.path(), mvsec_layout("left")), InputError,
                "got a folder");
}

/// A file of v2e's: three events of 3x2 pixels (width x height), in rows t, x, y, p.
class V2eTest : public ::testing::Test {
 protected:
  std::unique_ptr<Recording> open() {
    std::filesystem::remove(path_);  // not over the file of a recording that is open
    testing::write_hdf5(path_, datasets_);
    return open_recording(path_, std::nullopt, options_);
  }

  using Numbers = std::vector<std::int64_t>;
  testing::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "v2e.h5";
  std::map<std::string, testing::Hdf5Dataset> datasets_ = {
      {"events", {{3, 4}, Numbers{1000, 2, 1, 1, 2500, 0, 1, 0, 2500, 1, 0, 1}}}};
  RecordingOptions options_;
};

TEST_F(V2eTest, HasMicrosecondsFirstAndAsksForTheSize) {
  EXPECT_THROWS(open(), InputError, "expected the sensor's size");
  options_.sensor = ImageSize{2, 3};
  const auto recording = open();
  EXPECT_EQ(find_recording_format(path_), RecordingFormat::kV2e);
  EXPECT_EQ(recording->frame_count(), 0);
  EXPECT_EQ(recording->event_span(), (std::array{0.001, 0.0025}));
  EXPECT_THAT(
      recording->events_in(0, 1),
      ElementsAre(Event{2, 1, 0.001, true}, Event{0, 1, 0.0025, false}, Event{1, 0, 0.0025, true}));
  EXPECT_THAT(recording->events_around(0.002, 5, 1),
              ElementsAre(Event{2, 1, 0.001, true}, Event{0, 1, 0.0025, false}));
}

TEST_F(V2eTest, AttributesTellTheSize) {
  datasets_["events@width"] = {{}, Numbers{3}};
  datasets_["events@height"] = {{}, Numbers{2}};
  EXPECT_EQ(open()->size(), (ImageSize{2, 3}));
  EXPECT_EQ(open()->frame_count(), 0);
}

TEST_F(V2eTest, FramesTellTheSize) {
  datasets_["frame"] = {{2, 2, 3},
                        std::vector<std::uint8_t>{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}};
  datasets_["frame_ts"] = {{2}, Numbers{500, 2500}};
  datasets_["frame_idx"] = {{2}, Numbers{0, 3}};
  const auto recording = open();
  EXPECT_EQ(recording->size(), (ImageSize{2, 3}));
  EXPECT_EQ(recording->frame_time_s(1), 0.0025);
  EXPECT_THAT(recording->frame(1).pixels, ElementsAre(7, 8, 9, 10, 11, 12));
  EXPECT_EQ(recording->events_between(0, 1).size(), 3u);
  EXPECT_EQ(recording->flow(0), std::nullopt);
  options_.sensor = ImageSize{5, 5};  // frames of another size are none
  const auto larger = open();
  EXPECT_EQ(larger->frame_count(), 0);
  EXPECT_THAT(larger->warnings(), ElementsAre(HasSubstr("a sensor of 3x2")));
}

TEST_F(V2eTest, OtherTablesAreRefused) {
  options_.sensor = ImageSize{2, 3};
  datasets_["events"] = {{2, 3}, Numbers{1, 2, 3, 4, 5, 6}};
  const auto refuses = [&](const char* what) { EXPECT_THROWS(open(), InputError, what); };
  refuses("expected whole numbers [events, 4] of t, x, y, p, got int64 [2, 3]");
  datasets_["events"] = {{1, 4}, std::vector<double>{0.5, 1, 1, 1}};
  refuses("expected whole numbers [events, 4] of t, x, y, p, got float64 [1, 4]");
}

}  // namespace
}  // namespace eventgan
