#include "stages/frames/sources/flow_dataset.h"

#include <cstdint>
#include <vector>

#include "stages/base/images/image_file.h"
#include "stages/frames/sources/open_dataset.h"
#include "tests/stages/frames/frames_fixture.h"

namespace eventgan {
namespace {

/// Images of 2 x 1 of KITTI's left camera, two frames a scene, with flow.
class FlowOfKitti : public FolderTest {
 protected:
  FlowOfKitti() {
    spec_.root = "training/image_2";
    spec_.flow = true;
    spec_.pairs.side = PairSide::kAfter;
    spec_.pairs.gaps = {1};
    for (const char* scene : {"000000", "000001"}) {
      for (const char* frame : {"_10.png", "_11.png"}) {
        images({spec_.root + "/" + scene + frame}, {1, 2});
      }
    }
  }

  /// x = `steps` / 64 px in both pixels, which are known or not.
  void flow(const std::string& name, std::uint16_t steps, std::uint16_t first,
            std::uint16_t second) const {
    const auto x = static_cast<std::uint16_t>(32768 + steps);
    write("training/" + name,
          encode_wide_png({1, 2}, std::vector<std::uint16_t>{x, 32768, first, x, 32768, second}));
  }
  std::unique_ptr<Dataset> open() const { return open_dataset(spec_, folder_.path()); }
  static Outcome<SourceFlow> flow_of(const Dataset& dataset, std::size_t frame = 0) {
    return dataset.flow(dataset.labelled_frames().at(frame).label_key);
  }

