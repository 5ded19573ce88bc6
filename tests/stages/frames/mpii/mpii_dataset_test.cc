#include "stages/frames/mpii/mpii_dataset.h"

#include <nlohmann/json.hpp>

#include "stages/frames/mpii/detail/mpii_annotations.h"
#include "tests/stages/frames/frames_fixture.h"
#include "tests/stages/frames/mpii/mpii_fixture.h"

namespace eventgan {
namespace {

namespace mat = testing::mat;

class MpiiDatasetTest : public FolderTest {
 protected:
  MpiiDatasetTest() {
    spec_.dataset = DatasetKind::kMpii;
    spec_.root = "m";
    images({"m/images/b.jpg", "m/sequences/b/00000007.jpg"}, {48, 64}, 100);
    write("m/sequences/b/00000008.jpg", "b8");
  }
  void write_four() const {
    mat::write_mpii(at("m"), {{"c.jpg", mat::centre_only(), false, "c/00000001.jpg"},
                              {"b.jpg", mat::two_persons(), true, "b/00000007.jpg"},
                              {"d.jpg", mat::empty(), true, "d/00000001.jpg"},
                              {"a.jpg", mat::two_persons(), true, "a/00000001.jpg"}});
  }
  std::unique_ptr<Dataset> open() const { return open_mpii_dataset(spec_, folder_.path()); }

