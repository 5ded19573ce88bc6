#include "pipeline/conversion/sample_stages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <new>
#include <stdexcept>

#include "stages/events/volume_statistics.h"
#include "stages/shards/codec/quantization.h"
#include "stages/shards/codec/volume_codec.h"
#include "tests/testing/fake_dataset.h"
#include "tests/testing/fake_generator.h"
#include "tests/testing/image_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

/// Two frames of 6x4: 51 and 102 of 255, so x = (0.2 - 0.5) 2 = -0.6 and -0.2, a change of 0.4
/// everywhere.
class SampleStagesTest : public ::testing::Test {
 protected:
  SampleStagesTest() {
    testing::write_flat_image(folder_ / "clip" / "0000.png", {4, 6}, 51);
    testing::write_flat_image(folder_ / "clip" / "0001.png", {4, 6}, 102);
    auto dataset = std::make_unique<testing::FakeDataset>("clip", 2);
    dataset_ = dataset.get();
    datasets_.push_back(std::move(dataset));
    manifest_.directory = folder_.path();
    manifest_.sources.resize(1);
    manifest_.output.dtype = StoredType::kFloat32;
    shard_ = {"s.h5", 0, {4, 6}, {}};
    shard_.samples = {
        {"0001", "sequence", "1", {{"clip/0000.png", 0}, {"clip/0001.png", 1}, 1, 1, 1.0}, ""}};
  }

  SampleMessage run() {
    const SampleStages stages(manifest_, datasets_, generator_, 1);
    SampleMessage message;
    message.shard = &shard_;
    stages.read(message);
    stages.generate(message);
    stages.finish(message);
    return message;
  }

  /// Seed, dataset and sample's id decide what is stored; neither the shard nor other sources do.
  void expect_that_key_decides() {
    const std::vector<std::byte> chunk = run().chunk;
    shard_.samples.insert(shard_.samples.begin(), shard_.samples[0]);
    EXPECT_EQ(run().chunk, chunk) << "another shard";
    manifest_.sources.emplace(manifest_.sources.begin())->dataset = DatasetKind::kMpii;
    datasets_.insert(datasets_.begin(), std::make_unique<testing::FakeDataset>("other", 2));
    shard_.source = 1;
    EXPECT_EQ(run().chunk, chunk) << "another source before it";
    shard_.samples[0].sample_id = "0002";
    EXPECT_NE(run().chunk, chunk);
    shard_.samples[0].sample_id = "0001";
    manifest_.seed = 1;
    EXPECT_NE(run().chunk, chunk);
    manifest_.seed = 0;
    manifest_.sources[1].dataset = DatasetKind::kMpiiList;
    EXPECT_NE(run().chunk, chunk);
  }

  /// What is stored of it, in float32.
  std::vector<float> volume(const SampleMessage& message) {
    EXPECT_FALSE(message.failed()) << message.sample.fault;
    std::vector<float> volume(VolumeShape{9, shard_.volume_size}.value_count());
    EXPECT_TRUE(decode_volume(message.chunk, StoredType::kFloat32, 1, 1, volume));
    return volume;
  }

  testing::TemporaryFolder folder_;
  JobManifest manifest_;
  testing::FakeDataset* dataset_;
  std::vector<std::unique_ptr<Dataset>> datasets_;
  testing::FakeGenerator generator_;
  PlannedShard shard_;
};

TEST_F(SampleStagesTest, MakesAWholeSample) {
  const SampleMessage message = run();
  ASSERT_FALSE(message.failed()) << message.sample.fault;
  EXPECT_EQ(message.sample.sample_id, "0001");
  EXPECT_EQ(message.sample.annotation.original, "label 1");
  EXPECT_EQ(message.sample.source_size, (ImageSize{4, 6}));
  ASSERT_EQ(message.sample.labels.boxes.size(), 1u);
  EXPECT_EQ(message.sample.labels.boxes[0].clipped, (Rectangle{1, 1, 3, 2}));
  // The fake: 0.4 (b + 1)/9 in each positive channel; the sum over 24 pixels and 9 bins is 0.4 x 24
  // x 5 = 48.
  EXPECT_NEAR(message.sample.statistics.sum_positive, 48.0, 1e-4);
  EXPECT_EQ(message.sample.statistics.sum_negative, 0.0);
  EXPECT_NEAR(message.sample.statistics.max, 0.4, 1e-6);
  EXPECT_NEAR(message.sample.statistics.nonzero_fraction, 0.5, 1e-6);
  EXPECT_FALSE(message.chunk.empty());
  for (const Stage stage : {Stage::kRead, Stage::kGenerate, Stage::kFinish}) {
    EXPECT_GT(message.seconds[static_cast<std::size_t>(stage)], 0.0);
  }
}

