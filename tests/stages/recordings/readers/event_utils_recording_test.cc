#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <filesystem>
#include <string>
#include <vector>

#include "manifests/values/faults.h"
#include "stages/base/hdf5/hdf5.h"
#include "stages/recordings/readers/recording.h"
#include "tests/testing/hdf5_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using Numbers = std::vector<std::int64_t>;
using Seconds = std::vector<double>;

/// A sensor of 3x2 pixels (width x height): four events from 5 s on, two images.
class EventUtilsTest : public ::testing::Test {
 protected:
  EventUtilsTest() {
    datasets_ = {
        {"events/xs", {{4}, Numbers{0, 1, 2, 2}}},
        {"events/ys", {{4}, Numbers{0, 1, 0, 1}}},
        {"events/ts", {{4}, Seconds{5, 5.25, 5.25, 5.5}}},
        {"events/ps", {{4}, Numbers{0, 1, 1, 0}}},
        {"images/image000000000", {{2, 3}, std::vector<std::uint8_t>{1, 2, 3, 4, 5, 6}}},
        {"images/image000000001",
         {{2, 3, 3},
          std::vector<std::uint8_t>{9, 9, 9, 0, 0, 0, 0, 0, 200, 7, 7, 7, 8, 8, 8, 9, 9, 9}}}};
    attributes_ = {{"/", "sensor_resolution", {2, 3}},
                   {"images/image000000000", "timestamp", {5.1}},
                   {"images/image000000001", "timestamp", {5.3}}};
  }

  std::unique_ptr<Recording> open() {
    std::filesystem::remove(path_);  // not over the file of a recording that is open
    testing::write_hdf5(path_, datasets_);
    {
      const Hdf5Lock lock;
      const Hdf5Handle file(H5Fopen(path_.c_str(), H5F_ACC_RDWR, H5P_DEFAULT), H5Fclose);
      for (const auto& [object, name, values] : attributes_) {
        const Hdf5Handle to(H5Oopen(file, object.c_str(), H5P_DEFAULT), H5Oclose);
        const hsize_t count = values.size();
        const Hdf5Handle space(
            count == 1 ? H5Screate(H5S_SCALAR) : H5Screate_simple(1, &count, nullptr), H5Sclose);
        const Hdf5Handle attribute(
            H5Acreate2(to, name.c_str(), H5T_NATIVE_DOUBLE, space, H5P_DEFAULT, H5P_DEFAULT),
            H5Aclose);
        H5Awrite(attribute, H5T_NATIVE_DOUBLE, values.data());
      }
    }
    return open_recording(path_, std::nullopt, options_);
  }

  void refuses(const std::string& what) { EXPECT_THROWS(open(), InputError, what); }

  struct Attribute {
    std::string object, name;
    std::vector<double> values;
  };

  testing::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "r.h5";
  std::map<std::string, testing::Hdf5Dataset> datasets_;
  std::vector<Attribute> attributes_;
  RecordingOptions options_;
};

TEST_F(EventUtilsTest, ReadsEventsImagesAndTheSize) {
  const auto recording = open();
  EXPECT_EQ(find_recording_format(path_), RecordingFormat::kEventUtils);
  EXPECT_EQ(recording->size(), (ImageSize{2, 3}));
  EXPECT_EQ(recording->event_span(), (std::array{5.0, 5.5}));
  EXPECT_THAT(recording->events_in(5, 5.25),
              ElementsAre(Event{1, 1, 5.25, true}, Event{2, 0, 5.25, true}));
  EXPECT_THAT(recording->events_between(0, 1),
              ElementsAre(Event{1, 1, 5.25, true}, Event{2, 0, 5.25, true}));
  ASSERT_EQ(recording->frame_count(), 2);
  EXPECT_EQ(recording->frame_time_s(1), 5.3);
  EXPECT_THAT(recording->frame(0).pixels, ElementsAre(1, 2, 3, 4, 5, 6));
  EXPECT_THAT(recording->notes(), IsEmpty());
  EXPECT_THAT(recording->frame(1).pixels, ElementsAre(9, 0, 60, 7, 8, 9));  // 0.299 * 200
  EXPECT_THAT(recording->notes(), ElementsAre(HasSubstr("frames in colour are made grey")));
}

TEST_F(EventUtilsTest, ReadsRawEventsOfEventVisionLibrary) {
  datasets_ = {{"raw_events/x", {{3}, Numbers{0, 1, 2}}},
               {"raw_events/y", {{3}, Numbers{0, 1, 0}}},
               {"raw_events/t", {{3}, Seconds{5, 5.25, 5.5}}},
               {"raw_events/p", {{3}, Numbers{0, 1, 1}}}};
  attributes_ = {};
  options_.sensor = ImageSize{2, 3};
  EXPECT_THAT(open()->events_in(5, 6),
              ElementsAre(Event{1, 1, 5.25, true}, Event{2, 0, 5.5, true}));
}

TEST_F(EventUtilsTest, TheManifestsSizeCountsAndIsAskedForWhereTheFileTellsNone) {
  options_.sensor = ImageSize{2, 4};
  EXPECT_THAT(open()->warnings(), ElementsAre(HasSubstr("the file tells a sensor of 3x2")));
  EXPECT_THROWS(open()->frame(0), InputError, "expected an image of 4x2, uint8 [2, 4]");
  options_.sensor.reset();
  attributes_.erase(attributes_.begin());
  refuses("expected the sensor's size");
  attributes_.push_back({"/", "sensor_resolution", {0, 3}});
  refuses("(attribute sensor_resolution)");
}

TEST_F(EventUtilsTest, WhatDoesNotFitIsRefused) {
  datasets_["events/ts"] = {{4}, Numbers{5, 6, 7, 8}};
  refuses("expected float numbers [N], got int64 [4]");
  datasets_["events/ts"] = {{3}, Seconds{5, 6, 7}};
  refuses("expected as many numbers as events/ts, 3");
  datasets_["events/ts"] = {{4}, Seconds{5, 6, 7, 8}};
  attributes_.pop_back();
  refuses("expected a time, got none");
}

TEST_F(EventUtilsTest, TimesThatAreNoNumbersOrFallFaultTheirWindows) {
  datasets_["events/ts"] = {{4}, Seconds{5, 5.3, 5.2, 5.5}};
  const auto recording = open();
  EXPECT_THROWS(recording->events_in(5.1, 5.3), InputError, "(event 2)");
  EXPECT_THAT(recording->events_in(5.3, 6), ElementsAre(Event{2, 1, 5.5, false}));
}

}  // namespace
}  // namespace eventgan
