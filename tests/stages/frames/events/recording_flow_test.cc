#include "stages/frames/events/recording_flow.h"

#include <cstdint>
#include <limits>
#include <tuple>
#include <vector>

#include "stages/base/images/image_file.h"
#include "tests/stages/frames/events/recording_dataset_fixture.h"
#include "tests/testing/npy_bytes.h"
#include "tests/testing/zip_file.h"

namespace eventgan {
namespace {

/// A source of the recording `seq`, opened as a dataset.
class RecordingFlowTest : public RecordingDatasetTest {
 protected:
  RecordingFlowTest() { spec_.flow = true; }

  static SourceFlow flow_of(const Dataset& dataset, std::size_t frame = 0) {
    const auto flow = dataset.flow(dataset.labelled_frames().at(frame).label_key);
    EXPECT_EQ(fault_of(flow), "no fault");
    return is_fault(flow) ? SourceFlow() : *flow;
  }
};

/// 4 x 3 pixels, five events at 0, 1, 1, 2.5 and 3 ms after 10 s; flow from 10 s to 10.001 s and
/// from 10.002 s to 10.004 s.
class DsecFlow : public RecordingFlowTest {
 protected:
  DsecFlow() {
    using Numbers = std::vector<std::int64_t>;
    testing::write_hdf5(at("seq/events/left/events.h5"),
                        {{"events/x", {{5}, Numbers{0, 1, 2, 3, 0}}},
                         {"events/y", {{5}, Numbers{0, 1, 2, 0, 1}}},
                         {"events/t", {{5}, Numbers{0, 1000, 1000, 2500, 3000}}},
                         {"events/p", {{5}, Numbers{0, 1, 1, 0, 1}}},
                         {"t_offset", {{}, Numbers{10'000'000}}}});
    spec_.root = "seq";
    spec_.recording.sensor = kSensor;
    write("seq/flow/forward_timestamps.txt", kTimes);
    map("000002.png", 1, 1);
    map("000004.png", 2, 0);
  }

  /// x = `px` everywhere.
  void map(const std::string& name, int px, std::uint16_t known, ImageSize size = kSensor) const {
    std::vector<std::uint16_t> rgb;
    for (std::size_t i = 0; i < size.pixel_count(); ++i) {
      rgb.insert(rgb.end(), {static_cast<std::uint16_t>(32768 + 128 * px), 32768, known});
    }
    write("seq/flow/forward/" + name, encode_wide_png(size, rgb));
  }
  void refused(const std::string& why, const std::string& where) const {
    EXPECT_THROWS(open(), InputError, why, where);
  }

  static constexpr ImageSize kSensor{3, 4};
  static constexpr char kTimes[] =
      "# from_timestamp_us, to_timestamp_us\n10000000, 10001000\r\n10002000, 10004000\n\n";
};

TEST_F(DsecFlow, ItsTimesAreTheWindows) {
  const auto dataset = open();
  EXPECT_THAT(ids_of(*dataset), ElementsAre("seq/0000000010.000000", "seq/0000000010.002000"));
  EXPECT_EQ(window(*dataset, 0), (std::array{10.0, 10.001}));
  EXPECT_EQ(window(*dataset, 1), (std::array{10.002, 10.004}));
  const auto events = dataset->events(dataset->labelled_frames()[1].label_key);
  ASSERT_EQ(fault_of(events), "no fault");
  EXPECT_THAT(events->events, SizeIs(2));
  EXPECT_EQ(flow_of(*dataset).size, kSensor);
  EXPECT_THAT(flow_of(*dataset).flow.valid, Each(1));
  EXPECT_EQ(flow_of(*dataset).flow.px[11], 1);
  EXPECT_EQ(flow_of(*dataset).flow.px[12], 0);
  EXPECT_THAT(flow_of(*dataset, 1).flow.valid, Each(0));
  EXPECT_THAT(flow_of(*dataset, 1).flow.px, Each(0));
  EXPECT_THAT(dataset->annotation_files(),
              ElementsAre("seq/flow/forward/000002.png", "seq/flow/forward/000004.png",
                          "seq/flow/forward_timestamps.txt"));
  EXPECT_EQ(annotation_of(*dataset), Annotation{});
}

TEST_F(DsecFlow, IsOfTheRectifiedLeftView) {
  spec_.recording.camera = "right";
  fs::rename(at("seq/events/left"), at("seq/events/right"));
  refused("expected the left camera, which DSEC's flow is of, got \"camera\": \"right\"",
          "seq/flow");
  spec_.recording.camera = "left";
  spec_.root = "seq/events/right/events.h5";
  refused("expected the left camera, which DSEC's flow is of, got \"camera\": \"right\"",
          "seq/flow");
  spec_.root = "seq";
  fs::rename(at("seq/events/right"), at("seq/events/left"));
  spec_.recording.camera = "left";
  const auto doubted = Contains(HasSubstr("flow is wrong unless the events are rectified, too"));
  EXPECT_THAT(open()->warnings(), doubted);
  EXPECT_THAT(open()->notes(), doubted);
  std::vector<float> places;  // a column to the right
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 4; ++x) places.insert(places.end(), {x + 1.f, float(y)});
  }
  testing::write_hdf5(at("seq/events/left/rectify_map.h5"), {{"rectify_map", {{3, 4, 2}, places}}});
  refused("expected \"rectify\": true, since DSEC's flow is of the rectified view, got false",
          "seq/flow");
  spec_.recording.rectify = true;
  EXPECT_THAT(ids_of(*open()), SizeIs(2));

