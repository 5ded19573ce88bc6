#include "pipeline/dataset/source_comparison.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <cmath>
#include <utility>

#include "manifests/documents/job_manifest.h"
#include "pipeline/conversion/convert.h"
#include "pipeline/folder/output_folder.h"
#include "stages/shards/shard_rows.h"
#include "stages/shards/shard_tables.h"
#include "tests/stages/shards/example_shard.h"
#include "tests/testing/fake_generator.h"
#include "tests/testing/image_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using testing::texts_with;
namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// The example's first sample has two boxes and two persons, its last one person.
class RowDifferences : public ::testing::Test {
 protected:
  RowDifferences() {
    for (const ShardSample& sample : example_.samples) {
      append_row(example_.header, sample, stored_);
    }
  }

  std::vector<std::string> found(const ShardSample& expected, int slot = 0) const {
    return row_differences(example_.header, stored_, slot, expected, "labels/0.txt");
  }

  testing::ExampleShard example_ = testing::example_shard();
  ShardTables stored_;
  ShardSample expected_ = example_.samples[0];
};

TEST_F(RowDifferences, AreNoneIfAllIsTheSame) {
  for (const int slot : {0, 1, 3, 4}) {
    EXPECT_THAT(found(example_.samples[static_cast<std::size_t>(slot)], slot), IsEmpty());
  }
  expected_.labels.boxes[0].clipped.left += 1e-12;  // another compiler's last bits
  EXPECT_THAT(found(expected_), IsEmpty());
  expected_.labels.boxes[0].unclipped.right = 1e300;
  stored_.boxes.xyxy_unclipped[2] = 1e300 * (1 + 1e-15);
  EXPECT_THAT(found(expected_), IsEmpty());
  const float corner = std::nextafter(4.25f, 5.0f);  // of an outline, which has 32 bits
  expected_.labels.boxes[0].outline.rings[0][1].x = corner;
  EXPECT_THAT(found(expected_), IsEmpty());
  const ShardSample& still = example_.samples[4];
  stored_.flow[4 * still.flow.px.size()].bits += 1;  // of 16 bits
  EXPECT_THAT(found(still, 4), IsEmpty());
  stored_.flow[4 * still.flow.px.size()].bits += 1;
  EXPECT_THAT(
      found(still, 4),
      texts_with({"expected 0.5 in /labels/flow according to labels/0.txt, got 0.50097656"}));
}

TEST_F(RowDifferences, AreOfOutlinesThatLieElsewhere) {
  Outline& outline = expected_.labels.boxes[0].outline;
  outline.rings[0][1].x += 1e-5;
  EXPECT_THAT(found(expected_),
              texts_with({" in /labels/boxes/outline of box 0 according to labels/0.txt, "
                          "got 47 bytes"}));
  outline = example_.samples[0].labels.boxes[0].outline;
  outline.rings.pop_back();
  EXPECT_THAT(found(expected_), texts_with({"expected 29 bytes in "}));
  outline = {};
  EXPECT_THAT(found(expected_), texts_with({"expected 0 bytes in "}));
  stored_.boxes.outline.clear();
  EXPECT_THAT(found(expected_), IsEmpty());
}

TEST_F(RowDifferences, OtherBytesAreToldAlone) {
  expected_.annotation.original += "\n";
  expected_.annotation.boxes.clear();
  expected_.labels.boxes.clear();
  EXPECT_THAT(found(expected_),
              ElementsAre("expected the annotation as it is in labels/0.txt, got other bytes"));
}

TEST_F(RowDifferences, NameTheColumnAndBothValues) {
  expected_.annotation.boxes[1].track_id = 8;
  expected_.annotation.persons[0].joints[1].at.x = 5.5;
  expected_.labels.persons[1].head_box.reset();
  expected_.sequence = "drive_7";
  EXPECT_THAT(
      found(expected_),
      ElementsAre(
          R"(expected "drive_7" in /pairs/sequence according to the plan, got "drive_0")",
          "expected 8 in /labels/boxes/track_id of box 1 according to labels/0.txt, got -1",
          "expected 5.5 in /labels/poses/joints_source of person 0 according to labels/0.txt, got "
          "5",
          "expected -1 in /labels/poses/head_box of person 1 according to labels/0.txt, got 0.5"));
}

TEST_F(RowDifferences, AnotherNumberOfLabelsIsTold) {
  expected_.annotation.boxes.pop_back();
  expected_.labels.boxes.pop_back();
  expected_.annotation.persons.clear();
  expected_.labels.persons.clear();
  EXPECT_THAT(found(expected_), ElementsAre("expected 1 box, as in labels/0.txt, got 2",
                                            "expected 0 persons, as in labels/0.txt, got 2"));
}

