// Every input that is kept, good or bad, through every reader: it is read or refused, nothing else.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <span>

#include "stages/base/archives/cdf_matrix.h"
#include "stages/base/archives/mat_json.h"
#include "stages/base/images/image_file.h"
#include "stages/frames/decoding/index_mask.h"
#include "stages/frames/events/recording_labels.h"
#include "stages/frames/own_labels/detail/coco_entry.h"
#include "stages/frames/own_labels/detail/csv_labels.h"
#include "stages/frames/own_labels/detail/mot_labels.h"
#include "stages/frames/own_labels/detail/voc_labels.h"
#include "stages/frames/own_labels/yolo_text.h"
#include "stages/generator/checkpoints/checkpoint.h"
#include "stages/generator/safetensors.h"
#include "stages/recordings/readers/detail/aedat3_recording.h"
#include "stages/recordings/readers/detail/aedat4_recording.h"
#include "stages/recordings/readers/detail/prophesee_recording.h"
#include "stages/recordings/readers/detail/rosbag_recording.h"
#include "stages/recordings/readers/detail/table_recording.h"
#include "tests/fuzz/readers.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using Reader = void (*)(std::span<const std::uint8_t>, const std::filesystem::path&);

class FuzzCorpus : public ::testing::TestWithParam<Reader> {};

INSTANTIATE_TEST_SUITE_P(
    Readers, FuzzCorpus,
    ::testing::Values(testing::read_checkpoint_input, testing::read_zip_pickle_input,
                      testing::read_safetensors_input, testing::read_mat_input,
                      testing::read_cdf_input, testing::read_voc_input, testing::read_mot_input,
                      testing::read_csv_input, testing::read_coco_input, testing::read_yolo_input,
                      testing::read_mask_input, testing::read_png_input, testing::read_table_input,
                      testing::read_aedat3_input, testing::read_aedat4_input,
                      testing::read_prophesee_input, testing::read_rosbag_input));

TEST_P(FuzzCorpus, IsReadOrRefused) {
  const testing::TemporaryFolder folder;
  const std::filesystem::path corpus =
      std::filesystem::path(EVENTGAN_SOURCE_DIR) / "tests" / "fuzz" / "corpus";
  int inputs = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(corpus)) {
    if (!entry.is_regular_file()) continue;
    const std::string bytes = testing::read_file(entry.path());
    const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data());
    EXPECT_NO_THROW(GetParam()({data, bytes.size()}, folder / "input")) << entry.path();
    ++inputs;
  }
  EXPECT_GE(inputs, 10);
}