  spec_.recording.rectify = false;  // a camera without distortion
  for (std::size_t i = 0; i < places.size(); i += 2) --places[i];
  testing::write_hdf5(at("seq/events/left/rectify_map.h5"), {{"rectify_map", {{3, 4, 2}, places}}});
  EXPECT_THAT(ids_of(*open()), SizeIs(2));
  EXPECT_THAT(open()->warnings(), IsEmpty());
}

TEST_F(DsecFlow, AMapThatDoesNotFitIsNamed) {
  const auto map = [&](std::size_t width, float first) {
    std::vector<float> places(3 * width * 2);
    for (std::size_t i = 0; i < 3 * width; ++i) {
      places[2 * i] = static_cast<float>(i % width);
      places[2 * i + 1] = static_cast<float>(i / width);
    }
    places[0] = first;
    testing::write_hdf5(at("seq/events/left/rectify_map.h5"),
                        {{"rectify_map", {{3, width, 2}, places}}});
  };
  map(5, 0);
  refused("expected float [3, 4, 2], the sensor's size, got float32 [3, 5, 2]", "rectify_map.h5");
  map(4, std::numeric_limits<float>::quiet_NaN());
  refused("expected finite places, got others", "rectify_map.h5");
  map(4, 0.4f);  // is rounded to its pixel
  EXPECT_THAT(ids_of(*open()), SizeIs(2));
}

TEST_F(DsecFlow, BackwardAloneIsNamed) {
  fs::rename(at("seq/flow/forward"), at("seq/flow/backward"));
  fs::remove(at("seq/flow/forward_timestamps.txt"));
  refused("expected flow/forward, got flow/backward alone, which \"side\": \"before\" makes",
          "seq");
}

TEST_F(DsecFlow, NamesWhatIsWrong) {
  write("seq/flow/forward/000002.png", "no PNG");
  const auto dataset = open();
  EXPECT_THAT(fault_of(dataset->flow(dataset->labelled_frames()[0].label_key)),
              AllOf(StartsWith("expected a PNG, got"), EndsWith("seq/flow/forward/000002.png")));
  EXPECT_THAT(fault_of(dataset->flow("seq/10.5")), HasSubstr("expected flow from 10.5"));

  write("seq/flow/forward/000006.png", "one too many");
  refused("expected an image for each of 2 times, got 3", "seq/flow/forward");
  const std::pair<const char*, const char*> faults[] = {
      {"10000000\n", "expected two times in whole us, got another line"},
      {"10000000, 10001000, 1\n", "(line 1)"},
      {"#\n1e7, 10001000\n", "(line 2)"},
      {"9007199254740993, 9007199254740994\n", "(line 1)"},
      {"10001000, 10000000\n", "expected flow to a later time, got 10.001 s to 10 s"},
      {"10000000, 10001000\n10000000, 10002000\n",
       "expected flow at ascending times, got 10 s after 10 s"},
      {"", "expected an image for each of 0 times, got 3"}};
  for (const auto& [times, fault] : faults) {
    write("seq/flow/forward_timestamps.txt", times);
    refused(fault, "seq/flow/forward");
  }
  fs::remove(at("seq/flow/forward_timestamps.txt"));
  refused("expected the times of DSEC's flow, got no readable file", "forward_timestamps.txt");
}