TEST_F(RowDifferences, AreOfColumnsThatTheShardLacksToo) {
  stored_.projection.clear();
  stored_.pairs.subject.clear();
  stored_.poses.box.clear();
  EXPECT_THAT(
      found(expected_),
      ElementsAre(
          "expected \"S1\" in /pairs/subject according to the plan, got \"\"",
          "expected 350 in /labels/projection according to labels/0.txt, got nan",
          "expected 1.75 in /labels/poses/box of person 1 according to labels/0.txt, got nan"));
}

void change(std::string& text) { text += "x"; }
void change(std::vector<char>& bytes) { bytes.push_back('x'); }
void change(Half& number) { number = {}; }
template <class Number>
void change(Number& number) {
  number = number == number ? static_cast<Number>(number + 1) : 1;  // NaN: there was none
}

TEST_F(RowDifferences, AreFoundInEveryColumnThatTheGeneratorDoesNotMake) {
  std::vector<std::string> paths;
  visit_columns(stored_, example_.header,
                [&](const ColumnSpec& spec, const auto&) { paths.emplace_back(spec.path); });
  const ShardTables sound = stored_;
  for (const std::string& path : paths) {
    if (path.starts_with("/events/")) continue;
    stored_ = sound;
    visit_columns(stored_, example_.header, [&](const ColumnSpec& spec, auto& column) {
      if (spec.path != path) return;
      ASSERT_FALSE(column.empty()) << path << ": the example has no value";
      change(column[spec.rows == Rows::kOffsets ? 1 : 0]);
    });
    if (path == "/labels/original") {
      EXPECT_THAT(found(expected_), texts_with({"got other bytes"})) << path;
    } else if (path.ends_with("/offsets")) {
      EXPECT_THAT(found(expected_), texts_with({", as in labels/"})) << path;
    } else {
      EXPECT_THAT(found(expected_), texts_with({" in " + path})) << path;
    }
  }
}

TEST(SchemaFaults, NameTheListThatIsAnother) {
  const LabelSchema source{.class_names = {"Car", "Van"},
                           .joint_names = {"neck", "wrist"},
                           .joint_aliases = {"Neck", "Hand"}};
  EXPECT_THAT(schema_faults(source, source), IsEmpty());
  LabelSchema stored = source;
  stored.class_names.pop_back();  // the source has gained one
  EXPECT_THAT(schema_faults(stored, source), IsEmpty());
  for (auto list :
       {&LabelSchema::class_names, &LabelSchema::joint_names, &LabelSchema::joint_aliases}) {
    stored = source;
    std::swap((stored.*list)[0], (stored.*list)[1]);
    EXPECT_THAT(schema_faults(stored, source),
                ElementsAre(AllOf(HasSubstr(fmt::format(" of the source, {}, got {}",
                                                        fmt::join(source.*list, ", "),
                                                        fmt::join(stored.*list, ", "))))));
  }
  stored = source;
  stored.class_names.emplace_back("Tram");  // the source has it no more
  EXPECT_THAT(schema_faults(stored, source),
              ElementsAre("expected the class_names of the source, Car, Van, got Car, Van, Tram"));
}

/// Three KITTI images with a car each, converted into one shard; the image of sample 2 was
/// broken.
class SourceComparisonTest : public ::testing::Test {
 protected:
  SourceComparisonTest() {
    for (int i = 0; i < 3; ++i) {
      testing::write_flat_image(image(i), {24, 36}, 10 + i);
      testing::write_flat_image(kitti_ / "prev_2" / ("00000" + std::to_string(i) + "_01.png"),
                                {24, 36}, 90);
      write_label(i, "3.5");
    }
    testing::write_file(image(2), "broken");
    manifest_ = parse_job_manifest(R"({
      "format": "eventgan-manifest", "version": 1, "name": "job",
      "sources": [{ "dataset": "kitti_object", "root": "kitti",
                    "pairs": { "gaps": [1], "side": "before", "choose": "one" } }],
      "image": { "width": 18, "height": 16, "fit": "crop", "preset": "kitti" },
      "generator": { "weights": "untrained:1" }, "output": { "directory": "out" },
      "errors": { "policy": "quarantine", "max_count": 9, "max_fraction": 1 } })",
                                   folder_.path(), "manifest.json");
    ConversionOptions options;
    options.threads = 1;
    convert(manifest_, testing::FakeGenerator(), "weights", options);
    plan_ = read_frozen_plan(folder_ / "out").plan;
  }

  fs::path image(int i) const {
    return kitti_ / "image_2" / ("00000" + std::to_string(i) + ".png");
  }
  fs::path label(int i) const {
    return kitti_ / "label_2" / ("00000" + std::to_string(i) + ".txt");
  }
  void write_label(int i, const std::string& left) const {
    testing::write_file(
        label(i), "Car 0.00 0 -1.58 " + left + " 4 21 17 1.65 1.67 3.64 -0.65 1.71 46.70 -1.59\n");
  }

  std::vector<std::string> faults(long long compared = 2) const {
    SourceComparison comparison(manifest_);
    const ShardReader reader(folder_ / "out/job-train-00000-of-00001.h5");
    const std::vector<std::string> found = comparison.faults(plan_.shards.at(0), reader);
    EXPECT_THAT(comparison.notes(), IsEmpty());
    EXPECT_EQ(comparison.compared(), compared);
    return found;
  }

  testing::TemporaryFolder folder_;
  const fs::path kitti_ = folder_ / "kitti";
  JobManifest manifest_;
  Plan plan_;
};

