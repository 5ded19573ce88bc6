#include "pipeline/folder/source_comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "manifests/documents/job_manifest.h"
#include "pipeline/conversion/convert.h"
#include "pipeline/folder/output_folder.h"
#include "tests/stages/shards/example_shard.h"
#include "tests/testing/fake_generator.h"
#include "tests/testing/picture_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// The example's first sample has two boxes and two persons.
class LabelDifferences : public ::testing::Test {
 protected:
  LabelDifferences()
      : stored_(testing::example_shard().samples[0]),
        source_(stored_.annotation),
        mapped_(stored_.labels) {}

  std::vector<std::string> found() const {
    return label_differences(stored_, source_, mapped_, "labels/0.txt");
  }

  ShardSample stored_;
  Annotation source_;
  VolumeLabels mapped_;
};

TEST_F(LabelDifferences, AreNoneIfAllIsTheSame) {
  EXPECT_THAT(found(), IsEmpty());
  mapped_.boxes[0].clipped.left += 1e-9;  // another compiler's last bits
  EXPECT_THAT(found(), IsEmpty());
  stored_.labels.boxes[0].unclipped.right = 1e300;
  mapped_.boxes[0].unclipped.right = 1e300 * (1 + 1e-15);
  EXPECT_THAT(found(), IsEmpty());
}

TEST_F(LabelDifferences, OtherBytesAreToldAlone) {
  source_.original += "\n";
  source_.boxes.clear();
  EXPECT_THAT(found(),
              ElementsAre("expected the annotation as it stands in labels/0.txt, got other bytes"));
}

TEST_F(LabelDifferences, AnnotatedNumbersMustBeTheSameExactly) {
  source_.boxes[1].track_id = 8;
  source_.persons[0].joints[1].at.x += 1e-9;
  EXPECT_THAT(found(), ElementsAre("expected box 1 as annotated in labels/0.txt, got another",
                                   "expected person 0 as annotated in labels/0.txt, got another"));
}

TEST_F(LabelDifferences, PlacesInTheVolumeAreCompared) {
  const auto difference = [&](const std::function<void(VolumeLabels&)>& change) {
    mapped_ = stored_.labels;
    change(mapped_);
    return found();
  };
  const std::string box =
      "expected box 0 where labels/0.txt puts it in the volume, got another place";
  const std::string person =
      "expected person 1 where labels/0.txt puts it in the volume, got another place";
  EXPECT_THAT(difference([](auto& m) { m.boxes[0].clipped.right += 1e-3; }), ElementsAre(box));
  EXPECT_THAT(difference([](auto& m) { m.boxes[0].unclipped.top -= 1e-3; }), ElementsAre(box));
  EXPECT_THAT(difference([](auto& m) { m.boxes[0].ignore = true; }), ElementsAre(box));
  EXPECT_THAT(difference([](auto& m) { m.persons[1].joints[2].y += 1; }), ElementsAre(person));
  EXPECT_THAT(difference([](auto& m) { m.persons[1].joints.pop_back(); }), ElementsAre(person));
  EXPECT_THAT(difference([](auto& m) { m.persons[1].center.x = 0; }), ElementsAre(person));
  EXPECT_THAT(difference([](auto& m) { m.persons[1].scale = 2; }), ElementsAre(person));
  EXPECT_THAT(difference([](auto& m) { m.persons[1].head_box.reset(); }), ElementsAre(person));
  EXPECT_THAT(difference([](auto& m) { m.persons[1].head_box->left = 7; }), ElementsAre(person));
  EXPECT_THAT(difference([](auto& m) { m.persons[1].camera->focal_y = 1; }), ElementsAre(person));
}

TEST_F(LabelDifferences, AnotherNumberOfLabelsIsTold) {
  source_.boxes.pop_back();
  mapped_.boxes.pop_back();
  source_.persons.clear();
  mapped_.persons.clear();
  EXPECT_THAT(found(), ElementsAre("expected as many of kind box as in labels/0.txt, 1, got 2",
                                   "expected as many of kind person as in labels/0.txt, 0, got 2"));
}

/// Three KITTI pictures with a car each, converted into one shard; the picture of sample 2 was
/// broken.
class SourceComparisonTest : public ::testing::Test {
 protected:
  SourceComparisonTest() {
    for (int i = 0; i < 3; ++i) {
      testing::write_flat_picture(picture(i), {24, 36}, 10 + i);
      testing::write_flat_picture(kitti_ / "prev_2" / ("00000" + std::to_string(i) + "_01.png"),
                                  {24, 36}, 90);
      write_label(i, "3.5");
    }
    testing::write_file(picture(2), "broken");
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

  fs::path picture(int i) const {
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

TEST_F(SourceComparisonTest, FindsNothingInWhatWasJustMade) { EXPECT_THAT(faults(), IsEmpty()); }

TEST_F(SourceComparisonTest, NamesTheSampleWhoseAnnotationChanged) {
  write_label(1, "3.6");
  EXPECT_THAT(faults(), ElementsAre(AllOf(HasSubstr("kitti/label_2/000001.txt"),
                                          EndsWith("got other bytes (sample 1, 000001)"))));
}

TEST_F(SourceComparisonTest, NamesTheSampleWhoseAnnotationIsGoneOrMalformed) {
  testing::write_file(label(0), "Car 0.00\n");
  fs::remove(label(1));
  EXPECT_THAT(faults(),
              ElementsAre(AllOf(HasSubstr("got none: "), EndsWith("(sample 0, 000000)")),
                          AllOf(HasSubstr("got none: "), EndsWith("(sample 1, 000001)"))));
}

TEST_F(SourceComparisonTest, OfAQuarantinedSampleTheBytesThatWereKeptMustBeRight) {
  write_label(2, "3.6");
  EXPECT_THAT(faults(),
              ElementsAre(AllOf(HasSubstr("000002.txt"), EndsWith("(sample 2, 000002)"))));
  fs::remove(label(2));  // not there: nothing to compare with
  EXPECT_THAT(faults(), IsEmpty());
}

TEST_F(SourceComparisonTest, NamesASampleWhosePictureHasAnotherSize) {
  testing::write_flat_picture(picture(0), {24, 48}, 10);
  EXPECT_THAT(faults(), ElementsAre("expected a source size of 48x24 as of "
                                    "kitti/image_2/000000.png, got 36x24 (sample 0, 000000)"));
  fs::remove(picture(0));
  EXPECT_THAT(faults(), IsEmpty()) << "labels can be compared without pictures";
}

TEST_F(SourceComparisonTest, NamesASampleThatIsNotThePlannedOne) {
  std::swap(plan_.shards[0].samples[0], plan_.shards[0].samples[1]);
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("expected the planned sample 000001, got another"),
                                    HasSubstr("expected the planned sample 000000, got another")));
}

TEST_F(SourceComparisonTest, NamesASampleOfOtherFramesThanPlannedUnlessAHoleWasFilled) {
  plan_.shards[0].samples[0].pair.previous.path = "kitti/prev_2/000000_02.png";
  EXPECT_THAT(faults(), ElementsAre(AllOf(HasSubstr("000000_02.png"), HasSubstr("000000_01.png"))));
  plan_.shards[0].samples[0].fault = "expected a frame, got no file";
  EXPECT_THAT(faults(), IsEmpty());
}

TEST_F(SourceComparisonTest, NamesAPlacementThatTheSettingsDoNotGive) {
  manifest_.image.fit = ImageFit::kStretch;
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("expected source_to_volume of a picture of 36x24"),
                                    HasSubstr("(sample 1, 000001)")));
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
