#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"
#include "pipeline/exports/export_job.h"
#include "stages/base/archives/hdf5_arrays.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/base/archives/zip_archive.h"
#include "stages/base/images/image_file.h"
#include "stages/recordings/readers/recording.h"
#include "stages/shards/codec/quantization.h"
#include "tests/pipeline/dataset/converted_folder.h"
#include "tests/pipeline/exports/exporters_fixture.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::DoubleNear;
using ::testing::Each;
using ::testing::ElementsAre;
using testing::Exporters;
using ::testing::HasSubstr;
using testing::kChannels;
using testing::kLevel;
using testing::kTimes;
using testing::npy;
using testing::numbers;
using ::testing::Pointwise;
using testing::records;
using testing::tar_content;

TEST_F(Exporters, FlowIsAnArrayInWebdatasetAndImagesInDsec) {
  const std::filesystem::path tar = exported("webdataset") / "demo-val-00000-of-00001.tar";
  testing::write_file(folder_ / "a.npz", tar_content(tar, "000004.npz"));
  const ZipArchive arrays(folder_ / "a.npz");
  const PixelFlow flow = testing::example_shard().samples[4].flow;
  std::vector<std::uint16_t> halves;
  for (const float px : flow.px) {
    halves.push_back(static_cast<std::uint16_t>(to_half(std::abs(px)) | (px < 0 ? 0x8000 : 0)));
  }
  const auto text = [](const auto& bytes) {
    return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  };
  EXPECT_EQ(text(arrays.read("flow.npy")), npy_file("<f2", {2, 6, 8}, halves));
  EXPECT_EQ(text(arrays.read("flow_valid.npy")), npy_file("|u1", {6, 8}, flow.valid));
  EXPECT_FALSE(json::parse(tar_content(tar, "000004.json")).contains("flow"));
  // Labelled is the next image: DSEC's backward flow, from there to the previous one.
  const std::filesystem::path recording = exported("dsec") / "dsec/val/000004";
  EXPECT_EQ(testing::read_file(recording / "flow/backward_timestamps.txt"),
            "# from_timestamp_us, to_timestamp_us\n1000000, 0\n");
  EXPECT_TRUE(std::filesystem::exists(recording / "flow/backward/000000.png"));
  EXPECT_FALSE(std::filesystem::exists(recording / "flow/forward_timestamps.txt"));
  EXPECT_FALSE(moves_events(recording / "events/left/rectify_map.h5", {6, 8}));
  EXPECT_FALSE(std::filesystem::exists(recording / "../000000/events/left/rectify_map.h5"));
}

TEST_F(Exporters, EventsHaveTheCountsOfTheVolume) {
  const std::filesystem::path out = exported("events") / "events/val";
  for (const std::size_t slot : {0, 1, 3, 4}) {
    const std::string text = testing::read_file(out / ("00000" + std::to_string(slot) + ".txt"));
    EXPECT_EQ(std::ranges::count(text, '\n'), event_count(slot)) << slot;
  }
}

TEST_F(Exporters, EventsInMvsecsLayoutAreTheSame) {
  ExportOptions options;
  options.event_file = EventFile::kMvsec;
  const Hdf5Arrays file = read_hdf5_arrays(exported("events", options) / "events/val/000000.hdf5");
  const TypedArray& events = file.arrays.at("davis/left/events");
  EXPECT_THAT(events.shape, ElementsAre(static_cast<std::size_t>(event_count(0)), 4u));
}

/// A recording's format: where the boxes and the events of the sequence drive_0 are.
struct RecordingCase {
  const char* word;
  const char* boxes;
  double t_us;  ///< of the label, on the clock of the format
  const char* events;
};

void PrintTo(const RecordingCase& format, std::ostream* out) { *out << format.word; }

class RecordingExporters : public Exporters, public ::testing::WithParamInterface<RecordingCase> {};