TEST_F(DsecFlow, FollowsTheNumbersOfItsNames) {
  for (const char* name : {"000002.png", "000004.png"}) fs::remove(at("seq/flow/forward/"s + name));
  map("9.png", 9, 1);
  map("10.png", 10, 1);
  EXPECT_EQ(flow_of(*open()).flow.px[0], 9);
  EXPECT_EQ(flow_of(*open(), 1).flow.px[0], 10);
}

TEST_F(DsecFlow, LiesBesideTheFolderOfEvents) {
  fs::create_directories(at("other/a"));
  fs::rename(at("seq/flow"), at("flow"));
  fs::rename(at("seq/events/left/events.h5"), at("other/a/events.h5"));
  spec_.root = "other/a/events.h5";
  EXPECT_THROWS(open(), InputError, "expected flow beside a recording of DSEC or MVSEC, got none",
                "other/a/events.h5");
}

TEST_F(DsecFlow, OfATimeWithoutEventsIsAFaultAndOfALongOneNoted) {
  // Begins before the first event; ends behind the last one; is behind all of them.
  write("seq/flow/forward_timestamps.txt",
        "9999000, 10001000\n10002000, 10004000\n10003001, 10009000\n");
  map("000006.png", 3, 1);
  const auto dataset = open();
  EXPECT_THAT(
      faults_of(*dataset),
      ElementsAre("", "",
                  HasSubstr("expected a window among the events, from 10 s to 10.003 s, got "
                            "one from 10.003001 s")));
  EXPECT_THAT(dataset->notes(),
              Contains("3 windows of flow beyond the events, which last from 10 s to "
                       "10.003 s, in seq/events/left/events.h5"));
}

TEST_F(DsecFlow, OtherLabelsAreNotLostWithoutAWord) {
  const std::string note = "labels are not read, since flow has times of its own, in seq";
  EXPECT_THAT(open()->notes(), Not(Contains(note)));
  write("seq.csv", "time_s,left,top,right,bottom,class\n10.001,0,0,1,1,car\n");
  EXPECT_THAT(open()->label_schema().class_names, IsEmpty());
  EXPECT_THAT(open()->notes(), Contains(note));
  write("seq.json", "{}");  // two, of which none counts
  EXPECT_THAT(open()->notes(), Contains(note));
}

/// drive_data.h5, 4 x 3 pixels, and flow from 1 s to 1.25 s and on to 1.75 s.
class MvsecFlow : public RecordingFlowTest {
 protected:
  MvsecFlow() {
    testing::write_hdf5(at("drive_data.h5"), testing::small_mvsec());
    spec_.root = "drive_data.h5";
    for (int i = 0; i < 36; ++i) {  // of the third map no end is known
      x_.push_back(i);
      y_.push_back(-0.5 * i);
    }
  }

  void write_flow(const std::vector<double>& times_s, std::size_t width = 4) const {
    testing::write_zip(at("drive_gt_flow_dist.npz"),
                       {{"timestamps.npy", testing::npy_doubles({times_s.size()}, times_s)},
                        {"x_flow_dist.npy", testing::npy_doubles({3, 3, width}, x_), true},
                        {"y_flow_dist.npy", testing::npy_doubles({3, 3, width}, y_)}});
  }

  std::vector<double> x_, y_;
};