  SourceSpec spec_;
};

TEST_F(MpiiDatasetTest, TheSplitChoosesByImgTrain) {
  write_four();
  spec_.split = "train";
  EXPECT_THAT(ids_of(*open()), ElementsAre("a", "b"));
  EXPECT_THAT(open()->notes(),
              ElementsAre("1 image without annotation in m/mpii_human_pose_v1_u12_1.mat",
                          "1 annotated image left out, not of split train",
                          "1 annotated image without a sequence folder, so without neighbours"));
  spec_.split = "test";
  EXPECT_THAT(ids_of(*open()), ElementsAre("c"));
  spec_.split = "everything";
  EXPECT_THAT(ids_of(*open()), ElementsAre("a", "b", "c"));
}

TEST_F(MpiiDatasetTest, StillsNeedNoKeyframes) {
  write_four();
  const auto with_keyframes = open();
  fs::remove(at("m/mpii_human_pose_v1_sequences_keyframes.mat"));
  EXPECT_THROWS(open(), InputError, "expected mpii_human_pose_v1_sequences_keyframes.mat");
  spec_.pairs.stills.emplace();
  const auto dataset = open();
  EXPECT_EQ(ids_of(*dataset), ids_of(*with_keyframes));
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("m/mpii_human_pose_v1_u12_1.mat"));
  EXPECT_THAT(paired(*dataset, 1, {0}), ElementsAre("present m/images/b.jpg -1"));
  EXPECT_EQ(annotation_of(*dataset, 1).persons.size(), 2u);
  EXPECT_THAT(annotation_of(*dataset, 1).original, Not(HasSubstr("annolist_keyframes")));
}

TEST_F(MpiiDatasetTest, LabelsStayWithTheirImage) {
  write_four();
  const auto dataset = open();
  EXPECT_EQ(dataset->label_schema().joint_names.size(), kMpiiJointCount);
  EXPECT_THAT(dataset->annotation_files(),
              ElementsAre("m/mpii_human_pose_v1_sequences_keyframes.mat",
                          "m/mpii_human_pose_v1_u12_1.mat"));
  EXPECT_EQ(text_of(dataset->labelled_frames()[1]),
            "b of b: m/sequences/b/00000007.jpg 7 by annolist[1]");
  EXPECT_EQ(dataset->label_place("annolist[1]"), "m/mpii_human_pose_v1_u12_1.mat:annolist[1]");
  EXPECT_THAT(paired(*dataset, 1, {1, 2}),
              ElementsAre("present m/sequences/b/00000008.jpg 8", "beyond"));
  const Annotation annotation = annotation_of(*dataset, 1);
  EXPECT_EQ(nlohmann::json::parse(annotation.original)["image"]["name"], "b.jpg");
  EXPECT_TRUE(annotation.boxes.empty());
  ASSERT_EQ(annotation.persons.size(), 2u);
  // The fixture's numbers less one, and its forms of is_visible: 1, '1', [], 0.
  EXPECT_EQ(annotation.persons[0].joints[0], (Joint{{710, 620}, 1}));
  EXPECT_EQ(annotation.persons[0].joints[1], (Joint{{714.5, 490}, 1}));
  EXPECT_EQ(annotation.persons[0].joints[2], (Joint{{704, 370}, -1}));
  EXPECT_EQ(annotation.persons[0].joints[9], (Joint{{780, 364}, 0}));
  EXPECT_EQ(annotation.persons[1].center, (Point{99, 119}));
  EXPECT_FALSE(annotation.persons[1].head_box);
}

TEST_F(MpiiDatasetTest, AMalformedEntryIsAFaultOfItsSampleOnly) {
  mat::write_mpii(
      folder_ / "m",
      {{"a.jpg", mat::structure({{"annopoints", mat::structure({{"point", mat::number(3)}})}}),
        true, "a/1.jpg"},
       {"b.jpg", mat::two_persons(), true, "b/00000007.jpg"}});
  const auto dataset = open();
  EXPECT_EQ(fault_of(dataset->annotation("annolist[0]")),
            "expected x, y and id, got 3 at annorect[0].annopoints.point[0], in "
            "m/mpii_human_pose_v1_u12_1.mat:annolist[0] (sample a)");
  EXPECT_FALSE(is_fault(dataset->annotation("annolist[1]")));
  EXPECT_TRUE(is_fault(dataset->annotation("annolist[2]")));
}

TEST_F(MpiiDatasetTest, RefusesTwoImagesOfOneName) {
  mat::write_mpii(folder_ / "m", {{"a.jpg", mat::two_persons(), true, ""},
                                  {"a.png", mat::two_persons(), true, ""}});
  EXPECT_THROWS(open(), InputError, "got a twice");
}

TEST_F(MpiiDatasetTest, NotesKeyframesInASequenceOfAnotherName) {
  mat::write_mpii(folder_ / "m", {{"a.jpg", mat::two_persons(), true, "b/00000008.jpg"}});
  write_flat_image(folder_ / "m/images/a.jpg", {48, 64}, 100);
  EXPECT_THAT(open()->notes(),
              ElementsAre("1 keyframe in a sequence not named as its image (first: a.jpg in "
                          "b/00000008.jpg)"));
}

/// images/b.jpg of 64x48, which was annotated, and its frame in another size.
class MpiiFrameOfAnotherSize : public MpiiDatasetTest {
 protected:
  MpiiFrameOfAnotherSize() { write_four(); }
  Outcome<Annotation> annotation_at(ImageSize frame) {
    write_flat_image(folder_ / "m/sequences/b/00000007.jpg", frame, 100);
    return open()->annotation("annolist[1]");
  }
};

TEST_F(MpiiFrameOfAnotherSize, LabelsAreInPixelsOfTheFrame) {
  const auto annotation = *annotation_at({96, 128});
  const Person& person = annotation.persons.at(0);
  // Twice as large: 711, 621 counted from 1 are 710, 620; (710 + 0.5) 2 - 0.5 = 1420.5.
  EXPECT_EQ(person.joints[0], (Joint{{1420.5, 1240.5}, 1}));
  EXPECT_EQ(person.joints[3], (Joint{kMissingPoint, 0}));
  EXPECT_EQ(person.center, (Point{1482.5, 698.5}));               // 742, 350
  EXPECT_EQ(person.head_box, (Rectangle{1410, 102, 1550, 326}));  // edges 705, 51, 775, 163
  EXPECT_DOUBLE_EQ(person.scale, 2 * 3.05);
  EXPECT_EQ(nlohmann::json::parse(annotation.original)["annorect"][0]["scale"], 3.05);
  EXPECT_EQ(annotation.persons.at(1).joints[0].at, kMissingPoint);
  EXPECT_FALSE(annotation.persons.at(1).head_box);
}

TEST_F(MpiiFrameOfAnotherSize, APixelOfRoundingIsNoOtherShape) {
  // 64x48 at 2/3 is 42.7x32: stored as 43x32.
  const auto down = *annotation_at({32, 43});
  EXPECT_DOUBLE_EQ(down.persons.at(0).joints[0].at.x, 710.5 * 43 / 64 - 0.5);
  EXPECT_DOUBLE_EQ(down.persons.at(0).joints[0].at.y, 620.5 * 32 / 48 - 0.5);
  EXPECT_DOUBLE_EQ(down.persons.at(0).scale, 3.05 * std::sqrt(43.0 / 64 * 32 / 48));
  EXPECT_FALSE(is_fault(annotation_at({480, 640})));
}

TEST_F(MpiiFrameOfAnotherSize, AnotherShapeIsAFaultThatNamesBoth) {
  for (const ImageSize size : {ImageSize{48, 80}, ImageSize{64, 48}, ImageSize{32, 46}}) {
    EXPECT_EQ(fault_of(annotation_at(size)),
              "expected a frame of the shape of m/images/b.jpg, 64x48, where it was annotated, "
              "got " +
                  to_string(size) + ", in m/sequences/b/00000007.jpg (sample b)");
  }
}

TEST_F(MpiiFrameOfAnotherSize, WithoutTheImageNothingTells) {
  fs::remove(folder_ / "m/images/b.jpg");
  const auto annotation = *annotation_at({96, 128});
  EXPECT_EQ(annotation.persons.at(0).joints[0].at, (Point{710, 620}));
  spec_.split = "train";
  EXPECT_THAT(open()->notes(),
              Contains(StartsWith("1 labelled frame of a sequence whose image is not in images")));
}

TEST_F(MpiiFrameOfAnotherSize, AnImageThatCannotBeReadIsAFault) {
  write("m/images/b.jpg", "no image");
  EXPECT_THAT(fault_of(annotation_at({48, 64})), HasSubstr("in m/images/b.jpg (sample b)"));
}

TEST(MpiiDatasetOnSharedData, ReadsTheJuggler) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  SourceSpec spec;
  spec.root = (data / "mpii").string();
  spec.split = "all";
  const auto dataset = open_mpii_dataset(spec, "/");
  EXPECT_THAT(ids_of(*dataset), ElementsAre("000000001", "052475643"));
  const LabelledFrame& juggler = dataset->labelled_frames()[0];
  EXPECT_EQ(juggler.frame.path, spec.root + "/sequences/000000001/00000007.jpg");
  // Frames 1..13 are there, 7 is labelled: six on either side.
  for (int step = -6; step <= 6; ++step) {
    const PairedFrame found = dataset->paired_frame(juggler, step);
    EXPECT_EQ(found.state, State::kPresent) << step;
    EXPECT_EQ(found.frame.index, 7 + step);
    EXPECT_TRUE(fs::exists(found.frame.path));
  }
  EXPECT_THAT(paired(*dataset, 0, {7, -7}), Each("beyond"));
  EXPECT_THAT(paired(*dataset, 1, {0, 1}), ElementsAre(StartsWith("present"), "beyond"));

