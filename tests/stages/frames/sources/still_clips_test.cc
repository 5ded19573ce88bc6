#include "stages/frames/sources/still_clips.h"

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "manifests/values/outlines.h"
#include "stages/frames/decoding/pair_reader.h"
#include "stages/frames/sources/class_numbers.h"
#include "tests/stages/frames/frames_fixture.h"
#include "tests/testing/fake_dataset.h"

namespace eventgan {
namespace {

constexpr ImageSize kStillSize{120, 160};
constexpr ImageSize kFrame{90, 120};  // without 15 rows and 20 columns a side
constexpr int kDark = 30, kFar = 150, kNear = 240;

Box still_object(const Rectangle& box) {
  return {.class_id = 0,
          .xyxy = box,
          .outline = {{{{box.left, box.top},
                        {box.right, box.top},
                        {box.right, box.bottom},
                        {box.left, box.bottom}}}}};
}

/// Two stills of a dark ground and a lighter and a bright square, the brighter one nearer.
class StillClipsTest : public FolderTest {
 protected:
  StillClipsTest() {
    cv::Mat image(kStillSize.height, kStillSize.width, CV_8UC1, cv::Scalar(kDark));
    image(cv::Rect(60, 40, 30, 30)) = kFar;
    image(cv::Rect(80, 55, 25, 30)) = kNear;
    write_stills(image);
    still_.original = "text";
    still_.boxes = {still_object({60, 40, 90, 70}), still_object({80, 55, 105, 85})};
    manifest_.directory = folder_.path();
    manifest_.seed = 11;
    SourceSpec& source = manifest_.sources.emplace_back();
    source.pairs.stills = StillsSpec{.objects = ObjectMotionSpec()};
    source.pairs.clip_frames = 25;
    source.pairs.gaps = {1};
  }

  void write_stills(const cv::Mat& image) const {
    fs::create_directories(at("clip"));
    for (const char* name : {"clip/0000.png", "clip/0001.png"}) {
      cv::imwrite(at(name).string(), image);
    }
  }
  PairSpec& pairs() { return manifest_.sources[0].pairs; }
  void nothing_moves() {
    pairs().stills = StillsSpec{{0, 0}, 0, 0};
    pairs().stills->objects = ObjectMotionSpec{{0, 0}, 0, 0, 0};
  }

  const Dataset& open() {
    auto dataset = std::make_unique<testing::FakeDataset>("clip", 2);
    for (const int i : {0, 1}) dataset->set_annotation(i, still_);
    datasets_.clear();
    datasets_.push_back(std::move(dataset));
    make_clips(manifest_, datasets_);
    number_classes(manifest_.sources, datasets_);
    return *datasets_[0];
  }
  /// Of what the first frame's pair is made.
  MadePair first_pair() {
    const Dataset& dataset = open();
    return *dataset.made_pair(dataset.labelled_frames()[0].label_key);
  }

  /// Both frames of the labelled frame's pair, grey levels.
  std::array<GreyImage, 2> frames(const Dataset& dataset, const LabelledFrame& frame) {
    auto made = *dataset.made_pair(frame.label_key);
    const int first = pairs().side == PairSide::kBefore ? -1 : 0;
    FramePair pair;
    pair.previous = dataset.paired_frame(frame, first).frame;
    pair.next = dataset.paired_frame(frame, first + 1).frame;
    pair.poses = std::move(made.poses);
    const PreparedPair prepared =
        *PairReader(folder_.path(), {}).read(pair, ImageOrientation::kStored, 1, made.boxes);
    EXPECT_EQ(prepared.content, kFrame);
    std::array<GreyImage, 2> both;
    for (std::size_t i = 0; i < prepared.input.size(); ++i) {
      both[i / kFrame.pixel_count()].pixels.push_back(
          static_cast<std::uint8_t>(std::lround((prepared.input[i] / 2 + 0.5f) * 255)));
    }
    for (GreyImage& image : both) image.size = kFrame;
    return both;
  }