/// A camera of 4x2 pixels, whose windows are what they are set to.
class CameraDataset final : public Dataset {
 public:
  const LabelSchema& label_schema() const override { return schema_; }
  const std::vector<LabelledFrame>& labelled_frames() const override { return frames_; }
  PairedFrame paired_frame(const LabelledFrame&, int) const override { return {}; }
  ImageSize sensor_size(const std::string&) const override { return {2, 4}; }
  Outcome<EventWindow> events(const std::string&) const override {
    if (!fault.empty()) return SampleFault{fault};
    return EventWindow{{2, 4}, window};
  }
  Outcome<Annotation> annotation(const std::string&) const override {
    Annotation annotation;
    annotation.boxes = {{.class_id = 0, .xyxy = {1, 0, 3, 1}, .difficulty = 2}};
    return annotation;
  }
  std::string label_place(const std::string&) const override { return "cars.csv"; }
  std::vector<std::string> annotation_files() const override { return {}; }

  std::vector<Event> window;
  std::string fault;

 private:
  LabelSchema schema_;
  std::vector<LabelledFrame> frames_;
};

class CameraStagesTest : public SampleStagesTest {
 protected:
  CameraStagesTest() {
    auto camera = std::make_unique<CameraDataset>();
    camera_ = camera.get();
    datasets_[0] = std::move(camera);
    manifest_.sources[0].dataset = DatasetKind::kRecording;
    manifest_.generator.kind = GeneratorKind::kEvents;
    shard_.volume_size = {2, 4};
    const double unknown = std::nan("");
    shard_.samples = {{"r/1", "r", "r/1", {{"r.h5", 0, 0, unknown}, {"r.h5", 1, 1, unknown}}, ""}};
  }

  CameraDataset* camera_;
};

TEST_F(CameraStagesTest, MakesTheVolumeOfTheCamerasEvents) {
  // t* = 8 (t - 1) / 2: 0 at 1 s; 4 at 2 s; 8 at 3 s.
  camera_->window = {{0, 0, 1, true}, {1, 1, 2, false}, {1, 1, 2, false}, {3, 1, 3, true}};
  const SampleMessage message = run();
  ASSERT_FALSE(message.failed()) << message.sample.fault;
  std::vector<float> expected(18 * 8, 0.0f);
  expected[0] = 1;                    // bin 0 of the positive ones, row 0, column 0
  expected[(9 + 4) * 8 + 4 + 1] = 2;  // bin 4 of the negative ones, row 1, column 1
  expected[8 * 8 + 4 + 3] = 1;        // bin 8 of the positive ones, row 1, column 3
  EXPECT_EQ(volume(message), expected);
  EXPECT_EQ(generator_.calls(), 0);
  EXPECT_EQ(message.sample.statistics.flags, 0u);
  EXPECT_EQ(message.sample.statistics.sum_negative, 2);
  // The window is of so many events, which tell its times.
  EXPECT_EQ(message.sample.pair.previous.time_s, 1);
  EXPECT_EQ(message.sample.pair.next.time_s, 3);
  EXPECT_EQ(message.sample.labels.boxes.at(0).clipped, (Rectangle{1, 0, 3, 1}));
}

TEST_F(CameraStagesTest, TimesThatThePlanKnowsStay) {
  camera_->window = {{0, 0, 1, true}};
  shard_.samples[0].pair.previous.time_s = 0.5;
  shard_.samples[0].pair.next.time_s = 1.5;
  const SampleMessage message = run();
  EXPECT_EQ(message.sample.pair.previous.time_s, 0.5);
  EXPECT_EQ(message.sample.pair.next.time_s, 1.5);
  EXPECT_EQ(volume(message)[0], 1);  // one event: t* = 0
}

