#include "stages/shards/shard_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <cmath>
#include <functional>
#include <limits>
#include <thread>
#include <utility>

#include "manifests/files/sha256.h"
#include "stages/base/hdf5/hdf5.h"
#include "stages/shards/shard_reader.h"
#include "tests/stages/shards/example_shard.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;
using testing::texts_with;

const ShardContents kShard{
    {2, 0, 1}, {0, 0, 1}, {{"Car", 2}, {"Van", 1}}, {{1, 2}, {3, 1}}, {"/labels/poses/camera"}};

TEST(ContentsFaults, AreNoneIfAllIsTheSame) {
  EXPECT_THAT(contents_faults(kShard, kShard), IsEmpty());
  EXPECT_THAT(contents_faults({}, {}), IsEmpty());
}

TEST(ContentsFaults, SayWhatTheCommitRecordHasAndWhatTheShardHas) {
  ShardContents record = kShard;
  record.boxes = {1, 1, 1};
  EXPECT_THAT(contents_faults(record, kShard),
              ElementsAre("expected number of boxes in slot 0: 1, got 2"));
  record = kShard;
  record.persons = {0, 0};
  EXPECT_THAT(contents_faults(record, kShard),
              ElementsAre("expected number of slots with a count of persons 2, got 3"));
  record = kShard;
  record.classes["Car"] = 1;
  EXPECT_THAT(contents_faults(record, kShard),
              ElementsAre("expected boxes by class Car: 1, Van: 1, got Car: 2, Van: 1"));
}

TEST(ContentsFaults, AreAllTold) {
  EXPECT_THAT(contents_faults({}, kShard),
              ElementsAre("expected number of slots with a count of boxes 0, got 3",
                          "expected number of slots with a count of persons 0, got 3",
                          "expected boxes by class none, got Car: 2, Van: 1",
                          "expected samples by gap none, got 1: 2, 3: 1",
                          "expected optional columns none, got /labels/poses/camera"));
}

class ShardCheck : public ::testing::Test {
 protected:
  void write(const testing::ExampleShard& example) {
    record_ = write_shard(folder_.path(), example);
    shard_ = folder_ / record_.shard;
  }

  /// Changes the file with HDF5 itself and makes the commit record agree again, as if a faulty
  /// program had written both.
  void change(const std::function<void(hid_t)>& work) {
    const hid_t file = H5Fopen(shard_.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    ASSERT_GE(file, 0);
    work(file);
    ASSERT_GE(H5Fclose(file), 0);
    record_.sha256 = sha256_of_file(shard_);
    record_.size_bytes = static_cast<std::int64_t>(std::filesystem::file_size(shard_));
  }

  /// Overwrites all numbers of a dataset.
  template <class Number>
  void overwrite(const char* path, hid_t type, const std::vector<Number>& numbers) {
    change([&](hid_t file) {
      const hid_t dataset = H5Dopen2(file, path, H5P_DEFAULT);
      ASSERT_GE(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()), 0);
      H5Dclose(dataset);
    });
  }

  std::vector<std::string> faults() {
    const std::vector<std::string> found = check_shard(shard_, record_);
    EXPECT_THAT(found, Each(StartsWith(shard_.string() + ": ")));
    return found;
  }

  testing::TemporaryFolder folder_;
  std::filesystem::path shard_;
  CommitRecord record_;
};

TEST_F(ShardCheck, SoundShardsHaveNoFaults) {
  for (const StoredType type : {StoredType::kFloat32, StoredType::kFloat16, StoredType::kUint8}) {
    write(testing::example_shard(type));
    EXPECT_THAT(faults(), IsEmpty());
  }
  write(testing::unlabelled_shard());
  EXPECT_THAT(faults(), IsEmpty());
}