  JobManifest manifest_;
  Annotation still_;
  std::vector<std::unique_ptr<Dataset>> datasets_;
};

TEST_F(StillClipsTest, EachStillIsASequenceOfLabelledFrames) {
  manifest_.sources[0].frames_per_second = 10;
  for (const PairSide side : {PairSide::kBefore, PairSide::kAfter}) {
    pairs().side = side;
    const Dataset& dataset = open();
    const auto& all = dataset.labelled_frames();
    ASSERT_EQ(all.size(), 50u);
    EXPECT_TRUE(std::ranges::is_sorted(all, {}, &LabelledFrame::sample_id));
    const int first = side == PairSide::kBefore ? 1 : 0;
    for (int i = 0; i < 25; ++i) {
      const LabelledFrame& frame = all[static_cast<std::size_t>(i)];
      EXPECT_EQ(frame.sequence, all[0].sequence);
      EXPECT_NE(frame.sequence, all[25].sequence);
      EXPECT_EQ(frame.frame.index, first + i);
      EXPECT_DOUBLE_EQ(frame.frame.time_s, (first + i) / 10.0);
      const int step = side == PairSide::kBefore ? -1 : 1;
      const PairedFrame paired = dataset.paired_frame(frame, step);
      EXPECT_EQ(paired.state, PairedFrame::State::kPresent);
      EXPECT_DOUBLE_EQ(paired.frame.time_s, (first + i + step) / 10.0);
      EXPECT_EQ(dataset.made_size(frame.label_key), kFrame);
    }
    EXPECT_EQ(dataset.paired_frame(all[0], -2).state, PairedFrame::State::kBeyond);
    EXPECT_EQ(dataset.paired_frame(all[24], 2).state, PairedFrame::State::kBeyond);
    EXPECT_EQ(dataset.annotation(all[3].label_key)->original, "text");
  }
}

TEST_F(StillClipsTest, LabelsAreWhereTheFrameShowsTheirObjects) {
  pairs().stills->objects->translation_px = {1, 4};
  for (const PairSide side : {PairSide::kBefore, PairSide::kAfter}) {
    pairs().side = side;
    const Dataset& dataset = open();
    int seen = 0, moved = 0;
    Rectangle last;
    for (const LabelledFrame& labelled : dataset.labelled_frames()) {
      SCOPED_TRACE(labelled.sample_id);
      const GreyImage shown = frames(dataset, labelled)[side == PairSide::kBefore ? 1 : 0];
      const Annotation annotation = *dataset.annotation(labelled.label_key);
      for (const Box& box : annotation.boxes) {
        const int level = box.track_id == 0 ? kFar : kNear;
        const GreyImage mask = mask_of(box.outline, kFrame);
        // Far from its edge the label's object is what is seen; edges are a pixel or two soft.
        int wrong = 0, right = 0;
        for (std::size_t i = 0; i < shown.pixels.size(); ++i) {
          const bool is_seen = std::abs(shown.pixels[i] - level) < 25;
          right += is_seen && mask.pixels[i] != 0;
          wrong += is_seen != (mask.pixels[i] != 0);
        }
        const Rectangle& b = box.xyxy;
        EXPECT_EQ(b, bounds(box.outline));
        EXPECT_LE(wrong, 1.5 * 2 * (b.right - b.left + b.bottom - b.top)) << right;
        ++seen;
        if (box.track_id == 1) moved += std::exchange(last, b) != b;
      }
    }
    EXPECT_GT(seen, 60);
    EXPECT_GT(moved, 30);
  }
}

TEST_F(StillClipsTest, OneFrameIsTheSameInBothOfItsPairs) {
  const Dataset& dataset = open();
  const auto& all = dataset.labelled_frames();
  for (const std::size_t i : {0u, 7u, 20u}) {
    EXPECT_EQ(frames(dataset, all[i])[1], frames(dataset, all[i + 1])[0]);
    EXPECT_NE(frames(dataset, all[i])[0], frames(dataset, all[i])[1]);
  }
}

TEST_F(StillClipsTest, ABoxWithoutTrackGetsANumberThatNoOtherHas) {
  pairs().stills = StillsSpec{{0, 0}, 0, 0};
  still_.boxes = {{.xyxy = {40, 40, 60, 60}},
                  {.xyxy = {0, 0, 9, 9}},  // outside of the window
                  {.xyxy = {50, 40, 70, 60}, .track_id = 0},
                  {.xyxy = {60, 40, 80, 60}}};
  const Annotation annotation = annotation_of(open(), 9);
  ASSERT_EQ(annotation.boxes.size(), 3u);
  EXPECT_EQ(annotation.boxes[0].track_id, 1);
  EXPECT_EQ(annotation.boxes[1].track_id, 0);
  EXPECT_EQ(annotation.boxes[2].track_id, 3);
}

TEST_F(StillClipsTest, WithoutMotionLabelsAreTheStillsInTheWindow) {
  pairs().stills = StillsSpec{{0, 0}, 0, 0};
  still_.boxes.push_back({.class_id = 0, .xyxy = {0, 0, 30, 30}, .ignore = true});
  still_.boxes.push_back({.class_id = 0, .xyxy = {0, 0, 19, 19}});    // outside of the window
  still_.boxes.push_back({.class_id = 0, .xyxy = {10, 40, 30, 60}});  // half of it is
  still_.persons.resize(1);
  still_.persons[0].joints = {{{70, 50}, 1}, {kMissingPoint, 0}};
  still_.persons[0].center = {75, 60};
  still_.persons[0].scale = 2;
  const Annotation annotation = annotation_of(open(), 9);
  EXPECT_THAT(rectangles(annotation),
              ElementsAre(Rectangle{40, 25, 70, 55}, Rectangle{60, 40, 85, 70},
                          Rectangle{0, 0, 10, 15}, Rectangle{0, 25, 10, 45}));
  EXPECT_TRUE(annotation.boxes.at(2).ignore);
  EXPECT_FLOAT_EQ(annotation.boxes.at(3).truncation, 0.5f);
  EXPECT_EQ(annotation.boxes[3].track_id, 4);
  ASSERT_EQ(annotation.persons.size(), 1u);
  EXPECT_EQ(annotation.persons[0].joints[0].at, (Point{50, 35}));
  EXPECT_EQ(annotation.persons[0].joints[1].at, kMissingPoint);
  EXPECT_EQ(annotation.persons[0].center, (Point{55, 45}));
  EXPECT_DOUBLE_EQ(annotation.persons[0].scale, 2);
}

TEST_F(StillClipsTest, APersonsScaleGrowsWithTheImageUnlessItIsUnknown) {
  pairs().stills = StillsSpec{{0, 0}, 0, 0.02};
  still_.boxes.clear();
  still_.persons.resize(2);
  for (Person& person : still_.persons) person.joints = {{{80, 60}, 1}};
  still_.persons[1].scale = 2;
  const Annotation annotation = annotation_of(open(), 9);
  ASSERT_EQ(annotation.persons.size(), 2u);
  EXPECT_EQ(annotation.persons[0].scale, -1);
  EXPECT_NE(annotation.persons[1].scale, 2);
}

TEST_F(StillClipsTest, WhatIsCoveredIsToldAndJointsBehindItAreHidden) {
  nothing_moves();
  still_.boxes = {still_object({60, 40, 90, 70}), still_object({60, 45, 90, 75})};
  still_.persons.resize(2);
  for (const std::size_t k : {0u, 1u}) {
    still_.persons[k].box = still_.boxes[k].xyxy;
    still_.persons[k].joints = {{{70, 42}, 1}, {{70, 60}, 1}};
  }
  const Annotation annotation = annotation_of(open());
  EXPECT_THAT(rectangles(annotation),
              ElementsAre(Rectangle{40, 25, 70, 30}, Rectangle{40, 30, 70, 60}));
  EXPECT_EQ(annotation.boxes.at(0).occlusion, 2);  // 5 of 30 rows are seen
  EXPECT_EQ(annotation.boxes.at(1).occlusion, -1) << "as in the still, where it is not annotated";
  EXPECT_EQ(annotation.persons[0].joints[0].visible, 1);
  EXPECT_EQ(annotation.persons[0].joints[1].visible, 0);
  EXPECT_EQ(annotation.persons[1].joints[1].visible, 1);
}

TEST_F(StillClipsTest, KittisDifficultyOcclusionAndTruncationAreThoseOfTheFrame) {
  nothing_moves();
  const struct {
    Rectangle box;  ///< of 30 px height
    int occlusion_in_still, occlusion, difficulty;
    float truncation;
  } cases[] = {
      {{60, 40, 90, 70}, 3, 1, -1, 0},    // a far one half covered: 17 of 30 rows, too low
      {{60, 57, 90, 87}, 1, 1, 1, 0},     // covered nowhere: moderate
      {{10, 40, 30, 70}, 0, 0, 2, 0.5},   // that the frame cuts at x = 20: hard
      {{110, 40, 130, 70}, 3, 3, -1, 0},  // not alone in knowing nothing of its occlusion
  };
  still_.boxes.clear();
  for (const auto& one : cases) {
    Box& box = still_.boxes.emplace_back(still_object(one.box));
    box.occlusion = one.occlusion_in_still;
    box.truncation = 0;
    box.difficulty = 0;
  }
  const auto boxes = [&](DatasetKind dataset) {
    manifest_.sources[0].dataset = dataset;
    return annotation_of(open(), 3).boxes;
  };
  const std::vector<Box> object = boxes(DatasetKind::kKittiObject);
  ASSERT_EQ(object.size(), 4u);
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_EQ(object[k].occlusion, cases[k].occlusion) << k;
    EXPECT_EQ(object[k].difficulty, cases[k].difficulty) << k;
    EXPECT_EQ(object[k].truncation, cases[k].truncation) << k;
  }
  const std::vector<Box> tracking = boxes(DatasetKind::kKittiTracking);
  EXPECT_EQ(tracking.at(2).truncation, 1) << "a level";
  EXPECT_EQ(tracking.at(3).truncation, 0);
  EXPECT_EQ(tracking.at(1).difficulty, 0) << "not KITTI object's: as it is";
}

/// The pixels brighter than `level`, as a rectangle.
Rectangle brighter(const GreyImage& image, int level) {
  Rectangle around{1e9, 1e9, -1, -1};
  for (int y = 0; y < image.size.height; ++y) {
    for (int x = 0; x < image.size.width; ++x) {
      if (image.pixels[static_cast<std::size_t>(y * image.size.width + x)] <= level) continue;
      around = {std::min(around.left, double(x)), std::min(around.top, double(y)),
                std::max(around.right, x + 1.0), std::max(around.bottom, y + 1.0)};
    }
  }
  return around;
}

/// A bright square on noise, whose label has a box alone, `kRoom` px larger on each side.
class CutOutClips : public StillClipsTest {
 protected:
  static constexpr int kRoom = 4;