TEST_F(CameraStagesTest, AWindowWithoutEventsIsEmptyAndValid) {
  const SampleMessage message = run();
  ASSERT_FALSE(message.failed()) << message.sample.fault;
  EXPECT_EQ(message.sample.statistics.flags, kFlagEmpty);
  EXPECT_THAT(volume(message), ::testing::Each(0.0f));
}

TEST_F(CameraStagesTest, GeometryIsThatOfFrames) {
  manifest_.image.size =
      shard_.volume_size = {8, 8};  // letterboxed: by 2, two rows above and below
  manifest_.image.fit = ImageFit::kLetterbox;
  camera_->window = {{3, 1, 1, true}};
  const SampleMessage message = run();
  ASSERT_FALSE(message.failed()) << message.sample.fault;
  // (3.5 x 2, 1.5 x 2 + 2) = (7, 5).
  const std::vector<float> values = volume(message);
  EXPECT_EQ(values[5 * 8 + 7], 1);
  EXPECT_EQ(std::ranges::count(values, 0.0f), std::ssize(values) - 1);
  EXPECT_EQ(message.sample.labels.boxes.at(0).clipped, (Rectangle{2, 2, 6, 4}));
}

TEST_F(CameraStagesTest, TimeRunsOverTheWindowWhateverACropLeaves) {
  manifest_.image.size = shard_.volume_size = {2, 2};  // a column less on either side
  manifest_.image.fit = ImageFit::kCrop;
  camera_->window = {{0, 0, 1, true}, {1, 1, 2, true}, {2, 0, 2.5, false}, {3, 1, 5, true}};
  const SampleMessage message = run();
  ASSERT_FALSE(message.failed()) << message.sample.fault;
  // t* = 8 (t - 1) / 4: 2 at 2 s, 3 at 2.5 s.
  std::vector<float> expected(18 * 4, 0.0f);
  expected[2 * 4 + 2] = 1;        // positive, row 1, column 1 - 1
  expected[(9 + 3) * 4 + 1] = 1;  // negative, row 0, column 2 - 1
  EXPECT_EQ(volume(message), expected);
  EXPECT_EQ(message.sample.pair.previous.time_s, 1);
  EXPECT_EQ(message.sample.pair.next.time_s, 5);
}

TEST_F(CameraStagesTest, NormalisesAsItDoesGeneratedVolumes) {
  manifest_.volume.normalize = Normalization::kEta98;
  camera_->window = {{0, 0, 1, true}, {0, 0, 1, true}, {1, 0, 1, true}};
  // Of the values 1 and 2 the k = max(int(0.98 x 2), 1) = 1st is 1: both become 1.
  const SampleMessage message = run();
  EXPECT_EQ(volume(message)[0], 1);
  EXPECT_EQ(volume(message)[1], 1);
  EXPECT_EQ(message.sample.statistics.eta98, 1);
}

TEST_F(CameraStagesTest, EventsThatCannotBeReadQuarantineTheSample) {
  camera_->fault = "expected a finite time, got nan, in r.h5 (event 3)";
  const SampleMessage message = run();
  EXPECT_EQ(message.sample.fault, camera_->fault + " (r/1)");
}

TEST_F(SampleStagesTest, LetterboxBordersHoldNoEvents) {
  // 6x4 into 12x12: scaled by 2 to 12x8, 2 rows of border above and below, 1/3 of the volume.
  manifest_.image.size = shard_.volume_size = {12, 12};
  manifest_.image.fit = ImageFit::kLetterbox;
  const SampleMessage message = run();
  ASSERT_FALSE(message.failed()) << message.sample.fault;
  EXPECT_NEAR(message.sample.statistics.nonzero_fraction, 0.5 * 2 / 3, 1e-6);
  EXPECT_NEAR(message.sample.statistics.sum_positive, 0.4 * 96 * 5, 1e-3);
  EXPECT_EQ(message.sample.labels.boxes[0].clipped, (Rectangle{2, 4, 6, 6}));
}