TEST_F(ShardCheck, VolumesThatDoNotFitFloat16OrVanishInItAreSoundIfMarked) {
  testing::ExampleShard example = testing::example_shard(StoredType::kFloat16);
  example.volumes[0][2] = 1e6f;  // in the place of another that was not zero
  example.samples[0].statistics.max = 1e6f;
  write(example);
  EXPECT_THAT(faults(), IsEmpty());
  example = testing::example_shard(StoredType::kFloat16);
  VolumeStatistics& statistics = example.samples[0].statistics;
  example.volumes[0].assign(example.volumes[0].size(), 1e-9f);
  const double half = static_cast<double>(example.volumes[0].size()) / 2;
  statistics = {1e-9f, 1e-9f, 1, half * 1e-9, half * 1e-9, 0};
  write(example);  // marks it
  EXPECT_THAT(faults(), IsEmpty());
  overwrite<std::uint32_t>("/events/statistics/flags", H5T_NATIVE_UINT32, {0, 1, 0, 0, 0});
  EXPECT_THAT(faults(), Contains(HasSubstr("the flag \"vanished\"")));
}

TEST_F(ShardCheck, AValueOutsideTheGeneratedTilesIsAFault) {
  write(testing::example_shard(StoredType::kFloat16));
  std::vector<std::uint8_t> tiles(5 * 4, 1);
  tiles[1] = 0;  // of sample 0: rows 0-3, columns 4-7
  overwrite("/events/tiles", H5T_NATIVE_UINT8, tiles);
  overwrite<float>("/events/statistics/generated_fraction", H5T_NATIVE_FLOAT, {0.75f, 1, 0, 1, 1});
  EXPECT_THAT(faults(), texts_with({{"zeros outside the tiles", "(sample 0, 000000)"}}));
  overwrite<std::uint32_t>("/events/statistics/flags", H5T_NATIVE_UINT32, {kFlagNoise, 1, 0, 0, 0});
  EXPECT_THAT(faults(), IsEmpty()) << "noise is everywhere";
}

TEST_F(ShardCheck, AThresholdIsANumberAboveZero) {
  write(testing::example_shard());
  for (const double wrong : {0.0, -0.2, HUGE_VAL}) {
    overwrite<double>("/pairs/threshold", H5T_NATIVE_DOUBLE, {NAN, NAN, NAN, NAN, wrong});
    EXPECT_THAT(faults(), texts_with({"expected a finite threshold > 0"}));
  }
}

TEST_F(ShardCheck, FlowLeadsFromPixelToPixel) {
  const testing::ExampleShard sound = testing::example_shard();
  const auto found = [&](const std::function<void(PixelFlow&)>& change) {
    testing::ExampleShard example = sound;
    change(example.samples[4].flow);
    write(example);
    return faults();
  };
  // The first row's flow leads half a column back, so that its first pixel has none to lead to.
  EXPECT_THAT(found([](PixelFlow& flow) { flow.valid[0] = 1; }),
              texts_with({{"expected valid flow to lead to a place in the volume", "000004"}}));
  EXPECT_THAT(found([](PixelFlow& flow) { flow.valid[9] = 2; }),
              texts_with({"expected flow_valid of 0 or 1"}));
  EXPECT_THAT(found([](PixelFlow& flow) { flow.px.back() = 2.5f; }), IsEmpty()) << "not valid";
  write(sound);
  std::vector<float> px(5 * 2 * 6 * 8);
  px.back() = HUGE_VALF;
  overwrite("/labels/flow", H5T_NATIVE_FLOAT, px);
  EXPECT_THAT(faults(), texts_with({{"expected finite flow", "000004"}}));
  write(sound);
  change([](hid_t file) { H5Ldelete(file, "/labels/flow_valid", H5P_DEFAULT); });
  EXPECT_THAT(faults(), Contains(HasSubstr("expected both flow and flow_valid or neither")));
}

