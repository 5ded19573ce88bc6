#include "stages/frames/mpii/mpii_list_dataset.h"

#include <nlohmann/json.hpp>

#include "tests/stages/frames/frames_fixture.h"
#include "tests/stages/frames/mpii/mpii_fixture.h"

namespace eventgan {
namespace {

namespace mat = testing::mat;

class MpiiListDatasetTest : public FolderTest {
 protected:
  MpiiListDatasetTest() {
    spec_.dataset = DatasetKind::kMpiiList;
    spec_.root = "m";
    spec_.annotations = "labels/list.json";
    write("m/images/b.jpg", "image");
    write("labels/list.json", R"([{"image": "b.jpg", "scale": 1}, {"image": "a.jpg", "scale": 2},
                                  {"image": "b.jpg", "scale": 3, "center": [11, 21]}])");
    for (const char* frame : {"v/b/00000003.jpg", "v/b/00000004.jpg", "v/b/00000005.jpg"}) {
      write(frame, frame);
    }
  }
  void write_keyframes() {
    spec_.sequences = "v";
    mat::write_mat(at("mpii_human_pose_v1_sequences_keyframes.mat"), "annolist_keyframes",
                   mat::structs({{{"image", mat::image("b/00000004.jpg")}}}));
  }
  std::unique_ptr<Dataset> open() const { return open_mpii_list_dataset(spec_, folder_.path()); }

  SourceSpec spec_;
};

TEST_F(MpiiListDatasetTest, RowsOfOneImageAreOneSample) {
  const auto dataset = open();
  EXPECT_THAT(ids_of(*dataset), ElementsAre("a", "b"));
  const Annotation annotation = annotation_of(*dataset, 1);
  EXPECT_EQ(annotation.original,
            R"([{"image":"b.jpg","scale":1},{"image":"b.jpg","scale":3,"center":[11,21]}])");
  ASSERT_EQ(annotation.persons.size(), 2u);
  EXPECT_EQ(annotation.persons[0].scale, 1);
  EXPECT_EQ(annotation.persons[1].center, (Point{10, 20}));
  EXPECT_THAT(dataset->annotation_files(), ElementsAre("labels/list.json"));
}

TEST_F(MpiiListDatasetTest, WithoutSequencesThereAreNoPairedFrames) {
  const auto dataset = open();
  EXPECT_THAT(paired(*dataset, 0, {0}), ElementsAre("missing m/images/a.jpg -1"));
  EXPECT_THAT(paired(*dataset, 1, {-1, 0}), ElementsAre("beyond", "present m/images/b.jpg -1"));
  EXPECT_THAT(dataset->notes(), IsEmpty());
}

TEST_F(MpiiListDatasetTest, TheKeyframesFileTellsTheFrame) {
  write_keyframes();
  const auto dataset = open();
  EXPECT_THAT(paired(*dataset, 1, {0, -1}),
              ElementsAre("present v/b/00000004.jpg 4", "present v/b/00000003.jpg 3"));
  EXPECT_THAT(dataset->annotation_files(),
              ElementsAre("labels/list.json", "mpii_human_pose_v1_sequences_keyframes.mat"));
  EXPECT_THAT(dataset->notes(),
              ElementsAre("1 image whose frame is in no sequence, so without neighbours"));
}

TEST_F(MpiiListDatasetTest, WithoutTheKeyframesFileTheBytesTell) {
  spec_.sequences = "v";
  write("m/images/b.jpg", "v/b/00000005.jpg");
  EXPECT_EQ(open()->labelled_frames()[1].frame, (FrameRef{"v/b/00000005.jpg", 5}));
}

TEST_F(MpiiListDatasetTest, LabelsAreInPixelsOfTheFrame) {
  write_keyframes();
  images({"m/images/b.jpg"}, {48, 64}, 100);
  images({"v/b/00000004.jpg"}, {24, 32}, 100);
  const Annotation half = annotation_of(*open(), "b.jpg");
  // 11, 21 counted from 1 are 10, 20; half as large: (10 + 0.5) / 2 - 0.5.
  EXPECT_EQ(half.persons.at(1).center, (Point{4.75, 9.75}));
  EXPECT_DOUBLE_EQ(half.persons.at(1).scale, 1.5);
  EXPECT_THAT(half.original, HasSubstr(R"("scale":3,"center":[11,21])"));
  images({"v/b/00000004.jpg"}, {32, 32}, 100);
  EXPECT_THAT(fault_of(open()->annotation("b.jpg")), HasSubstr("got 32x32, in v/b/00000004.jpg"));
}

TEST_F(MpiiListDatasetTest, AMalformedRowIsAFaultOfItsSampleOnly) {
  write("labels/list.json",
        R"([{"image": "b.jpg"}, {"image": "b.jpg", "scale": "x"}, {"image": "a.jpg"}])");
  const auto dataset = open();
  EXPECT_EQ(fault_of(dataset->annotation("b.jpg")),
            "expected a finite number, got \"x\" at scale of its person 1, in "
            "labels/list.json:b.jpg (sample b)");
  EXPECT_EQ(dataset->label_place("b.jpg"), "labels/list.json:b.jpg");
  EXPECT_FALSE(is_fault(dataset->annotation("a.jpg")));
  EXPECT_TRUE(is_fault(dataset->annotation("c.jpg")));
}

TEST_F(MpiiListDatasetTest, RefusesWhatItCannotOpen) {
  write("labels/list.json", R"([{"image": "b.jpg"}, {"image": "b.png"}])");
  EXPECT_THROWS(open(), InputError, "got b twice");
  spec_.sequences = "absent";
  EXPECT_THROWS(open(), InputError, "absent");
  spec_.annotations.reset();
  EXPECT_THROWS(open(), UsageError, "annotations");
}

/// The same five images in both forms. The table cuts the fractions off (only head joints have
/// any), marks missing joints by (0, 0), and has moved and enlarged the box: y + 15 scale, 1.25
/// scale.
TEST(MpiiListDatasetOnSharedData, ListAndTableAgree) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  SourceSpec spec;
  spec.root = "mpii_lists";
  spec.annotations = "mpii_lists/test_mpii.json";
  const auto list = open_mpii_list_dataset(spec, data);
  spec.annotations = "mpii_lists/valid.h5";
  const auto table = open_mpii_list_dataset(spec, data);
  EXPECT_EQ(list->labelled_frames().size(), 5u);
  EXPECT_EQ(table->labelled_frames().size(), 2729u);  // 2958 people