TEST_F(SampleStagesTest, StoresWhatWasGeneratedInItsFrameAndNormalisedIfAsked) {
  manifest_.image.size = shard_.volume_size = {12, 12};
  manifest_.image.fit = ImageFit::kLetterbox;
  for (const Normalization normalization : {Normalization::kNone, Normalization::kEta98}) {
    for (const StoredType type : {StoredType::kUint8, StoredType::kFloat16, StoredType::kFloat32}) {
      manifest_.volume.normalize = normalization;
      manifest_.output.dtype = type;
      const SampleStages stages(manifest_, datasets_, generator_, 1);
      SampleMessage message;
      message.shard = &shard_;
      stages.read(message);
      stages.generate(message);
      std::vector<float> content = message.volume;
      stages.finish(message);
      if (normalization == Normalization::kEta98) content = normalized(std::move(content));
      // 8 rows of 12 pixels a channel, below 2 of 12.
      std::vector<float> expected;
      for (auto row = content.begin(); row != content.end(); row += 8 * 12) {
        expected.resize(expected.size() + 2 * 12);
        expected.insert(expected.end(), row, row + 8 * 12);
        expected.resize(expected.size() + 2 * 12);
      }
      const VolumeCodec codec(type, manifest_.output.deflate_level);
      const EncodedVolume encoded = codec.encode(expected);
      EXPECT_EQ(message.chunk, encoded.chunk);
      EXPECT_EQ(message.sample.scale, encoded.scale);
    }
  }
}

TEST_F(SampleStagesTest, AGapOutsideThoseTrainedOnIsMarkedAsExtrapolated) {
  const auto marked = [&](int gap) {
    shard_.samples[0].pair.gap_frames = gap;
    return (run().sample.statistics.flags & kFlagExtrapolated) != 0;
  };
  EXPECT_FALSE(marked(6)) << "nobody knows what it was trained on";
  generator_.train_on({1, 5});
  EXPECT_FALSE(marked(5));
  EXPECT_TRUE(marked(6));
  generator_.train_on({1, 6});
  EXPECT_FALSE(marked(6));
  generator_.train_on({2, 3});
  EXPECT_TRUE(marked(1));
  EXPECT_FALSE(marked(2));
  EXPECT_TRUE(marked(4));
}

TEST_F(SampleStagesTest, ActivationsBeyondTheCalibratedRangeAreMarked) {
  generator_.saturate(kMostSaturated);
  EXPECT_EQ(run().sample.statistics.flags, 0u);
  generator_.saturate(2 * kMostSaturated);
  EXPECT_EQ(run().sample.statistics.flags, kFlagBeyondCalibration);
}

TEST_F(SampleStagesTest, AStaticPairIsEmptyAndStaysEmptyWhenNormalised) {
  shard_.samples[0].pair.next = shard_.samples[0].pair.previous;
  manifest_.volume.normalize = Normalization::kEta98;
  const SampleMessage message = run();
  ASSERT_FALSE(message.failed());
  EXPECT_EQ(message.sample.statistics.flags, kFlagEmpty);
  EXPECT_EQ(message.sample.statistics.eta98, 0.0f);
}

TEST_F(SampleStagesTest, AThresholdIsDrawnForEachPair) {
  EXPECT_EQ(run().sample.threshold, std::nullopt);
  EXPECT_EQ(generator_.threshold(), 0);
  manifest_.generator.threshold = ThresholdSpec{.range = {0.1, 0.9}};
  const double threshold = run().sample.threshold.value();
  EXPECT_EQ(generator_.threshold(), threshold);
  EXPECT_EQ(threshold, pair_threshold(manifest_.generator, {0, "frames", "0001"}).value().mean);
  shard_.samples[0].sample_id = "0002";
  EXPECT_NE(run().sample.threshold, threshold);
  shard_.samples[0].pair.next.path = "clip/absent.png";
  EXPECT_EQ(run().sample.threshold, std::nullopt) << "no volume, no threshold";
}

/// A generator that gives rates: at each pixel 0.4 (b + 1)/9 / C in each positive channel, 2 / C in
/// all.
class RatesTest : public SampleStagesTest {
 protected:
  RatesTest() { generator_.know({0.1, 0.4}); }  // C = 0.2 unless told

  /// Sums over time of the positive channels, of each pixel.
  std::vector<float> positive_sums(const SampleMessage& message) {
    const std::vector<float> values = volume(message);
    const std::size_t plane = shard_.volume_size.pixel_count();
    std::vector<float> sums(plane);
    for (std::size_t i = 0; i < 9 * plane; ++i) sums[i % plane] += values[i];
    return sums;
  }
};