TEST_F(MvsecFlow, LastsFromEachTimeToTheNext) {
  x_[13] = std::numeric_limits<double>::infinity();
  y_[14] = std::numeric_limits<double>::quiet_NaN();
  x_[15] = 0;  // y is not
  write_flow({1, 1.25, 1.75});
  const auto dataset = open();
  EXPECT_THAT(ids_of(*dataset),
              ElementsAre("drive_data/0000000001.000000", "drive_data/0000000001.250000"));
  EXPECT_EQ(window(*dataset, 1), (std::array{1.25, 1.75}));
  const PixelFlow flow = flow_of(*dataset, 1).flow;
  EXPECT_EQ(flow.px,
            (std::vector<float>{12, 0, 0, 0,    16, 17,   18, 19,   20,  21,    22,  23,
                                -6, 0, 0, -7.5, -8, -8.5, -9, -9.5, -10, -10.5, -11, -11.5}));
  EXPECT_EQ(flow.valid, (std::vector<std::uint8_t>{1, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1, 1}));
  EXPECT_EQ(flow_of(*dataset).flow.valid[0], 0) << "0, 0 is nothing";
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("drive_gt_flow_dist.npz"));
}

TEST_F(MvsecFlow, IsLeftOutWhereItIsNotRead) {
  write_flow({1, 1.25, 1.75});
  fs::create_directory(at("all"));
  fs::rename(at("drive_data.h5"), at("all/drive_data.h5"));
  fs::copy(at("drive_gt_flow_dist.npz"), at("all/other_gt_flow_dist.npz"));
  fs::rename(at("drive_gt_flow_dist.npz"), at("all/drive_gt_flow_dist.npz"));
  spec_.root = "all";
  EXPECT_THAT(open()->notes(), Contains("1 entry left out in all: other_gt_flow_dist.npz"));
  spec_.flow = false;
  EXPECT_THAT(open()->notes(), Contains(HasSubstr("2 entries left out in all: drive_gt")));
}

TEST_F(MvsecFlow, NamesWhatIsWrong) {
  const auto refused = [&](const char* why) {
    EXPECT_THROWS(open(), InputError, why, "drive_gt_flow_dist.npz");
  };
  write_flow({1, 1.25});
  refused("expected timestamps [N], x_flow_dist and y_flow_dist [N, 3, 4], got [2], [3, 3, 4]");
  write_flow({1, 1.25, 1.25});
  refused("expected flow to a later time, got 1.25 s to 1.25 s");
  write_flow({1.25, 1, 1.75});
  refused("expected flow to a later time, got 1.25 s to 1 s");
  x_.resize(27);
  y_.resize(27);
  write_flow({1, 1.25, 1.75}, 3);
  refused("[3, 3, 3]");
  write("drive_gt_flow_dist.npz", "no zip");
  refused("expected a zip file, got");
  testing::write_zip(at("drive_gt_flow_dist.npz"), {{"x_flow_dist.npy", "no array"}});
  refused("x_flow_dist.npy");
}

TEST_F(MvsecFlow, OfOneTimeHasNoEnd) {
  testing::write_zip(at("drive_gt_flow_dist.npz"),
                     {{"timestamps.npy", testing::npy_doubles({1}, {1})},
                      {"x_flow_dist.npy", testing::npy_doubles({1, 3, 4}, std::vector(12, 1.0))},
                      {"y_flow_dist.npy", testing::npy_doubles({1, 3, 4}, std::vector(12, 1.0))}});
  EXPECT_THROWS(open(), InputError, "expected labels or frames to make samples of, got none",
                "drive_data.h5");
}

TEST_F(MvsecFlow, ThoseWithoutAreLeftOut) {
  testing::write_hdf5(at("all/a.h5"), testing::small_mvsec());
  testing::write_hdf5(at("all/b.h5"), testing::small_mvsec());
  write_flow({1, 1.25, 1.75});
  fs::rename(at("drive_gt_flow_dist.npz"), at("all/a_gt_flow_dist.npz"));
  spec_.root = "all";
  const auto dataset = open();
  EXPECT_THAT(ids_of(*dataset), ElementsAre("a/0000000001.000000", "a/0000000001.250000"));
  EXPECT_THAT(dataset->notes(), Contains("1 recording without flow left out in all: b"));
  EXPECT_THAT(dataset->unreadable().reasons, IsEmpty());
  fs::remove(at("all/a_gt_flow_dist.npz"));
  EXPECT_THROWS(open(), InputError, "expected flow beside a recording of DSEC or MVSEC, got none",
                "all");
}

}  // namespace
}  // namespace eventgan