/// Else every input might be refused at its first byte, and nothing behind it be tried.
TEST(FuzzCorpusSeeds, AreReadWhereTheyAreSound) {
  const std::filesystem::path corpus =
      std::filesystem::path(EVENTGAN_SOURCE_DIR) / "tests" / "fuzz" / "corpus";
  for (const char* name : {"zip", "legacy"}) {
    EXPECT_FALSE(read_checkpoint(corpus / "checkpoint" / name, "gen").empty()) << name;
  }
  const std::string bytes = testing::read_file(corpus / "safetensors" / "two");
  EXPECT_FALSE(parse_safetensors(bytes, "two").tensors.empty());
  for (const char* name : {"plain", "big_endian", "compressed"}) {
    const MatVariable release = read_mat_variable(corpus / "mat" / name, "RELEASE");
    EXPECT_EQ(
        mat_to_json(release.array).dump(),
        R"({"annolist":[{"name":"a.jpg","x":[1,2.5]},{"name":"b","x":[]}],"img_train":[true,false]})")
        << name;
  }
  for (const char* name : {"plain", "big_endian", "packed_values", "packed_file"}) {
    const TypedArray pose = read_cdf_matrix(corpus / "cdf" / name, "Pose");
    EXPECT_EQ(pose.shape, (std::vector<std::size_t>{2, 3})) << name;
    EXPECT_EQ(std::get<std::vector<float>>(pose.values), (std::vector<float>{0, 1, 2, 3, 4, 5}))
        << name;
  }
  const auto labels = [&](const char* name) {
    return testing::read_file(corpus / std::filesystem::path(name));
  };
  EXPECT_FALSE(is_fault(parse_voc_labels(labels("voc/two"), 1, "two")));
  EXPECT_EQ(parse_mot_labels(labels("mot/two"), {}, "two").size(), 2u);
  EXPECT_EQ(parse_mot_sequence(labels("mot/seqinfo"), "seqinfo").frames_per_second, 30);
  EXPECT_EQ(parse_csv_labels(labels("csv/three"), "three").size(), 3u);
  const std::pair<const char*, int> entries[] = {// and how many rings each has
                                                 {"persons", 0},
                                                 {"polygons", 2},
                                                 {"runs", 1},
                                                 {"text", 1}};
  for (const auto& [name, rings] : entries) {
    const CocoIndex coco = index_coco(InputFile(corpus / "coco" / name), name);
    ASSERT_EQ(coco.annotations.size(), 1u) << name;
    const ByteRange range = coco.annotations[0];
    Annotation annotation;
    add_coco_annotation(
        labels((std::string("coco/") + name).c_str()).substr(range.offset, range.length), 9,
        {30, 40}, coco, coco_schema(coco, name), name, annotation);
    EXPECT_EQ(annotation.persons.size(), name == std::string("persons") ? 1u : 0u);
    EXPECT_EQ(std::ssize(annotation.boxes.at(0).outline.rings), rings) << name;
  }
  EXPECT_EQ(parse_yolo_yaml(labels("yolo/data"), "data").names.joint_names.size(), 17u);
  for (const char* name : {"yolo/boxes", "yolo/mixed"}) {
    EXPECT_FALSE(is_fault(
        parse_yolo_text(labels(name), parse_yolo_classes("a\nb", "classes"), {30, 40}, name)));
  }
  const std::pair<const char*, int> masks[] = {{"grey", 2}, {"palette", 2}, {"wide", 3}};
  for (const auto& [name, objects] : masks) {
    const auto mask = IndexMask::read(corpus / "mask" / name, name);
    ASSERT_FALSE(is_fault(mask)) << mask.fault().reason;
    EXPECT_EQ(std::ssize(mask->indices()), objects) << name;
  }
  const testing::TemporaryFolder folder;
  for (const char* name : {"colours", "average", "palette", "wide", "bits", "interlaced"}) {
    const std::string input = labels((std::string("png/") + name).c_str());
    testing::read_png_input({reinterpret_cast<const std::uint8_t*>(input.data()), input.size()},
                            folder / "image");
    EXPECT_NO_THROW(decode_image_file(folder / "image")) << name;
  }
  for (const char* name : {"plain", "lz4", "zstd"}) {
    const StoredParts parts = open_aedat4(corpus / "aedat4" / name);
    EXPECT_EQ(parts.events->count(), 4) << name;
    EXPECT_EQ(parts.frames->times_s(), (std::vector<double>{6e-6, 10e-6})) << name;
  }
  const StoredParts aedat3 = open_aedat3(corpus / "aedat3" / "plain");
  EXPECT_EQ(aedat3.events->count(), 2);
  for (const char* name : {"plain", "bz2", "lz4", "interrupted"}) {
    const StoredParts parts = open_rosbag(corpus / "rosbag" / name);
    EXPECT_EQ(parts.events->count(), 3) << name;
    EXPECT_EQ(parts.frames->times_s(), std::vector<double>{1.000003}) << name;
  }
  const std::pair<const char*, int> recordings[] = {{"dat", 2}, {"evt2", 2}, {"evt3", 5}};
  for (const auto& [name, count] : recordings) {
    EXPECT_EQ(open_prophesee(corpus / "prophesee" / name).events->count(), count) << name;
  }
}

TEST(FuzzCorpusSeeds, TablesAreReadWhereTheyAreSound) {
  const std::filesystem::path corpus =
      std::filesystem::path(EVENTGAN_SOURCE_DIR) / "tests" / "fuzz" / "corpus" / "table";
  const testing::TemporaryFolder folder;
  RecordingOptions options;
  options.sensor = ImageSize{3, 4};
  for (const char* name : {"fields.npy", "rows.npy", "arrays.npz", "lines.csv"}) {
    std::filesystem::copy_file(corpus / std::filesystem::path(name).stem(), folder / name);
    const auto recording = open_table_recording(folder / name, options);
    EXPECT_EQ(recording->events_in(0, 1),
              (std::vector<Event>{{0, 2, 5e-6, true}, {3, 0, 7e-6, false}}))
        << name;
  }
  std::filesystem::copy_file(corpus / "boxes", folder / "boxes.npy");
  EXPECT_EQ(read_recording_labels(folder / "boxes.npy").annotations.size(), 1u);
}

}  // namespace
}  // namespace eventgan