  int hidden_in_table = 0;
  for (const LabelledFrame& frame : list->labelled_frames()) {
    EXPECT_EQ(list->paired_frame(frame, 0).state, State::kPresent);
    const auto listed = list->annotation(frame.label_key)->persons.at(0);
    const auto tabled = table->annotation(frame.label_key)->persons.at(0);
    for (int i = 0; i < 16; ++i) {
      if (listed.joints[i].at == kMissingPoint) {
        EXPECT_EQ(tabled.joints[i], listed.joints[i]);
        continue;
      }
      EXPECT_EQ(tabled.joints[i].at,
                (Point{std::floor(listed.joints[i].at.x), std::floor(listed.joints[i].at.y)}));
      hidden_in_table += tabled.joints[i].visible == 0;
      EXPECT_EQ(listed.joints[i].visible, 1);  // the list calls hidden joints visible, too
    }
    EXPECT_EQ(tabled.center.x, listed.center.x);
    EXPECT_NEAR(tabled.center.y, listed.center.y + 15 * listed.scale, 1e-4);
    EXPECT_NEAR(tabled.scale, 1.25 * listed.scale, 1e-5);
  }
  EXPECT_EQ(hidden_in_table, 2);
  const auto person = list->annotation("005808361.jpg")->persons.at(0);
  EXPECT_EQ(person.joints[0], (Joint{{803, 710}, 1}));  // 804, 711 in the file
  const auto original = table->annotation("005808361.jpg")->original;
  const auto row = nlohmann::json::parse(original).at(0);
  for (const char* field : {"center", "imgname", "index", "normalize", "part", "person", "scale",
                            "torsoangle", "visible"}) {
    EXPECT_TRUE(row.contains(field)) << field;
  }
}

}  // namespace
}  // namespace eventgan