TEST_P(RecordingExporters, HaveTheBoxOfTheSequenceAndItsEvents) {
  const RecordingCase& format = GetParam();
  const std::filesystem::path out = exported_with_frames(format.word);
  // The pair lies between 1.0 s and 1.2 s, where its label is.
  EXPECT_THAT(records(out / format.boxes, {"t", "x", "y", "w", "h", "class_id", "track_id"}),
              ElementsAre(ElementsAre(format.t_us), ElementsAre(1), ElementsAre(1),
                          ElementsAre(3.25), ElementsAre(3.5), ElementsAre(0), ElementsAre(7)));
  const std::filesystem::path events = out / format.events;
  if (events.extension() == ".h5") {
    EXPECT_EQ(read_hdf5_arrays(events).arrays.at("events/x").size(),
              static_cast<std::size_t>(event_count(0, kTimes)));
  } else {
    const auto recording = open_recording(events);
    const std::vector<Event> all = recording->events_in(-1, 10);
    EXPECT_EQ(std::ssize(all), event_count(0, kTimes));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Table, RecordingExporters,
    ::testing::Values(
        RecordingCase{"dsec", "dsec/val/drive_0/object_detections/left/tracks.npy", 1'200'000,
                      "dsec/val/drive_0/events/left/events.h5"},
        RecordingCase{"raw", "raw/val/drive_0_bbox.npy", 200'000, "raw/val/drive_0.raw"},
        RecordingCase{"aedat4", "aedat4/val/drive_0_bbox.npy", 1'200'000,
                      "aedat4/val/drive_0.aedat4"},
        RecordingCase{"rvt", "raw/val/drive_0_bbox.npy", 200'000, "raw/val/drive_0_td.h5"}),
    [](const auto& format) { return format.param.word; });

TEST_F(Exporters, RvtTakesHistogramsAndVolumesAlone) {
  for (const auto& [word, message] :
       {std::pair{"voxel:5", "--representation: expected histogram:T or volume, got voxel:5"},
        {"histogram", "expected histogram:T, T from 1 to 64, got \"histogram\""},
        {"volume:9", "--representation: expected histogram:T or volume, got volume:9"}}) {
    ExportOptions options;
    options.representation = word;
    EXPECT_THAT([&] { exported("rvt", options); },
                ::testing::ThrowsMessage<UsageError>(::testing::HasSubstr(message)));
  }
  // A box of 3 pixels is smaller than RVT takes.
  EXPECT_FALSE(std::filesystem::exists(exported("rvt") / "preprocessed"));
}

TEST_F(Exporters, DsecHasAnImageForEachTimeAndTheEventsAtHalfTheSize) {
  const std::filesystem::path drive = exported_with_frames("dsec") / "dsec/val/drive_0";
  EXPECT_EQ(testing::read_file(drive / "images/timestamps.txt"), "1000000\n1200000\n");
  for (const char* name : {"000000.png", "000001.png"}) {
    const ColourFrame image = decode_image_file(drive / "images/left/distorted" / name);
    EXPECT_EQ(image.size, (ImageSize{6, 8}));
    EXPECT_THAT(image.bgr, Each(kLevel));
  }
  EXPECT_FALSE(std::filesystem::exists(drive / "images/left/distorted/000002.png"));

  const Hdf5Arrays all = read_hdf5_arrays(drive / "events/left/events.h5");
  const Hdf5Arrays half = read_hdf5_arrays(drive / "events/left/events_2x.h5");
  const auto column = [](const Hdf5Arrays& file, const std::string& name) {
    return numbers(file.arrays.at(name));
  };
  // Where the sum of polarities of 2 x 2 pixels is 4 more, or less, than at the last such event.
  std::map<std::pair<double, double>, int> sums;
  std::vector<std::vector<double>> expected(4);
  for (std::size_t i = 0; i < column(all, "events/t").size(); ++i) {
    const auto at = [&](const char* name) { return column(all, name)[i]; };
    const std::pair place(std::floor(at("events/x") / 2), std::floor(at("events/y") / 2));
    sums[place] += at("events/p") == 1 ? 1 : -1;
    if (sums[place] % 4 != 0 || sums[place] == 0) continue;
    sums[place] = 0;
    const double row[] = {place.first, place.second, at("events/t"), at("events/p")};
    for (std::size_t k = 0; k < 4; ++k) expected[k].push_back(row[k]);
  }
  EXPECT_FALSE(expected[0].empty());
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_EQ(column(half, std::string("events/") + "xytp"[k]), expected[k]);
  }
  EXPECT_EQ(column(half, "t_offset"), column(all, "t_offset"));
  EXPECT_EQ(column(half, "ms_to_idx").size(), column(all, "ms_to_idx").size());
  EXPECT_EQ(column(half, "ms_to_idx").back(), static_cast<double>(expected[0].size()));
}

TEST_F(Exporters, DsecGoesWithoutFramesThatAreGoneAndSaysSo) {
  ExportOptions options;
  options.to = &*std::ranges::find(export_formats(), "dsec", &ExportFormat::word);
  options.out = folder_ / "out";
  options.splits = {"val"};
  for (int turn = 0; turn < 2; ++turn) {  // what is done already says it, too
    EXPECT_THAT(run_export(converted_->path(), options).notes,
                Contains(AllOf(HasSubstr("no images of kitti_object in split val: "),
                               HasSubstr("prev_2/000000_02.png"), HasSubstr("--frames names"))));
  }
  const std::filesystem::path images = folder_ / "out/dsec/val/drive_0/images";
  EXPECT_FALSE(std::filesystem::exists(images / "left"));
  EXPECT_EQ(testing::read_file(images / "timestamps.txt"), "1000000\n1200000\n");
}

TEST_F(Exporters, RvtHasTheVolumeWithTheNegativePolarityFirst) {
  ExportOptions options;
  options.representation = "volume";
  const std::filesystem::path drive = exported("rvt", options) / "preprocessed/val/drive_0";
  const std::filesystem::path volumes = drive / "event_representations_v2/eventgan_nbins=2";
  const Hdf5Arrays file = read_hdf5_arrays(volumes / "event_representations.h5");
  const TypedArray& data = file.arrays.at("data");
  EXPECT_THAT(data.shape, ElementsAre(1u, kChannels, 6u, 8u));
  std::vector<float> expected = volume(0);
  std::rotate(expected.begin(), expected.begin() + expected.size() / 2, expected.end());
  EXPECT_THAT(numbers(data), Pointwise(DoubleNear(1e-3), expected));
  EXPECT_THAT(numbers(npy(volumes / "timestamps_us.npy")), ElementsAre(200'000));
  EXPECT_THAT(numbers(npy(volumes / "objframe_idx_2_repr_idx.npy")), ElementsAre(0));
  const ZipArchive labels(drive / "labels_v2/labels.npz");
  EXPECT_THAT(records(labels.read("labels.npy"), {"t", "x"}),
              ElementsAre(ElementsAre(200'000), ElementsAre(1)));
}

}  // namespace
}  // namespace eventgan