TEST_F(ShardCheck, NormalizedVolumesAreSound) {
  testing::ExampleShard example = testing::example_shard(StoredType::kFloat32);
  example.header.normalization = Normalization::kEta98;
  // Statistics are of the volume as generated, here twice as large as it is stored.
  for (std::size_t slot : {0u, 3u, 4u}) {
    float& eta98 = example.samples[slot].statistics.eta98;
    eta98 = 0.5f;
    for (float& value : example.volumes[slot]) value = std::min(value, eta98) / eta98;
  }
  write(example);
  EXPECT_THAT(faults(), IsEmpty());
}

TEST_F(ShardCheck, AFlippedBitAnywhereIsFound) {
  write(testing::example_shard());
  const std::string bytes = testing::read_file(shard_);
  for (std::size_t i = 0; i < bytes.size(); i += 997) {
    std::string flipped = bytes;
    flipped[i] = static_cast<char>(flipped[i] ^ 4);
    testing::write_file(shard_, flipped);
    ASSERT_THAT(faults(), texts_with({"expected SHA-256 " + record_.sha256})) << i;
  }
}

TEST_F(ShardCheck, CountsOfTheCommitRecordAreComparedWithTheRows) {
  write(testing::example_shard());
  EXPECT_THAT(count_faults(shard_, record_), IsEmpty());
  const CommitRecord sound = record_;
  const auto found = [&](const std::function<void(CommitRecord&)>& change) {
    record_ = sound;
    change(record_);
    return count_faults(shard_, record_);
  };
  // Rows of the example's five samples: boxes 2 0 0 1 0, persons 2 0 0 0 1; slot 2 in quarantine.
  EXPECT_THAT(found([](auto& record) { record.contents.persons[4] = 2; }),
              ElementsAre("expected number of persons in slot 4: 1, got 2"));
  EXPECT_THAT(
      found([](auto& record) { std::swap(record.contents.boxes[0], record.contents.boxes[1]); }),
      ElementsAre("expected number of boxes in slot 0: 2, got 0"));
  EXPECT_THAT(found([](auto& record) {
                record.contents.gaps = {{3, 5}};
              }),
              ElementsAre("expected samples by gap 2: 5, got 3: 5"));
  EXPECT_THAT(found([](auto& record) { record.quarantined[0].slot = 1; }),
              ElementsAre("expected the 1 samples with valid = 0 as quarantined, got others"));
  EXPECT_THAT(found([](auto& record) { record.quarantined[0].sample_id = "x"; }),
              ElementsAre("expected the 1 samples with valid = 0 as quarantined, got others"));
}