TEST_F(RatesTest, EventsAreDrawnOfThem) {
  const SampleMessage message = run();
  for (const float sum : positive_sums(message)) EXPECT_NEAR(sum, 10, 1e-4);  // 2 / 0.2, whole
  EXPECT_EQ(message.sample.threshold, std::nullopt) << "the manifest tells none";
  EXPECT_EQ(message.sample.statistics.sum_negative, 0);
  manifest_.generator.threshold = ThresholdSpec{.range = {0.3, 0.3}};
  double all = 0;
  for (const float sum : positive_sums(run())) {
    EXPECT_NEAR(sum, std::round(sum), 1e-4);  // 2 / 0.3 = 6.67: 6 or 7
    EXPECT_NEAR(sum, 6.5, 0.51);
    all += sum;
  }
  EXPECT_NEAR(all, 24 * 2 / 0.3, 5 * std::sqrt(24 * 2 / 9.0));
}

TEST_F(RatesTest, AreStoredAsTheyAreIfAsked) {
  manifest_.generator.sample = false;
  const SampleMessage message = run();
  EXPECT_NEAR(message.sample.statistics.max, 2, 1e-6);
  EXPECT_NEAR(message.sample.statistics.sum_positive, 24 * 10, 1e-3);
  manifest_.generator.threshold = ThresholdSpec{.range = {0.4, 0.4}, .ratio = 0.25};
  EXPECT_NEAR(run().sample.statistics.sum_positive, 24 * 2.0 / 0.8, 1e-3);  // C+ = 0.4 / 0.5
}

TEST_F(RatesTest, EventsFollowFromSeedDatasetAndSampleAlone) { expect_that_key_decides(); }

TEST_F(RatesTest, OfAStillSceneGiveNoEvents) {
  shard_.samples[0].pair.next = shard_.samples[0].pair.previous;
  EXPECT_EQ(run().sample.statistics.flags, kFlagEmpty);
}

TEST_F(RatesTest, OfTilesGiveEventsThereAlone) {
  manifest_.image.size = shard_.volume_size = {24, 40};
  manifest_.generator.scope.scope = Scope::kLabelsOnly;
  manifest_.generator.scope.label_margin_px = 0;
  manifest_.generator.scope.tile_px = 8;
  const SampleMessage message = run();
  const std::vector<float> sums = positive_sums(message);
  ASSERT_EQ(message.sample.tiles.size(), 3u * 5);
  EXPECT_THAT(message.sample.tiles,
              ::testing::AllOf(::testing::Contains(0), ::testing::Contains(1)));
  for (std::size_t i = 0; i < sums.size(); ++i) {
    const std::size_t tile = i / 40 / 8 * 5 + i % 40 / 8;
    ASSERT_NEAR(sums[i], message.sample.tiles[tile] == 1 ? 10 : 0, 1e-4) << i;
  }
}

TEST_F(SampleStagesTest, AStillHasItsFlowIfTheSourceAsksForIt) {
  testing::write_flat_image(folder_ / "clip" / "0001.png", {24, 40}, 51);
  shard_.volume_size = {24, 40};
  manifest_.sources[0].pairs.stills.emplace();
  FramePair& pair = shard_.samples[0].pair;
  pair.previous = pair.next;
  pair.motion = ImageMotion{.x_px = 2};
  EXPECT_TRUE(run().sample.flow.empty());
  manifest_.sources[0].flow = true;
  const SampleMessage message = run();
  ASSERT_FALSE(message.failed()) << message.sample.fault;
  // One row and two columns a side are lost, so that 36 columns become 40.
  const auto expected = static_cast<float>(std::round(2 * 40.0 / 36 * 128) / 128);
  ASSERT_EQ(message.sample.flow.px.size(), 2u * 24 * 40);
  EXPECT_EQ(message.sample.flow.px.front(), expected);
  EXPECT_EQ(message.sample.flow.px.back(), 0);
  EXPECT_EQ(message.sample.flow.valid.size(), 24u * 40);
  shard_.volume_size = {24, 41};
  const SampleMessage failed = run();
  EXPECT_TRUE(failed.failed() && failed.sample.flow.empty());
}

