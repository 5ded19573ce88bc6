#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "pipeline/folder/source_comparison.h"
#include "tests/stages/shards/example_shard.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
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

}  // namespace
}  // namespace eventgan