  SourceSpec spec_;
};

TEST_F(FlowOfKitti, IsThatOfAllPixelsValidWhereBothImagesShowThem) {
  flow("flow_occ/000000_10.png", 64, 1, 1);
  flow("flow_noc/000000_10.png", 64, 1, 0);
  flow("flow_occ/000001_10.png", 32, 0, 1);
  flow("flow_noc/000001_10.png", 32, 1, 1);
  const auto dataset = open();
  EXPECT_THAT(ids_of(*dataset), ElementsAre("000000_10", "000001_10"));
  EXPECT_THAT(paired(*dataset, 0, {0, 1}),
              ElementsAre("present training/image_2/000000_10.png 10",
                          "present training/image_2/000000_11.png 11"));
  EXPECT_EQ(flow_of(*dataset)->size, (ImageSize{1, 2}));
  EXPECT_EQ(flow_of(*dataset)->flow, (PixelFlow{{1, 1, 0, 0}, {1, 0}}));
  EXPECT_EQ(flow_of(*dataset, 1)->flow, (PixelFlow{{0, 0.5, 0, 0}, {0, 1}}));
  EXPECT_THAT(dataset->annotation_files(),
              ElementsAre("training/flow_noc/000000_10.png", "training/flow_noc/000001_10.png",
                          "training/flow_occ/000000_10.png", "training/flow_occ/000001_10.png"));
  EXPECT_THAT(dataset->notes(), IsEmpty());
}

TEST_F(FlowOfKitti, OneFolderTellsBoth) {
  for (const auto& [folder, other] :
       {std::pair{"flow_occ", "flow_noc"}, std::pair{"flow_noc", "flow_occ"}}) {
    fs::remove_all(at("training/"s + other));
    flow(folder + "/000000_10.png"s, 64, 0, 1);
    const auto dataset = open();
    EXPECT_EQ(flow_of(*dataset)->flow, (PixelFlow{{0, 1, 0, 0}, {0, 1}}));
    EXPECT_THAT(dataset->notes(), Contains("no "s + other + " in training: flow_valid is 1 where " +
                                           folder + " tells flow"));
  }
}

TEST_F(FlowOfKitti, WhatIsNotUsedIsNamed) {
  flow("flow_occ/000000_10.png", 64, 1, 1);
  flow("flow_occ/000002_10.png", 64, 1, 1);
  EXPECT_THAT(open()->notes(),
              ElementsAre("no flow_noc in training: flow_valid is 1 where flow_occ tells flow",
                          "1 image without flow, though another one follows, left out in "
                          "training/image_2: 000001_10",
                          "1 file of flow without a labelled image left out in training: "
                          "flow_occ/000002_10.png"));
}

TEST_F(FlowOfKitti, LabelledImagesWithoutFlowStay) {
  flow("flow_occ/000000_10.png", 64, 1, 1);
  write("boxes.csv",
        "image,class,left,top,right,bottom\n000000_10.png,a,0,0,1,1\n000001_10.png,a,0,0,1,1\n");
  spec_.labels = LabelSpec{LabelFormat::kCsv, "boxes.csv"};
  const auto dataset = open();
  EXPECT_THAT(ids_of(*dataset), ElementsAre("000000_10", "000001_10"));
  EXPECT_TRUE(flow_of(*dataset, 1)->flow.empty());
  EXPECT_FALSE(is_fault(flow_of(*dataset, 1)));
  EXPECT_THAT(annotation_of(*dataset, 1).boxes, SizeIs(1));
  EXPECT_THAT(dataset->notes(), Contains("1 image without flow, though another one follows, taken "
                                         "for the labels in training/image_2: 000001_10"));
}

TEST_F(FlowOfKitti, OneMapWhereThereShouldBeTwoIsAFault) {
  flow("flow_occ/000000_10.png", 64, 1, 1);
  flow("flow_noc/000001_10.png", 64, 1, 1);
  const auto dataset = open();
  EXPECT_EQ(fault_of(flow_of(*dataset)),
            "expected flow_noc/000000_10.png, as there is another one, got none, in training");
  EXPECT_EQ(fault_of(flow_of(*dataset, 1)),
            "expected flow_occ/000001_10.png, as there is another one, got none, in training");
}

TEST_F(FlowOfKitti, LeadsToTheImageOfTheNextNumber) {
  flow("flow_occ/000000_10.png", 64, 1, 1);
  flow("flow_occ/000001_10.png", 64, 1, 1);
  fs::rename(at("training/image_2/000000_11.png"), at("training/image_2/000000_12.png"));
  fs::rename(at("training/image_2/000001_11.png"), at("training/image_2/000001_13.png"));
  EXPECT_EQ(fault_of(flow_of(*open())),
            "expected the image after training/image_2/000000_10.png, whose flow there is, got "
            "training/image_2/000000_12.png, in training");
}

TEST_F(FlowOfKitti, ADamagedFileIsItsSamplesFault) {
  flow("flow_occ/000000_10.png", 64, 1, 1);
  write("training/flow_noc/000000_10.png", "no PNG");
  EXPECT_THAT(fault_of(flow_of(*open())), AllOf(StartsWith("expected a PNG, got"),
                                                EndsWith(", in training/flow_noc/000000_10.png")));
  write("training/flow_noc/000000_10.png", encode_wide_png({2, 1}, std::vector<std::uint16_t>(6)));
  EXPECT_EQ(fault_of(flow_of(*open())),
            "expected flow of 2x1 as in training/flow_occ/000000_10.png, got 1x2, in "
            "training/flow_noc/000000_10.png");
}

TEST_F(FlowOfKitti, IsOfTheLeftCamera) {
  flow("flow_occ/000000_10.png", 64, 1, 1);
  fs::rename(at("training/image_2"), at("training/image_3"));
  spec_.root = "training/image_3";
  EXPECT_THROWS(open(), UsageError, "expected images of KITTI's left camera (image_2, image_0",
                "got \"flow\" of others, in training/image_3");
}

TEST_F(FlowOfKitti, IsAskedForInVain) {
  EXPECT_THROWS(open(), InputError,
                "expected flow_occ/NAME.png or flow_noc/NAME.png of the images, got of none of the "
                "4, in training");
}

}  // namespace
}  // namespace eventgan