  const Annotation annotation = annotation_of(*dataset);
  ASSERT_EQ(annotation.persons.size(), 2u);
  const Person& person = annotation.persons[0];
  EXPECT_EQ(person.joints[0], (Joint{{710, 620}, 1}));         // x 711, y 621, is_visible 1
  EXPECT_EQ(person.joints[1].visible, 1);                      // '1'
  EXPECT_EQ(person.joints[2].visible, -1);                     // []
  EXPECT_EQ(person.joints[3].visible, 0);                      // 0
  EXPECT_EQ(person.center, (Point{741, 349}));                 // 742, 350
  EXPECT_EQ(person.head_box, (Rectangle{705, 51, 775, 163}));  // 706, 52, 776, 164
  EXPECT_EQ(annotation.persons[1].joints, std::vector<Joint>(16, Joint{kMissingPoint, 0}));
  const auto original = nlohmann::json::parse(annotation.original);
  const auto& points = original["annorect"][0]["annopoints"]["point"];
  EXPECT_EQ(points[1]["is_visible"], "1");
  EXPECT_EQ(points.size(), 16u);
  EXPECT_EQ(original["act"]["act_name"], "soccer, juggling");
  EXPECT_EQ(original["annolist_keyframes"]["image"]["name"], "000000001/00000007.jpg");
}

}  // namespace
}  // namespace eventgan