  CutOutClips() {
    cv::Mat image(kStillSize.height, kStillSize.width, CV_8UC1);
    cv::RNG random(5);
    random.fill(image, cv::RNG::UNIFORM, 10, 60);
    image(cv::Rect(65, 45, 28, 32)) = kNear;
    write_stills(image);
    still_.boxes = {{.class_id = 0, .xyxy = {65 - kRoom, 45 - kRoom, 93 + kRoom, 77 + kRoom}}};
    pairs().stills->objects->rotation_deg = 0;
    pairs().stills->objects->rests = 0;
  }
};

TEST_F(CutOutClips, ABoxAloneMovesWithTheObjectInIt) {
  pairs().stills->objects->translation_px = {2, 3};
  for (const double rests : {0.0, 1.0}) {
    SCOPED_TRACE(rests);
    pairs().stills->rests = rests;
    pairs().stills->rotation_deg = 0;
    const Dataset& dataset = open();
    int seen = 0;
    double left = 1e9, right = -1e9;
    for (const LabelledFrame& labelled : dataset.labelled_frames()) {
      const Annotation annotation = *dataset.annotation(labelled.label_key);
      if (annotation.boxes.empty()) continue;
      const Box& box = annotation.boxes[0];
      EXPECT_TRUE(box.outline.empty()) << "the label has none";
      EXPECT_EQ(box.track_id, 0);
      EXPECT_EQ(box.occlusion, -1);
      const GreyImage shown = frames(dataset, labelled)[1];
      const Rectangle bright = brighter(shown, 140);
      const auto near = [&](double edge, double of_object, double end) {
        // Cut at the frame's border, and within a pixel or two of where the room ends.
        EXPECT_NEAR(edge, std::clamp(of_object, 0.0, end), 2.0) << labelled.sample_id;
      };
      near(box.xyxy.left, bright.left - kRoom, kFrame.width);
      near(box.xyxy.right, bright.right + kRoom, kFrame.width);
      near(box.xyxy.top, bright.top - kRoom, kFrame.height);
      near(box.xyxy.bottom, bright.bottom + kRoom, kFrame.height);
      ++seen;
      left = std::min(left, box.xyxy.left);
      right = std::max(right, box.xyxy.left);
    }
    EXPECT_GT(seen, 30);
    EXPECT_GT(right - left, 5);
  }
}

TEST_F(CutOutClips, IsDoneOnceForAllFramesOfAClip) {
  const Dataset& dataset = open();
  const auto& all = dataset.labelled_frames();
  const auto counts = [&](int i) {
    return dataset.made_pair(all[static_cast<std::size_t>(i)].label_key)->outlines;
  };
  EXPECT_EQ(counts(0), (OutlineCounts{0, 1, 0}));
  fs::remove_all(folder_ / "clip");
  EXPECT_EQ(counts(1), OutlineCounts());
  EXPECT_FALSE(is_fault(dataset.annotation(all[20].label_key))) << "the first still is known";
  EXPECT_TRUE(is_fault(dataset.annotation(all[30].label_key))) << "the second is not";
  const Outcome<Annotation> still = dataset.still_annotation(all[30].label_key);
  ASSERT_FALSE(is_fault(still)) << "which takes no image";
  EXPECT_EQ(still->boxes, still_.boxes);
}

TEST_F(CutOutClips, WhatIsTooSmallIsAnEllipseAndWhatIsIgnoredIsNone) {
  still_.boxes.push_back({.class_id = 0, .xyxy = {30, 30, 42, 40}});
  still_.boxes.push_back({.class_id = 0, .xyxy = {100, 60, 130, 90}, .ignore = true});
  still_.boxes.push_back(still_object({30, 60, 50, 80}));
  const MadePair made = first_pair();
  EXPECT_EQ(made.outlines, (OutlineCounts{1, 1, 1}));
  ASSERT_EQ(made.boxes.size(), 4u);
  EXPECT_FALSE(made.boxes[1].outline.empty());
  EXPECT_TRUE(made.boxes[2].outline.empty());
  EXPECT_EQ(made.boxes[3].outline, still_.boxes[3].outline);
  for (const StillPose& pose : made.poses) {
    ASSERT_EQ(pose.objects.size(), 4u);
    EXPECT_TRUE(pose.objects[1].has_value());
    EXPECT_FALSE(pose.objects[2].has_value());
  }
}

TEST_F(CutOutClips, NothingIsCutOutWhereObjectsDoNotMove) {
  pairs().stills = StillsSpec();
  EXPECT_EQ(first_pair().outlines, OutlineCounts());
  EXPECT_TRUE(first_pair().boxes[0].outline.empty());
}

TEST_F(CutOutClips, TheBoxIsTheLabelsWhereNothingMoves) {
  nothing_moves();
  EXPECT_THAT(rectangles(annotation_of(open(), 3)),
              ElementsAre(Rectangle{41, 26, 77, 66}));  // 20 and 15 px less
}

TEST_F(StillClipsTest, ARiderIsAsVisibleOnHisHorseAsInTheStill) {
  pairs().stills->rests = 1;
  pairs().stills->objects = ObjectMotionSpec{{0.5, 0.8}, 3, 0.04, 0};
  still_.boxes = {still_object({70, 40, 90, 60}), still_object({55, 40, 105, 85})};
  still_.boxes[0].class_id = 1;
  still_.persons.resize(1);
  still_.persons[0].box = still_.boxes[0].xyxy;
  still_.persons[0].joints = {{{80, 50}, 1}};
  const Dataset& dataset = open();
  for (std::size_t i = 0; i < dataset.labelled_frames().size(); ++i) {
    const Annotation annotation = annotation_of(dataset, i);
    ASSERT_EQ(annotation.boxes.size(), 2u) << i;
    EXPECT_EQ(annotation.boxes[0].occlusion, -1);
    EXPECT_EQ(annotation.persons.at(0).joints[0].visible, 1);
  }
}

TEST_F(StillClipsTest, WhatLabelsLostIsToldOnceAClip) {
  still_.left_out = {"a box outside"};
  still_.left_out_at = {1};
  still_.outlines_mended = {"a part without an area"};
  still_.tracks_left_out = {"a track twice"};
  for (const PairSide side : {PairSide::kBefore, PairSide::kAfter}) {
    pairs().side = side;
    const Dataset& dataset = open();
    const auto& all = dataset.labelled_frames();
    for (std::size_t i = 0; i < all.size(); ++i) {
      const Annotation labels = *dataset.annotation(all[i].label_key);
      const bool is_first = i == 0 || i == 25;  // of 25 frames each
      EXPECT_EQ(labels.is_repeat, !is_first) << i;
      EXPECT_EQ(labels.left_out.size(), is_first) << i;
      EXPECT_EQ(labels.outlines_mended.size(), is_first) << i;
      EXPECT_EQ(labels.tracks_left_out.size(), is_first) << i;
      EXPECT_EQ(labels.original, "text");
    }
  }
}

TEST_F(StillClipsTest, ThereIsNothingToBeMadeOfOtherSources) {
  pairs().clip_frames.reset();
  const Dataset& dataset = open();
  EXPECT_EQ(dataset.labelled_frames().size(), 2u);
  const std::string& key = dataset.labelled_frames()[0].label_key;
  EXPECT_TRUE(dataset.made_pair(key)->poses.empty());
  EXPECT_FALSE(dataset.made_size(key));
}

TEST_F(StillClipsTest, AnImageThatIsNotThereIsAFaultOfItsFrames) {
  fs::remove(at("clip/0000.png"));
  const Dataset& dataset = open();
  EXPECT_THAT(fault_of(dataset), HasSubstr("0000.png"));
  EXPECT_TRUE(is_fault(dataset.made_pair(dataset.labelled_frames()[0].label_key)));
}

}  // namespace
}  // namespace eventgan
