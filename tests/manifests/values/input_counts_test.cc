#include "manifests/values/input_counts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(InputCounts, AreToldByKindAndTheFirstReasonsNamed) {
  InputCounts counts;
  counts += {losses_of({}), 0, 0, {}};
  EXPECT_THAT(counts.notes(), IsEmpty());
  Annotation annotation;
  annotation.outlines_mended = {"no area, in a.json (annotation 4)"};
  counts += {losses_of(annotation), 0, 0, {}};
  EXPECT_THAT(counts.notes(),
              ElementsAre("1 outline of labels taken without some of its parts: no area, in a.json "
                          "(annotation 4)"));
  annotation.left_out = {"b", "c"};
  annotation.of_other_classes = 3;
  annotation.outlines_mended = {"d", "e", "f"};
  annotation.tracks_left_out = {"g"};
  counts += {losses_of(annotation), 1, 2, {1, 2, 0}};
  EXPECT_THAT(counts.notes(),
              ElementsAre("2 boxes of labels left out: b; c",
                          "3 boxes of other classes left out (\"classes\")",
                          "4 outlines of labels taken without some of their parts: no area, in "
                          "a.json (annotation 4); d; e; ...",
                          "1 track of labels left out: g",
                          "1 pair of the same image twice: nothing moves there",
                          "2 volumes without any event",
                          "outlines of objects that move on their own: 1 of labels, 2 cut out of "
                          "their boxes, 0 ellipses"));
}

TEST(InputCounts, OfShardsAddUpToThoseOfAllTheirSamples) {
  InputCounts all, sum;
  for (const char* shard : {"a", "b", "c"}) {
    InputCounts of_shard;
    for (const char* sample : {"1", "2"}) {
      Annotation annotation;
      annotation.left_out = annotation.outlines_mended =
          annotation.tracks_left_out = {std::string(shard) + sample};
      annotation.of_other_classes = 1;
      const InputCounts of_sample{losses_of(annotation), 1, 1, {1, 1, 1}};
      all += of_sample;
      of_shard += of_sample;
    }
    sum += of_shard;
  }
  EXPECT_EQ(sum, all);
  EXPECT_EQ(sum.losses.boxes.count, 6);
  EXPECT_THAT(sum.losses.boxes.first, ElementsAre("a1", "a2", "b1"));
}

}  // namespace
}  // namespace eventgan