class NoiseTest : public SampleStagesTest {
 protected:
  /// Whether pixels have an event in any channel.
  std::vector<bool> struck() {
    const std::vector<float> values = volume(run());
    std::vector<bool> pixels(shard_.volume_size.pixel_count());
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (values[i] > 0) pixels[i % pixels.size()] = true;
    }
    return pixels;
  }

  void stand_still() { shard_.samples[0].pair.next = shard_.samples[0].pair.previous; }
};

constexpr NoiseSpec kShotNoise{.shot_hz = {1000, 1000}};

TEST_F(NoiseTest, IsAddedOverTheGapOrElseTheDuration) {
  manifest_.generator.noise = kShotNoise;
  const auto events = [&] {
    const VolumeStatistics statistics = run().sample.statistics;
    EXPECT_EQ(statistics.flags, kFlagNoise);
    return statistics.sum_positive + statistics.sum_negative - 48;  // as MakesAWholeSample
  };
  manifest_.generator.duration_s = 0.2;
  EXPECT_NEAR(events(), 1000 * 0.2 * 24, 5 * std::sqrt(4800));
  shard_.samples[0].pair.previous.time_s = 7;
  shard_.samples[0].pair.next.time_s = 8;
  EXPECT_NEAR(events(), 1000 * 1 * 24, 5 * std::sqrt(24000));
  shard_.samples[0].pair.next.time_s = 7;  // a file's times may say anything
  EXPECT_NEAR(events(), 1000 * 0.2 * 24, 5 * std::sqrt(4800));
}

TEST_F(NoiseTest, OfNoRateChangesNoByteAndMakesAStillSceneEventful) {
  const SampleMessage without = run();
  manifest_.generator.noise = NoiseSpec();
  const SampleMessage with = run();
  EXPECT_EQ(with.chunk, without.chunk);
  EXPECT_EQ(with.sample.statistics.flags, 0u);
  stand_still();
  manifest_.generator.noise = kShotNoise;
  const SampleMessage message = run();
  EXPECT_EQ(message.sample.statistics.flags, kFlagNoise);
  for (const float value : volume(message)) ASSERT_EQ(value, std::floor(value));
}

TEST_F(NoiseTest, LeavesTheBordersOfALetterboxEmpty) {
  // As LetterboxBordersHoldNoEvents: 2 rows above and below.
  manifest_.image.size = shard_.volume_size = {12, 12};
  manifest_.image.fit = ImageFit::kLetterbox;
  manifest_.generator.noise = kShotNoise;
  manifest_.generator.duration_s = 1;
  const std::vector<bool> pixels = struck();
  for (std::size_t pixel = 0; pixel < pixels.size(); ++pixel) {
    EXPECT_EQ(pixels[pixel], 24 <= pixel && pixel < 120) << pixel;
  }
}

TEST_F(NoiseTest, CoversWhatTheScopeLeavesOut) {
  manifest_.generator.scope.scope = Scope::kMotion;
  manifest_.image.size = shard_.volume_size = {24, 40};
  stand_still();
  manifest_.generator.noise = kShotNoise;
  const SampleMessage message = run();
  EXPECT_THAT(message.sample.tiles, ::testing::Each(0));
  EXPECT_EQ(generator_.calls(), 0);
  EXPECT_THAT(struck(), ::testing::Each(true));
}

TEST_F(NoiseTest, FollowsFromSeedDatasetAndSampleAlone) {
  manifest_.generator.noise = kShotNoise;
  expect_that_key_decides();
}

TEST_F(NoiseTest, HotPixelsAreThoseOfTheDataset) {
  stand_still();
  manifest_.generator.noise = NoiseSpec{.hot_pixels = {0.3, 0.3}};
  manifest_.generator.duration_s = 10;
  const std::vector<bool> hot = struck();
  shard_.samples[0].sample_id = "0002";
  EXPECT_EQ(struck(), hot);
  manifest_.sources[0].dataset = DatasetKind::kMpii;
  EXPECT_NE(struck(), hot);
  manifest_.sources[0].dataset = DatasetKind::kFrames;
  manifest_.seed = 1;
  EXPECT_NE(struck(), hot);
}