TEST_F(ShardCheck, SeveralAtATimeFindTheSame) {
  write(testing::example_shard());
  change([](hid_t file) {
    const hid_t dataset = H5Dopen2(file, "/events/statistics/max", H5P_DEFAULT);
    const float wrong[] = {9, 9, 9, 9, 9};
    H5Dwrite(dataset, H5T_NATIVE_FLOAT, H5S_ALL, H5S_ALL, H5P_DEFAULT, wrong);
    H5Dclose(dataset);
  });
  const std::vector<std::string> alone = faults();
  EXPECT_EQ(alone.size(), 4u);
  std::vector<std::vector<std::string>> found(4);
  std::vector<std::thread> threads;
  for (auto& mine : found) {
    threads.emplace_back([&] {
      for (int i = 0; i < 20; ++i) mine = check_shard(shard_, record_);
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_THAT(found, Each(alone));
}

TEST_F(ShardCheck, ATruncatedMissingOrOtherFileIsFound) {
  write(testing::example_shard());
  std::filesystem::resize_file(shard_, 1000);
  EXPECT_THAT(faults(), texts_with({"expected size in bytes " + std::to_string(record_.size_bytes) +
                                    ", got 1000"}));
  std::filesystem::remove(shard_);
  EXPECT_THAT(faults(), texts_with({"No such file"}));
  write(testing::example_shard());
  testing::write_file(shard_, "not HDF5");
  record_.size_bytes = 8;
  record_.sha256 = sha256_hex("not HDF5");
  EXPECT_THAT(faults(), texts_with({"cannot open"}));
}

TEST_F(ShardCheck, ACommitRecordOfOtherCountsOrRowsIsFound) {
  write(testing::example_shard());
  record_.plan_hash = std::string(64, 'c');
  record_.samples = 6;
  EXPECT_THAT(faults(), AllOf(Contains(HasSubstr("expected plan hash cccc")),
                              Contains(HasSubstr("expected number of samples 6, got 5"))));
  record_.shard = "demo-train-00001-of-00002.h5";
  EXPECT_THAT(faults(), Contains(HasSubstr("expected file name demo-train-00001-of-00002.h5")));
  write(testing::example_shard());
  record_.valid = 5;
  EXPECT_THAT(faults(), texts_with({"expected number of valid samples 5, got 4"}));
  record_.valid = 4;
  record_.quarantined[0].slot = 1;
  EXPECT_THAT(faults(), texts_with({"those that the commit record lists"}));
  write(testing::example_shard());
  record_.contents.boxes[0] = 1;
  record_.contents.persons[4] = 2;
  record_.contents.classes["Car"] = 1;
  record_.contents.gaps = {{1, 5}};
  record_.contents.optional_columns.clear();
  EXPECT_THAT(faults(), texts_with({"boxes in slot 0", "persons in slot 4", "boxes by class",
                                    "samples by gap 1: 5", "optional columns none"}));
}

/// Puts another attribute of the same name in the place of a root's.
template <class Value>
void replace(hid_t file, const char* name, const Value& value) {
  const Hdf5Lock lock;
  const Hdf5Handle root = open_object(file, "/");
  ASSERT_GE(H5Adelete(root, name), 0);
  write_attribute(root, name, value);
}

using Names = std::vector<std::string>;

const Names kFeatures{"tiles",        "times",    "origin",     "motion",       "threshold",
                      "projection",   "flow",     "difficulty", "outlines",     "object_motion",
                      "person_boxes", "joints3d", "camera",     "joint_aliases"};

TEST_F(ShardCheck, FeaturesAreThoseOfTheColumns) {
  write(testing::example_shard());
  EXPECT_EQ(ShardReader(shard_).header().features, kFeatures);
  Names less = kFeatures;
  less.erase(less.begin());
  change([&](hid_t file) { replace(file, "features", less); });
  EXPECT_THAT(faults(), texts_with({{"expected features tiles, times", "got times, origin"}}));
  write(testing::unlabelled_shard());
  EXPECT_THAT(ShardReader(shard_).header().features, ElementsAre("times", "origin"));
}

TEST_F(ShardCheck, AnotherMinorVersionIsSoundAndItsUnknownFeaturesAreNamedOnce) {
  write(testing::example_shard());
  Names more = kFeatures;
  more.insert(more.begin(), "masks");
  change([&](hid_t file) {
    replace(file, "features", more);
    replace(file, "format_version", std::string("1.7"));
  });
  ::testing::internal::CaptureStderr();
  EXPECT_THAT(faults(), IsEmpty());
  EXPECT_EQ(ShardReader(shard_).header().features, more);
  EXPECT_EQ(
      ::testing::internal::GetCapturedStderr(),
      "warning: demo-train-00000-of-00001.h5: has \"masks\", which this program does not know "
      "and leaves out\n");
}

TEST_F(ShardCheck, AnotherMajorVersionAndMissingDatasetsAreFound) {
  write(testing::example_shard());
  change([&](hid_t file) { replace(file, "format_version", std::string("2.0")); });
  EXPECT_THAT(
      faults(),
      texts_with(
          {R"(expected format_version "1.0" (this program reads versions 1.x), got "2.0")"}));
  write(testing::example_shard());
  change([](hid_t file) {
    H5Ldelete(file, "/pairs/gap_s", H5P_DEFAULT);
    H5Ldelete(file, "/labels/poses/visible", H5P_DEFAULT);
  });
  EXPECT_THAT(faults(), texts_with({"/pairs/gap_s", "/labels/poses/visible"}));
}

/// Puts an empty dataset in the place of another.
void replace(hid_t file, const char* path, hid_t type, std::vector<hsize_t> dims) {
  H5Ldelete(file, path, H5P_DEFAULT);
  const hid_t space = H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr);
  H5Dclose(H5Dcreate2(file, path, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
  H5Sclose(space);
}

TEST_F(ShardCheck, WrongShapesAndTypesAreFound) {
  write(testing::example_shard());
  change([](hid_t file) {
    replace(file, "/valid", H5T_STD_U8LE, {6});
    replace(file, "/labels/boxes/xyxy", H5T_IEEE_F64LE, {3, 5});
    replace(file, "/labels/boxes/outline", H5T_IEEE_F64LE, {3});
    replace(file, "/labels/poses/scale", H5T_IEEE_F32LE, {3});
  });
  EXPECT_THAT(faults(),
              texts_with({"expected shape [3, 4] of /labels/boxes/xyxy, got [3, 5]",
                          "/labels/boxes/outline", "expected type float64 of /labels/poses/scale",
                          "expected shape [5] of /valid, got [6]"}));
}

TEST_F(ShardCheck, OffsetsThatDoNotAscendToTheRowsAreFound) {
  // Right: 0 2 2 2 3 3.
  write(testing::example_shard());
  overwrite<std::int64_t>("/labels/boxes/offsets", H5T_NATIVE_INT64, {0, 2, 1, 2, 3, 3});
  EXPECT_THAT(faults(), texts_with({"expected /labels/boxes/offsets to ascend from 0"}));
  overwrite<std::int64_t>("/labels/boxes/offsets", H5T_NATIVE_INT64, {1, 2, 2, 2, 3, 3});
  EXPECT_THAT(faults(), texts_with({"expected /labels/boxes/offsets to ascend from 0"}));
  overwrite<std::int64_t>("/labels/boxes/offsets", H5T_NATIVE_INT64, {0, 2, 2, 2, 3, 4});
  EXPECT_THAT(faults(),
              Contains(HasSubstr("expected shape [4, 4] of /labels/boxes/xyxy, got [3, 4]")));
}

TEST_F(ShardCheck, MotionsOfNoStillAreFound) {
  write(testing::example_shard());
  const double none = std::nan("");
  std::vector<double> motions(20, none);
  motions[16] = 1;  // slot 4, the still: one number alone
  overwrite("/pairs/motion", H5T_NATIVE_DOUBLE, motions);
  EXPECT_THAT(faults(), texts_with({{"expected finite numbers in motion", "(sample 4, 000004)"}}));
  motions = std::vector<double>(20, none);
  for (const int slot : {0, 4}) std::fill_n(&motions[4 * slot], 4, slot / 4.0);  // scales 0 and 1
  overwrite("/pairs/motion", H5T_NATIVE_DOUBLE, motions);
  EXPECT_THAT(faults(), texts_with({{"expected a motion of scale > 0", "(sample 0, 000000)"}}));
}

TEST_F(ShardCheck, AStillsBoxIsCutToWhatIsSeenOfTheImage) {
  // 16x12 pixels shifted by 2 down: n = 2 along 12, 2 * 16 / 12 = 2.67, so 3, along 16. What is
  // left, 10x8, is scaled to 8x4 in a letterbox of 8x6: an edge maps as (x - 3) 0.8 and (y - 2) / 2
  // + 1. So 5 1 13 8 becomes 1.6 0.5 8 4, seen from row 1 on.
  testing::ExampleShard example = testing::unlabelled_shard();
  example.header.label_schema.class_names = {"Car"};
  ShardSample& sample = example.samples[0];
  sample.pair.previous = sample.pair.next;
  sample.pair.motion = ImageMotion{.y_px = 2};
  sample.source_to_volume = {0.8, 0, -2.5 * 0.8 - 0.5, 0, 0.5, -1.5 * 0.5 + 0.5};
  sample.annotation.boxes.resize(1);
  sample.annotation.boxes[0].class_id = 0;
  sample.annotation.boxes[0].xyxy = {5, 1, 13, 8};
  sample.labels.boxes = {{{1.6, 1, 8, 4}, {1.6, 0.5, 8, 4}, false, {}}};
  write(example);
  EXPECT_THAT(faults(), IsEmpty());
  sample.labels.boxes[0].clipped.top = 0.5;
  write(example);
  EXPECT_THAT(faults(), texts_with({"xyxy of box 0 to be xyxy_unclipped cut"}));
}

TEST_F(ShardCheck, VolumesWithNanOrOtherValuesAreFound) {
  const testing::ExampleShard example = testing::example_shard(StoredType::kFloat32);
  write(example);
  const std::size_t size = example.header.volume.value_count();
  std::vector<float> all;
  for (const auto& volume : example.volumes) {
    all.insert(all.end(), volume.begin(), volume.end());
    if (volume.empty()) all.resize(all.size() + size);  // quarantined
  }
  std::vector<float> bad = all;
  bad[size / 3] = std::numeric_limits<float>::quiet_NaN();  // slot 0
  bad[size + 5] = -1;                                       // slot 1
  bad[2 * size + 5] = 1;                                    // slot 2, quarantined
  bad[3 * size] += 0.5f;                                    // slot 3
  overwrite("/events/volume", H5T_NATIVE_FLOAT, bad);
  EXPECT_THAT(faults(), texts_with({{"finite", "(sample 0, 000000)"},
                                    {"finite", "(sample 1, 000001)"},
                                    {"expected zeros", "(sample 2, 000002)"},
                                    {"sum of positive", "(sample 3, 000003)"}}));
  overwrite("/events/volume", H5T_NATIVE_FLOAT, all);
  EXPECT_THAT(faults(), IsEmpty());
}

TEST_F(ShardCheck, AnotherScaleIsFound) {
  for (const StoredType type : {StoredType::kFloat32, StoredType::kFloat16, StoredType::kUint8}) {
    write(testing::example_shard(type));
    const std::vector<float> scales = ShardReader(shard_).tables().events.scale;
    for (std::size_t slot = 0; slot < scales.size(); ++slot) {  // 1: all zeros, 2: quarantined
      std::vector<float> changed = scales;
      changed[slot] *= 1.001f;
      overwrite("/events/scale", H5T_NATIVE_FLOAT, changed);
      EXPECT_THAT(faults(), texts_with({{"expected scale ", "(sample " + std::to_string(slot)}}));
    }
    overwrite("/events/scale", H5T_NATIVE_FLOAT, scales);
    EXPECT_THAT(faults(), IsEmpty());
  }
}

TEST_F(ShardCheck, ALostChunkAndLabelsInTheWrongPlaceAreFound) {
  testing::ExampleShard example = testing::example_shard();
  example.volumes[4].assign(example.volumes[4].size(), 0);  // statistics stay those of the full one
  write(example);
  EXPECT_THAT(faults(), texts_with({{"largest value", "(sample 4, 000004)"}}));
  example = testing::example_shard();
  example.samples[0].labels.boxes[0].unclipped.left += 0.5;
  example.samples[0].labels.persons[1].joints[2].y += 0.25;
  example.samples[3].labels.boxes[0].clipped = example.samples[3].labels.boxes[0].unclipped;
  example.samples[4].labels.persons[0].center = {3, 3};
  write(example);
  EXPECT_THAT(faults(), texts_with({"xyxy of box 0 to be", "xyxy_unclipped of box 0 where",
                                    "joints[2] of person 1 where", "xyxy of box 0 to be",
                                    "center of person 0 where"}));
}

TEST_F(ShardCheck, WhatElseSourceToVolumeMapsIsFound) {
  testing::ExampleShard example = testing::example_shard();
  VolumeLabels& labels = example.samples[0].labels;
  labels.projection->at(11) += 1;
  VolumePerson& person = labels.persons[1];
  person.scale += 0.1;
  person.head_box.reset();
  person.box->right += 0.25;
  person.camera->focal_x *= 2;
  write(example);
  EXPECT_THAT(faults(), texts_with({"projection where", "scale_volume of person 1 where",
                                    "head_box of person 1 if there is head_box_source",
                                    "box of person 1 where source_to_volume puts box_source",
                                    "camera of person 1 where"}));
}

TEST_F(ShardCheck, AGeneratedFractionOrAClassThatIsNoneIsFound) {
  write(testing::example_shard());
  // Three of four tiles, nothing of the quarantined sample.
  overwrite<float>("/events/statistics/generated_fraction", H5T_NATIVE_FLOAT,
                   {0.75f, 0.5f, 0, 0.75f, 0.75f});
  EXPECT_THAT(faults(), texts_with({"expected generated_fraction (sample 1, 000001) "
                                    "0.750000, got 0.500000"}));
  write(testing::example_shard());
  overwrite<std::int32_t>("/labels/boxes/class_id", H5T_NATIVE_INT32, {0, 2, -1});
  EXPECT_THAT(faults(), texts_with({"class_id of box 1 to have a name, got 2",
                                    "class_id of box 0 to have a name, got -1",
                                    "expected boxes by class Car: 2, DontCare: 1, got Car: 1"}));
}

TEST_F(ShardCheck, OfAQuarantinedSampleTheSourcesProjectionMayStandAlone) {
  testing::ExampleShard example = testing::example_shard();
  example.samples[2].annotation.projection = example.samples[0].annotation.projection;
  write(example);
  EXPECT_THAT(faults(), IsEmpty());
}

TEST_F(ShardCheck, NanInALabelIsFound) {
  testing::ExampleShard example = testing::example_shard();
  example.samples[0].labels.boxes[1].clipped.top = std::numeric_limits<double>::quiet_NaN();
  write(example);
  EXPECT_THAT(faults(), texts_with({"xyxy of box 1"}));
}

TEST_F(ShardCheck, AnOutlineApartFromItsBoxIsFound) {
  testing::ExampleShard example = testing::example_shard();
  Outline& outline = example.samples[0].labels.boxes[0].outline;  // over [1 1 4.25 4.5]
  outline = {{{{4.25, 0}, {6, 0}, {6, 1}}}};
  write(example);
  EXPECT_THAT(faults(), IsEmpty()) << "it touches it";
  outline = {{{{4.5, 0}, {6, 0}, {6, 1}}}};
  write(example);
  EXPECT_THAT(faults(),
              texts_with({"expected outline of box 0 to lie over xyxy_unclipped, got another "
                          "place (sample 0, 000000)"}));
}

TEST_F(ShardCheck, TextsThatAreNoOutlinesAreFound) {
  for (std::string text : {"x", "[]", "[[1,1,2,2]]", "[[1,1,2,2,3]]", "[[0,0,1,0,nan,1]]",
                           "[[0,0,1,0,1e99,1]]", "[[0,0,1,0,1,1]", "[[0,0,1,0,1,1]] "}) {
    write(testing::example_shard());
    change([&](hid_t file) {
      const hid_t dataset = H5Dopen2(file, "/labels/boxes/outline", H5P_DEFAULT);
      const hid_t type = H5Dget_type(dataset);
      const hvl_t rows[] = {{text.size(), text.data()}, {0, nullptr}, {0, nullptr}};
      EXPECT_GE(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, rows), 0);
      H5Tclose(type);
      H5Dclose(dataset);
    });
    EXPECT_THAT(faults(),
                texts_with({"expected outline of box 0 to be rings of corners as JSON, got "
                            "another text (sample 0, 000000)"}))
        << text;
    EXPECT_TRUE(ShardReader(shard_).sample(0).labels.boxes[0].outline.empty());
  }
}

TEST_F(ShardCheck, InfinityInAnyLabelIsFound) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  constexpr float kFloatInfinity = std::numeric_limits<float>::infinity();
  const std::vector<std::pair<std::string, std::function<void(Annotation&, VolumeLabels&)>>> cases{
      {"xyxy_source of box 0", [](auto& a, auto&) { a.boxes[0].xyxy.left = -kInfinity; }},
      {"xyxy_unclipped of box 0", [](auto&, auto& v) { v.boxes[0].unclipped.right = kInfinity; }},
      {"xyxy of box 0", [](auto&, auto& v) { v.boxes[0].clipped.top = kInfinity; }},
      {"truncation of box 1", [](auto& a, auto&) { a.boxes[1].truncation = kFloatInfinity; }},
      {"alpha of box 0", [](auto& a, auto&) { a.boxes[0].alpha = -kFloatInfinity; }},
      {"box3d of box 0", [](auto& a, auto&) { a.boxes[0].box3d[5] = kFloatInfinity; }},
      {"joints_source of person 0",
       [](auto& a, auto&) { a.persons[0].joints[0].at.x = kInfinity; }},
      {"joints of person 0", [](auto&, auto& v) { v.persons[0].joints[1].y = kInfinity; }},
      {"center_source of person 1", [](auto& a, auto&) { a.persons[1].center.y = kInfinity; }},
      {"center of person 1", [](auto&, auto& v) { v.persons[1].center.x = kInfinity; }},
      {"scale of person 1", [](auto& a, auto&) { a.persons[1].scale = kInfinity; }},
      {"scale_volume of person 1", [](auto&, auto& v) { v.persons[1].scale = kInfinity; }},
      {"head_box_source of person 1",
       [](auto& a, auto&) { a.persons[1].head_box->left = kInfinity; }},
      {"head_box of person 1", [](auto&, auto& v) { v.persons[1].head_box->bottom = kInfinity; }},
      {"box_source of person 1", [](auto& a, auto&) { a.persons[1].box->top = kInfinity; }},
      {"box of person 1", [](auto&, auto& v) { v.persons[1].box->top = kInfinity; }},
      {"projection_source", [](auto& a, auto&) { a.projection->at(3) = kInfinity; }},
      {"projection", [](auto&, auto& v) { v.projection->at(3) = kInfinity; }},
      {"joints3d_mm of person 1",
       [](auto& a, auto&) { a.persons[1].joints3d_mm[1]->at(2) = kInfinity; }},
      {"joints3d_mm of person 1",  // half known
       [](auto& a, auto&) {
         a.persons[1].joints3d_mm[0] = {1, 2, std::nan("")};
       }},
      {"camera_source of person 1",
       [](auto& a, auto&) { a.persons[1].camera->focal_x = kInfinity; }},
      {"camera of person 1", [](auto&, auto& v) { v.persons[1].camera->centre_y = kInfinity; }},
      {"camera_distortion of person 1",
       [](auto& a, auto&) { a.persons[1].distortion->p2 = kInfinity; }},
  };
  for (const auto& [column, change] : cases) {
    testing::ExampleShard example = testing::example_shard();
    change(example.samples[0].annotation, example.samples[0].labels);
    write(example);
    EXPECT_THAT(faults(), texts_with({"expected finite numbers in " + column + ", got "}));
  }
}

TEST_F(ShardCheck, LabelsFarAwayAreSound) {
  testing::ExampleShard example = testing::example_shard();
  example.samples[0].annotation.boxes[0].xyxy.right = 3e300;
  example.samples[0].labels.boxes[0].unclipped.right = 1.5e300 * (1 + 1e-15);  // s = 1/2, rounded
  example.samples[0].labels.boxes[0].clipped.right = 8;
  write(example);
  EXPECT_THAT(faults(), IsEmpty());
}

}  // namespace
}  // namespace eventgan