TEST_F(SourceComparisonTest, NamesTheSampleWhoseAnnotationOrImageIsAnother) {
  EXPECT_THAT(faults(), IsEmpty()) << "as it was just made";
  write_label(1, "3.6");
  EXPECT_THAT(faults(), ElementsAre(AllOf(HasSubstr("kitti/label_2/000001.txt"),
                                          EndsWith("got other bytes (sample 1, 000001)"))));
  testing::write_file(label(0), "Car 0.00\n");
  fs::remove(label(1));
  EXPECT_THAT(faults(),
              ElementsAre(AllOf(HasSubstr("got none: "), EndsWith("(sample 0, 000000)")),
                          AllOf(HasSubstr("got none: "), EndsWith("(sample 1, 000001)"))));
  for (const int i : {0, 1}) write_label(i, "3.5");
  write_label(2, "3.6");  // in quarantine: the bytes that were kept
  EXPECT_THAT(faults(),
              ElementsAre(AllOf(HasSubstr("000002.txt"), EndsWith("(sample 2, 000002)"))));
  fs::remove(label(2));  // not there: nothing to compare with
  EXPECT_THAT(faults(), IsEmpty());
  testing::write_flat_image(image(0), {24, 48}, 10);
  EXPECT_THAT(faults(), ElementsAre("expected a source size of 48x24 as in "
                                    "kitti/image_2/000000.png, got 36x24 (sample 0, 000000)"));
  fs::remove(image(0));
  EXPECT_THAT(faults(), IsEmpty()) << "labels can be compared without images";
}

TEST_F(SourceComparisonTest, NamesTheSampleThatIsNotThePlannedOne) {
  const Plan plan = plan_;
  PlannedSample& first = plan_.shards[0].samples[0];
  std::swap(first, plan_.shards[0].samples[1]);
  EXPECT_THAT(faults(), texts_with({"expected the planned sample 000001, got another",
                                    "expected the planned sample 000000, got another"}));
  first = plan.shards[0].samples[0];
  plan_.shards[0].samples[1] = plan.shards[0].samples[1];
  first.pair.motion = ImageMotion{.x_px = 2};
  EXPECT_THAT(faults(),
              ElementsAre("expected the motion of the plan, got another (sample 0, 000000)"));
  first.pair.motion.reset();
  first.pair.previous.path = "kitti/prev_2/000000_02.png";
  EXPECT_THAT(faults(), texts_with({{"000000_02.png", "000000_01.png"}}));
  first.fault = "expected a frame, got no file";
  EXPECT_THAT(faults(), IsEmpty()) << "a missing frame was added";
  manifest_.image.fit = ImageFit::kStretch;
  EXPECT_THAT(faults(),
              texts_with({"expected source_to_volume of an image of 36x24", "(sample 1, 000001)"}));
}

/// An attribute says what class numbers mean.
TEST_F(SourceComparisonTest, NamesClassesThatAreNotTheSources) {
  const hid_t file =
      H5Fopen((folder_ / "out/job-train-00000-of-00001.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  ASSERT_GE(file, 0);
  const hid_t column = H5Dopen2(file, "/labels/boxes/class_id", H5P_DEFAULT);
  const hid_t attribute = H5Aopen(column, "class_names", H5P_DEFAULT);
  const hid_t type = H5Aget_type(attribute);
  const hid_t space = H5Aget_space(attribute);
  std::vector<char*> names(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space)));
  ASSERT_GE(H5Aread(attribute, type, names.data()), 0);
  std::swap(names[0], names[1]);
  EXPECT_GE(H5Awrite(attribute, type, names.data()), 0);
  H5Dvlen_reclaim(type, space, H5P_DEFAULT, names.data());
  H5Sclose(space);
  H5Tclose(type);
  H5Aclose(attribute);
  H5Dclose(column);
  ASSERT_GE(H5Fclose(file), 0);
  EXPECT_THAT(faults(/*compared=*/0),
              texts_with({{"expected the class_names of the source, Car, Van", "got Van, Car"}}));
}

TEST_F(SourceComparisonTest, ASourceThatIsNotThereIsANoteAndNoFault) {
  fs::remove_all(kitti_);
  SourceComparison comparison(manifest_);
  EXPECT_THAT(comparison.notes(),
              ElementsAre(::testing::StartsWith("labels of source kitti not compared: ")));
  const ShardReader reader(folder_ / "out/job-train-00000-of-00001.h5");
  EXPECT_THAT(comparison.faults(plan_.shards.at(0), reader), IsEmpty());
  EXPECT_EQ(comparison.compared(), 0);
}

}  // namespace
}  // namespace eventgan