TEST_F(SampleStagesTest, GeneratesWhatTheScopeWants) {
  // 24 x 40: 2 x 3 tiles.
  manifest_.generator.scope.scope = Scope::kMotion;
  manifest_.image.size = shard_.volume_size = {24, 40};
  testing::write_flat_image(folder_ / "clip" / "0000.png", {24, 40}, 51);
  testing::write_flat_image(folder_ / "clip" / "0001.png", {24, 40}, 51);
  const SampleMessage still = run();
  ASSERT_FALSE(still.failed()) << still.sample.fault;
  EXPECT_THAT(still.sample.tiles, ::testing::ElementsAre(0, 0, 0, 0, 0, 0));
  EXPECT_EQ(still.sample.statistics.flags, kFlagEmpty);
  EXPECT_EQ(generator_.calls(), 0);

  testing::write_flat_image(folder_ / "clip" / "0001.png", {24, 40}, 102);
  const SampleMessage moving = run();
  EXPECT_THAT(moving.sample.tiles, ::testing::ElementsAre(1, 1, 1, 1, 1, 1));
  EXPECT_EQ(generator_.calls(), 1);
}

TEST_F(SampleStagesTest, OfTheSameImageTwiceAsksNoGeneratorThatSeesMotionAlone) {
  const auto write = [&](int last_pixel) {
    std::vector<int> pixels(24, 51);
    pixels.back() = last_pixel;
    testing::write_index_image(folder_ / "clip" / "0001.png", {4, 6}, pixels);
  };
  GeneratorSpec network, labels, esim, difference, leak, noise;
  labels.scope.scope = Scope::kLabels;
  esim.kind = GeneratorKind::kEsim;
  difference.kind = leak.kind = noise.kind = GeneratorKind::kDifference;
  leak.sensor.leak_rate_hz = noise.sensor.shot_noise_rate_hz = 0.1;
  for (const auto& [spec, asks] : {std::pair{network, false},
                                   {labels, false},
                                   {esim, true},  // moves the image whatever comes after it
                                   {difference, false},
                                   {leak, true},
                                   {noise, true}}) {
    manifest_.generator = spec;
    write(51);
    const int before = generator_.calls();
    const SampleMessage same = run();
    ASSERT_FALSE(same.failed()) << same.sample.fault;
    EXPECT_EQ(same.same_image, spec.kind != GeneratorKind::kEsim);
    EXPECT_EQ(generator_.calls() - before, asks);
    EXPECT_EQ(same.sample.statistics.flags, kFlagEmpty);
    EXPECT_THAT(volume(same), ::testing::Each(0));
    write(52);
    const SampleMessage other = run();
    EXPECT_FALSE(other.same_image);
    EXPECT_EQ(generator_.calls() - before, asks + 1);
  }
}

/// Gives the same value everywhere, or no memory.
class FlatGenerator final : public Generator {
 public:
  explicit FlatGenerator(float value) : value_(value) {}
  int bins() const override { return 9; }
  GenerationNotes generate(const GeneratorInput&, std::span<float> volume) const override {
    if (value_ < 0) throw std::bad_alloc();
    std::ranges::fill(volume, value_);
    return {};
  }
  std::string description() const override { return "flat"; }

 private:
  float value_;
};

TEST_F(SampleStagesTest, AVolumeThatIsTooFaintForItsTypeIsMarked) {
  // Half steps of 2^-24, halves' smallest number, are 2^-25 = 2.98e-8.
  const auto flags = [&](float value, StoredType type) {
    const FlatGenerator generator(value);
    manifest_.output.dtype = type;
    const SampleStages stages(manifest_, datasets_, generator, 1);
    SampleMessage message;
    message.shard = &shard_;
    stages.read(message);
    stages.generate(message);
    stages.finish(message);
    return message.sample.statistics.flags;
  };
  EXPECT_EQ(flags(2.9e-8f, StoredType::kFloat16), kFlagVanished);
  EXPECT_EQ(flags(3.0e-8f, StoredType::kFloat16), 0u);
  EXPECT_EQ(flags(0, StoredType::kFloat16), kFlagEmpty);
  EXPECT_EQ(flags(2.9e-8f, StoredType::kUint8), 0u);
  EXPECT_EQ(flags(1e-40f, StoredType::kUint8), kFlagVanished);
  EXPECT_EQ(flags(1e-40f, StoredType::kFloat32), 0u);
}

TEST_F(SampleStagesTest, WhereMemoryIsShortTheSampleAndItsFramesAreNamed) {
  const FlatGenerator generator(-1);
  const SampleStages stages(manifest_, datasets_, generator, 1);
  SampleMessage message;
  message.shard = &shard_;
  stages.read(message);
  EXPECT_THROWS(stages.generate(message), std::runtime_error,
                "of 6x4, in clip/0000.png and clip/0001.png (0001)");
}

TEST_F(SampleStagesTest, AFrameThatCannotBeReadKeepsTheOriginalLabel) {
  testing::write_file(folder_ / "clip" / "0000.png", "");
  const SampleMessage message = run();
  EXPECT_TRUE(message.failed());
  EXPECT_THAT(message.sample.fault, ::testing::AllOf(::testing::HasSubstr("clip/0000.png"),
                                                     ::testing::HasSubstr("0001")));
  EXPECT_EQ(message.sample.annotation.original, "label 1");
  EXPECT_TRUE(message.sample.annotation.boxes.empty());
  EXPECT_TRUE(std::isnan(message.sample.source_to_volume[0]));
  EXPECT_EQ(generator_.calls(), 0);
}

TEST_F(SampleStagesTest, AMalformedLabelIsAFault) {
  dataset_->break_annotation(1);
  const SampleMessage message = run();
  EXPECT_TRUE(message.failed());
  EXPECT_EQ(message.sample.fault, "expected a label, got rubbish, in label 1 (0001)");
}

TEST_F(SampleStagesTest, ALabelOutsideTheImageIsAFault) {
  Annotation annotation;
  annotation.original = "far away";
  annotation.boxes.resize(1);
  annotation.boxes[0].xyxy = {100, 100, 120, 120};
  dataset_->set_annotation(1, annotation);
  const SampleMessage message = run();
  EXPECT_TRUE(message.failed());
  EXPECT_EQ(message.sample.annotation.original, "far away");
  EXPECT_THAT(message.sample.fault, ::testing::HasSubstr("in clip/1.txt"));
}

TEST_F(SampleStagesTest, ABoxLeftOutIsAFaultOnlyWhereThePolicyIsFail) {
  Annotation annotation;
  annotation.left_out = {"expected a box within the image, got another, in clip/1.txt:2"};
  dataset_->set_annotation(1, annotation);
  SampleMessage message = run();
  EXPECT_FALSE(message.failed()) << message.sample.fault;
  EXPECT_EQ(message.sample.annotation.left_out, annotation.left_out);
  manifest_.errors.policy = ErrorPolicy::kFail;
  message = run();
  EXPECT_EQ(message.sample.fault, annotation.left_out[0] + " (0001)");
}

TEST_F(SampleStagesTest, AVolumeThatIsNotFiniteIsAFaultThatNamesTheFrames) {
  generator_.fail_on((51 / 255.0f - 0.5f) * 2);
  manifest_.generator.threshold = ThresholdSpec{.range = {0.1, 0.9}};
  const SampleMessage message = run();
  EXPECT_TRUE(message.failed());
  EXPECT_EQ(message.sample.threshold, std::nullopt) << "no volume, no threshold";
  EXPECT_THAT(message.sample.fault, ::testing::AllOf(::testing::HasSubstr("got nan in channel 0"),
                                                     ::testing::HasSubstr("clip/0000.png"),
                                                     ::testing::HasSubstr("clip/0001.png"),
                                                     ::testing::HasSubstr("(0001)")));
  EXPECT_TRUE(message.chunk.empty());
}

TEST_F(SampleStagesTest, AFaultOfThePlanIsPassedOn) {
  shard_.samples[0].fault = "expected a frame, got no file, in clip/0007.png (0001)";
  const SampleMessage message = run();
  EXPECT_TRUE(message.failed());
  EXPECT_EQ(message.sample.fault, shard_.samples[0].fault);
}

TEST_F(SampleStagesTest, AFrameOfAnotherSizeThanPlannedIsAFault) {
  shard_.volume_size = {5, 6};
  EXPECT_THAT(run().sample.fault, ::testing::HasSubstr("expected frames of 6x5, got 6x4"));
}

}  // namespace
}  // namespace eventgan
