#include "pipeline/training/sample_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <map>
#include <numeric>
#include <stdexcept>
#include <string>

#include "manifests/values/faults.h"
#include "pipeline/runtime/errors.h"
#include "pipeline/training/generator_records.h"
#include "stages/base/images/image_file.h"
#include "stages/events/simulation/moving_planes.h"
#include "stages/generator/torch/torch_generator.h"
#include "stages/generator/weights.h"
#include "stages/generator/weights_file.h"
#include "tests/pipeline/training/fake_training_recording.h"
#include "tests/stages/generator/engine_trials.h"
#include "tests/testing/fake_recording.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

constexpr int kDraws = 4000;

TrainingManifest drawing_manifest() {
  TrainingManifest manifest;
  manifest.seed = 11;
  manifest.crop = {16, 16};
  manifest.gaps = {1, 3};
  return manifest;
}

std::vector<TrainingRecording> long_and_short() {
  std::vector<TrainingRecording> recordings;
  recordings.push_back(testing::opened(testing::moving_bar_recording({20, 30}, 9), 3));
  recordings.push_back(testing::opened(testing::moving_bar_recording({16, 16}, 3), 1));
  return recordings;
}

SampleDraw draw(const std::vector<TrainingRecording>& recordings, const TrainingManifest& manifest,
                std::int64_t step, int index = 0, int attempt = 0) {
  return draw_sample(recordings, manifest, {TrainingPhase::kGenerator, step, index}, attempt);
}

bool same(const SampleDraw& a, const SampleDraw& b) {
  return a.recording == b.recording && a.first_frame == b.first_frame &&
         a.last_frame == b.last_frame && a.augmentation.top == b.augmentation.top &&
         a.augmentation.left == b.augmentation.left &&
         a.augmentation.flip_x == b.augmentation.flip_x &&
         a.augmentation.flip_y == b.augmentation.flip_y;
}

TEST(DrawSample, DependsOnSeedAndPlaceAlone) {
  const auto recordings = long_and_short();
  TrainingManifest manifest = drawing_manifest();
  int differ_by_index = 0, differ_by_phase = 0, differ_by_seed = 0;
  TrainingManifest other = manifest;
  other.seed = 12;
  for (std::int64_t step = 0; step < 50; ++step) {
    const SampleDraw first = draw(recordings, manifest, step);
    EXPECT_TRUE(same(first, draw(recordings, manifest, step)));
    differ_by_index += !same(first, draw(recordings, manifest, step, 1));
    differ_by_seed += !same(first, draw(recordings, other, step));
    differ_by_phase +=
        !same(first, draw_sample(recordings, manifest, {TrainingPhase::kFlow, step, 0}, 0));
  }
  EXPECT_GT(differ_by_index, 40);
  EXPECT_GT(differ_by_phase, 40);
  EXPECT_GT(differ_by_seed, 40);
}

TEST(DrawSample, TakesRecordingsByWeight) {
  const auto recordings = long_and_short();
  int first = 0;
  for (int i = 0; i < kDraws; ++i) first += draw(recordings, drawing_manifest(), i).recording == 0;
  // Binomial with p = 3/4: five standard deviations.
  EXPECT_NEAR(first, 0.75 * kDraws, 5 * std::sqrt(kDraws * 0.75 * 0.25));
}

TEST(DrawSample, TakesGapsThatFitAndFramesInUse) {
  auto recordings = long_and_short();
  recordings[0].first_frame = 2;
  recordings[0].last_frame = 7;
  std::map<std::int64_t, int> gaps, first_frames;
  for (int i = 0; i < kDraws; ++i) {
    const SampleDraw drawn = draw(recordings, drawing_manifest(), i);
    const std::int64_t gap = drawn.last_frame - drawn.first_frame;
    if (drawn.recording == 1) {
      ASSERT_EQ(gap, 1);  // three frames: a gap of 3 does not fit
      ASSERT_LE(drawn.last_frame, 2);
      continue;
    }
    ASSERT_GE(drawn.first_frame, 2);
    ASSERT_LE(drawn.last_frame, 7);
    ++gaps[gap];
    if (gap == 3) ++first_frames[drawn.first_frame];
  }
  ASSERT_EQ(gaps.size(), 2u);
  EXPECT_NEAR(gaps[1], gaps[3], 5 * std::sqrt(kDraws * 0.75));
  // A gap of 3 within frames 2..7 begins at 2, 3 or 4, each as likely.
  ASSERT_EQ(first_frames.size(), 3u);
  for (const auto& [frame, count] : first_frames) EXPECT_NEAR(count, gaps[3] / 3.0, 150) << frame;
}

TEST(DrawSample, TakesOneFrameTwiceForTheStaticShare) {
  const auto recordings = long_and_short();
  TrainingManifest manifest = drawing_manifest();
  for (const double share : {0.0, 0.25, 1.0}) {
    manifest.augmentation.static_fraction = share;
    int still = 0;
    for (int i = 0; i < kDraws; ++i) {
      const SampleDraw drawn = draw(recordings, manifest, i);
      still += drawn.first_frame == drawn.last_frame;
    }
    EXPECT_NEAR(still, share * kDraws, 5 * std::sqrt(kDraws * share * (1 - share)));
  }
}

TEST(DrawSample, AnotherAttemptKeepsTheRecordingAndNothingIsRefused) {
  const auto recordings = long_and_short();
  int moved = 0;
  for (int i = 0; i < 100; ++i) {
    const SampleDraw first = draw(recordings, drawing_manifest(), i);
    const SampleDraw second = draw(recordings, drawing_manifest(), i, 0, 1);
    EXPECT_EQ(first.recording, second.recording);
    moved += !same(first, second);
  }
  EXPECT_GT(moved, 50);
  EXPECT_THROWS(draw({}, drawing_manifest(), 0), std::invalid_argument,
                "expected a recording to draw from, got none");
}

TrainingManifest source_manifest() {
  TrainingManifest manifest;
  manifest.seed = 5;
  manifest.crop = {16, 16};
  manifest.gaps = {1};
  manifest.batch = 4;
  manifest.network.bins = 3;
  return manifest;
}

SampleSource source_of(const TrainingManifest& manifest, const testing::FakeRecording& recording) {
  std::vector<TrainingRecording> recordings;
  recordings.push_back(testing::opened(recording));
  return SampleSource(manifest, std::move(recordings));
}

bool equal(const TrainingSample& a, const TrainingSample& b) {
  return a.shape == b.shape && a.frames == b.frames && a.network_frames == b.network_frames &&
         a.volume == b.volume && a.origin == b.origin;
}

TEST(SampleSource, ASampleDoesNotDependOnWhatWasAskedBefore) {
  const auto bar = testing::moving_bar_recording({32, 40}, 9);
  const SampleSource asked = source_of(source_manifest(), bar);
  const SampleSource fresh = source_of(source_manifest(), bar);
  for (std::int64_t step = 9; step >= 0; --step) asked.batch(TrainingPhase::kFlow, step);
  const auto batch = asked.batch(TrainingPhase::kGenerator, 7);
  ASSERT_EQ(batch.size(), 4u);
  for (int i = 3; i >= 0; --i) {
    EXPECT_TRUE(equal(batch[i], fresh.sample({TrainingPhase::kGenerator, 7, i}))) << i;
  }
}

TEST(SampleSource, GivesNormalisedVolumesOfTheCrop) {
  const SampleSource source =
      source_of(source_manifest(), testing::moving_bar_recording({32, 40}, 9));
  for (const TrainingSample& sample : source.batch(TrainingPhase::kFlow, 0)) {
    EXPECT_EQ(sample.shape, (VolumeShape{3, {16, 16}}));
    EXPECT_EQ(sample.frames.size(), 512u);
    for (const float value : sample.volume) EXPECT_TRUE(value >= 0 && value <= 1);
  }
}

TEST(SampleSource, GainChangesTheNetworksFramesOnly) {
  TrainingManifest manifest = source_manifest();
  manifest.augmentation.gain = {0.5, 0.5};
  const SampleSource source = source_of(manifest, testing::moving_bar_recording({32, 40}, 9));
  const TrainingSample sample = source.sample({TrainingPhase::kFlow, 0, 0});
  for (std::size_t i = 0; i < sample.frames.size(); ++i) {
    EXPECT_NEAR(sample.network_frames[i] + 1, (sample.frames[i] + 1) / 2, 1e-5);
  }
}

TEST(SampleSource, StaticPairsAreEmptyAndEqual) {
  TrainingManifest manifest = source_manifest();
  manifest.augmentation.static_fraction = 1;
  const SampleSource source = source_of(manifest, testing::moving_bar_recording({32, 40}, 9));
  for (const TrainingSample& sample : source.batch(TrainingPhase::kFlow, 0)) {
    EXPECT_EQ(std::accumulate(sample.volume.begin(), sample.volume.end(), 0.0f), 0);
    EXPECT_TRUE(std::equal(sample.frames.begin(), sample.frames.begin() + 256,
                           sample.frames.begin() + 256));
  }
}

TEST(SampleSource, DrawsAgainWhereHardlyAnythingMoved) {
  // Ten frames, events in the last interval only: 200 of them at one pixel.
  const GreyImage grey{{16, 16}, std::vector<std::uint8_t>(256, 100)};
  std::vector<double> times(10);
  std::iota(times.begin(), times.end(), 0.0);
  const testing::FakeRecording recording(std::vector<GreyImage>(10, grey), times,
                                         std::vector<Event>(200, {3, 4, 8.5, true}));
  const SampleSource source = source_of(source_manifest(), recording);
  int busy = 0;
  for (int i = 0; i < 200; ++i) {
    const TrainingSample sample = source.sample({TrainingPhase::kFlow, i, 0});
    busy += sample.origin.find("frames 8-9") != std::string::npos;
  }
  // Of ten attempts one hits with probability 1 - (8/9)^10 = 0.69, not 1/9; five sigma is 0.16.
  EXPECT_NEAR(busy / 200.0, 0.69, 0.17);
}

TEST(SampleSource, CropsHoldAnEventInTheShareAskedFor) {
  // All events of the only pair lie in one pixel of 64 x 48; a crop of 16 x 16 holds it by chance
  // in 16 x 12 of 49 x 33 places, 12 %.
  const GreyImage grey{{48, 64}, std::vector<std::uint8_t>(48 * 64, 100)};
  const testing::FakeRecording recording({grey, grey}, {0, 1},
                                         std::vector<Event>(200, {50, 11, 0.5, true}));
  const auto holding = [&](double share) {
    TrainingManifest manifest = source_manifest();
    manifest.augmentation.event_fraction = share;
    const SampleSource source = source_of(manifest, recording);
    std::map<std::size_t, int> places;  // of the event in the crop
    for (int i = 0; i < 2000; ++i) {
      const TrainingSample sample = source.sample({TrainingPhase::kFlow, i, 0});
      const auto most = std::ranges::max_element(sample.volume);
      if (*most > 0) {
        ++places[static_cast<std::size_t>(most - sample.volume.begin()) % (16 * 16)];
      }
    }
    return places;
  };
  int by_chance = 0;
  for (const auto& [place, count] : holding(0)) by_chance += count;
  EXPECT_NEAR(by_chance, 2000 * 16 * 12 / (49.0 * 33), 75);  // five sigma
  const auto places = holding(1);
  int all = 0;
  for (const auto& [place, count] : places) all += count;
  EXPECT_EQ(all, 2000);
  // Without flips it would lie in rows 0..11 and columns 2..15; with them, symmetrically.
  EXPECT_GT(places.size(), 200u);
}

TEST(SampleSource, EndsWhereHardlyAnythingMovesAndRefusesARecordingWithoutEvents) {
  const GreyImage grey{{16, 16}, std::vector<std::uint8_t>(256, 100)};
  const auto source_with = [&](const std::vector<Event>& events) {
    return source_of(source_manifest(), testing::FakeRecording({grey, grey}, {0, 1}, events));
  };
  const TrainingSample sample = source_with({{8, 8, 0.5, true}}).sample({});
  EXPECT_LE(std::accumulate(sample.volume.begin(), sample.volume.end(), 0.0f), 1);
  EXPECT_THROWS(source_with({}), InputError, "expected events between the frames to train on");
  EXPECT_THROWS(source_with({{8, 8, 1.6e9, true}}), InputError, "on one clock?");
}

/// A chequered grey image whose first pixel has this value.
void write_texture(const std::filesystem::path& path, int value, ImageSize size = {48, 64}) {
  ColourFrame image{size, {}};
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const bool bright = (x / 4 + y / 4) % 2 == 1;
      image.bgr.insert(image.bgr.end(), 3, static_cast<std::uint8_t>(bright ? 250 : value));
    }
  }
  std::filesystem::create_directories(path.parent_path());
  testing::write_file(path, encode_png({size, image.bgr.data()}));
}

std::vector<int> first_pixels(const std::vector<GreyImage>& images) {
  std::vector<int> values;
  for (const GreyImage& image : images) values.push_back(image.pixels.at(0));
  return values;
}

TEST(ReadTextures, AreAllImagesBelowInTheOrderOfTheirPaths) {
  const testing::TemporaryFolder folder;
  write_texture(folder / "b" / "1.png", 40);
  write_texture(folder / "a" / "z.PNG", 30, {3, 5});
  write_texture(folder / "a" / "deep" / "er" / "2.png", 20);
  write_texture(folder / "a" / "deep" / "1.png", 10);
  testing::write_file(folder / "a" / "notes.txt", "no image");
  const std::vector<std::filesystem::path> both{folder / "b", folder / "a"};
  const std::vector<GreyImage> textures = read_textures(both, 10);
  EXPECT_THAT(first_pixels(textures), ::testing::ElementsAre(10, 20, 30, 40));
  EXPECT_EQ(textures[2].size, (ImageSize{3, 5}));
  EXPECT_EQ(textures[2].pixels.size(), 15u);
}

TEST(ReadTextures, OfMoreThanWantedAreSpreadEvenly) {
  const testing::TemporaryFolder folder;
  for (int i = 0; i < 9; ++i) write_texture(folder / (std::to_string(i) + ".png"), 10 * i);
  const std::vector<std::filesystem::path> folders{folder.path()};
  EXPECT_THAT(first_pixels(read_textures(folders, 3)), ::testing::ElementsAre(0, 30, 60));
  EXPECT_THAT(first_pixels(read_textures(folders, 1)), ::testing::ElementsAre(0));
  EXPECT_EQ(read_textures(folders, 9).size(), 9u);
}

std::string textures_fault(const std::vector<std::filesystem::path>& folders) {
  try {
    read_textures(folders, 10);
    return "";
  } catch (const InputError& error) {
    return error_text(error);
  }
}

TEST(ReadTextures, SayWhatIsWrong) {
  const testing::TemporaryFolder folder;
  EXPECT_THAT(textures_fault({folder / "absent"}),
              ::testing::HasSubstr("cannot list the textures in " + (folder / "absent").string()));
  EXPECT_THAT(textures_fault({folder.path()}),
              ::testing::HasSubstr("expected images for simulated.textures, got none, in " +
                                   folder.path().string()));
  EXPECT_THAT(textures_fault({}), ::testing::HasSubstr("got none, in no folder"));
  write_texture(folder / "a.png", 10);
  testing::write_file(folder / "b.png", testing::read_file(folder / "a.png").substr(0, 60));
  EXPECT_THAT(textures_fault({folder.path()}),
              ::testing::HasSubstr("cannot use the texture " + (folder / "b.png").string()));
  testing::write_file(folder / "b.png", "");
  EXPECT_THAT(textures_fault({folder.path()}), ::testing::HasSubstr("b.png"));
}

/// A source of a moving bar and of scenes with two textures.
class SimulatedSamples : public ::testing::Test {
 protected:
  SimulatedSamples() {
    write_texture(folder_ / "textures" / "a.png", 20);
    write_texture(folder_ / "textures" / "b.png", 90, {100, 80});
    manifest_ = source_manifest();
    manifest_.directory = folder_.path();
    manifest_.crop = {32, 40};
    manifest_.network.sensor = true;
  }

  SampleSource source(double fraction) {
    manifest_.simulated = SimulatedSpec{{"textures"}, fraction};
    std::vector<TrainingRecording> recordings;
    recordings.push_back(testing::opened(testing::moving_bar_recording({32, 40}, 9)));
    recordings[0].threshold = ContrastThreshold{0.25};
    return SampleSource(manifest_, std::move(recordings));
  }

  static bool is_simulated(const TrainingSample& sample) {
    return sample.origin.starts_with("simulated sample ");
  }

  testing::TemporaryFolder folder_;
  TrainingManifest manifest_;
};

TEST_F(SimulatedSamples, AreTheShareAskedFor) {
  for (const double share : {0.0, 0.25, 1.0}) {
    const SampleSource samples = source(share);
    int simulated = 0;
    for (int i = 0; i < 100; ++i) {
      simulated += is_simulated(samples.sample({TrainingPhase::kGenerator, i, 0}));
    }
    EXPECT_NEAR(simulated, 100 * share, 5 * std::sqrt(100 * share * (1 - share)));
  }
}

TEST_F(SimulatedSamples, CountTheEventsOfASensorWhoseThresholdTheyTell) {
  const SampleSource samples = source(1);
  double most = 0;
  for (int i = 0; i < 20; ++i) {
    const TrainingSample sample = samples.sample({TrainingPhase::kGenerator, 3, i});
    EXPECT_EQ(sample.origin, "simulated sample " + std::to_string(i) + " of step 3");
    EXPECT_EQ(sample.shape, (VolumeShape{3, {32, 40}}));
    EXPECT_EQ(sample.frames.size(), 2u * 32 * 40);
    EXPECT_EQ(sample.network_frames, sample.frames);
    EXPECT_TRUE(std::ranges::all_of(sample.frames, [](float x) { return -1 <= x && x <= 1; }));
    ASSERT_TRUE(sample.threshold.has_value());
    EXPECT_TRUE(kPlaneThresholds.contains(sample.threshold->mean)) << sample.threshold->mean;
    EXPECT_GT(sample.threshold->ratio, 0);
    ASSERT_EQ(sample.volume.size(), sample.shape.value_count());
    // Each event's values add up to 1, at its pixel and in its polarity.
    const std::size_t plane = sample.shape.size.pixel_count();
    for (std::size_t polarity : {0, 1}) {
      for (std::size_t pixel = 0; pixel < plane; ++pixel) {
        float count = 0;
        for (std::size_t bin = 0; bin < 3; ++bin) {
          count += sample.volume[(polarity * 3 + bin) * plane + pixel];
        }
        ASSERT_NEAR(count, std::round(count), 1e-4);
        most = std::max(most, double(count));
      }
    }
  }
  EXPECT_GE(most, 2) << "no counts";
}

TEST_F(SimulatedSamples, AreFunctionsOfSeedAndPlace) {
  const SampleSource asked = source(1), fresh = source(1);
  asked.batch(TrainingPhase::kGenerator, 1);
  const TrainingSample sample = asked.sample({TrainingPhase::kGenerator, 7, 2});
  const TrainingSample again = fresh.sample({TrainingPhase::kGenerator, 7, 2});
  EXPECT_TRUE(equal(sample, again));
  EXPECT_EQ(sample.threshold, again.threshold);
  EXPECT_NE(fresh.sample({TrainingPhase::kGenerator, 7, 3}).frames, sample.frames);
  EXPECT_NE(fresh.sample({TrainingPhase::kGenerator, 8, 2}).frames, sample.frames);
  manifest_.seed = 6;
  EXPECT_NE(source(1).sample({TrainingPhase::kGenerator, 7, 2}).frames, sample.frames);
}

TEST_F(SimulatedSamples, LeaveTheOthersAsTheyAre) {
  const SampleSource without = source(0), half = source(0.5);
  int recorded = 0;
  for (int i = 0; i < 20; ++i) {
    const TrainingSample sample = half.sample({TrainingPhase::kGenerator, i, 0});
    if (is_simulated(sample)) continue;
    ++recorded;
    EXPECT_TRUE(equal(sample, without.sample({TrainingPhase::kGenerator, i, 0})));
    EXPECT_EQ(sample.threshold, ContrastThreshold{0.25});
  }
  EXPECT_GT(recorded, 2);
}

TEST_F(SimulatedSamples, NeedTheirTextures) {
  manifest_.directory = folder_ / "absent";
  EXPECT_THROWS(source(0.5), InputError,
                "filesystem error: recursive directory iterator cannot open");
}

/// With a teacher of the thresholds 0.05 to 1.
class TaughtSamples : public SimulatedSamples {
 protected:
  TaughtSamples() {
    manifest_.recordings.resize(1);
    manifest_.recordings[0].threshold = ContrastThreshold{0.25};
    manifest_.augmentation.gain = {0.5, 0.5};
    manifest_.teacher = "wide.safetensors";
    teacher_.thresholds = ThresholdRange{0.05, 1};
    write_teacher();
  }

  void write_teacher() const {
    testing::write_file(folder_ / "wide.safetensors", serialize_weights(teacher_));
  }

  std::string fault() const {
    try {
      open_teacher(manifest_);
      return "";
    } catch (const UsageError& error) {
      return error.what();
    }
  }

  Weights teacher_ = testing::untrained_sensor_weights(2, 3, 1);
};

TEST_F(TaughtSamples, HaveTheTeachersRatesForWhatTheNetworkSees) {
  const SampleSource samples = source(0.5);
  const auto reference = make_torch_generator(teacher_);
  int simulated = 0;
  for (const TrainingSample& sample : samples.batch(TrainingPhase::kGenerator, 0)) {
    simulated += is_simulated(sample);
    const std::vector<float> expected = generated_volume(*reference, sample);
    const float largest = std::ranges::max(expected);
    ASSERT_GT(largest, 0);
    ASSERT_EQ(sample.taught_rates.size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
      ASSERT_NEAR(sample.taught_rates[i], expected[i], 1e-4f * largest) << i;
    }
  }
  EXPECT_TRUE(0 < simulated && simulated < manifest_.batch) << simulated;
  EXPECT_TRUE(samples.sample({TrainingPhase::kFlow, 0, 0}).taught_rates.empty());
}

TEST_F(TaughtSamples, NeedATeacherThatHasLearntTheSame) {
  EXPECT_EQ(fault(), "");
  const std::string place = ", in " + (folder_ / "wide.safetensors").string();
  manifest_.augmentation.gamma = {1, 5};
  EXPECT_EQ(fault(),
            "$.teacher: expected weights that have learnt the thresholds of this training, "
            "0.25..1.25, got 0.05..1" +
                place);
  manifest_.augmentation.gamma = {0.1, 1};
  EXPECT_THAT(fault(), ::testing::HasSubstr("0.025..0.25, got 0.05..1"));
  manifest_.network.bins = 9;
  EXPECT_EQ(fault(), "$.teacher: expected 9 bins as in network.bins, got 3" + place);
  manifest_.network.bins = 3;
  teacher_ = untrained_weights(2, 3, 1);
  write_teacher();
  EXPECT_THAT(fault(), ::testing::HasSubstr("got ones that have learnt none"));
  testing::write_file(folder_ / "wide.safetensors", "no weights");
  EXPECT_THROWS(open_teacher(manifest_), InputError,
                "expected a header inside the file, got a length of");
}

BatchPrefetch::Batch batch_of(std::int64_t step) {
  TrainingSample sample;
  sample.origin = std::to_string(step);
  return {sample};
}

TEST(BatchPrefetch, GivesTheStepsInOrder) {
  BatchPrefetch batches(batch_of, 3, 7, 2);
  for (const std::string step : {"3", "4", "5", "6"}) {
    EXPECT_EQ(batches.next().at(0).origin, step);
  }
  EXPECT_THROWS(batches.next(), std::out_of_range,
                "expected a step before the last, got none left");
}

TEST(BatchPrefetch, StartsNoMoreThanItMay) {
  std::atomic<int> started{0};
  {
    BatchPrefetch batches([&](std::int64_t step) { return ++started, batch_of(step); }, 0, 100, 3);
    batches.next();
    EXPECT_LE(started, 4);
  }  // waits for those under way
  EXPECT_EQ(started, 4);
}

TEST(BatchPrefetch, HasNothingForNoSteps) {
  BatchPrefetch batches(batch_of, 5, 5, 2);
  EXPECT_THROWS(batches.next(), std::out_of_range,
                "expected a step before the last, got none left");
}

TEST(BatchPrefetch, RethrowsAtTheStepThatFailed) {
  BatchPrefetch batches(
      [](std::int64_t step) {
        if (step == 1) throw std::runtime_error("torn file");
        return batch_of(step);
      },
      0, 3, 3);
  EXPECT_EQ(batches.next().at(0).origin, "0");
  EXPECT_THROWS(batches.next(), std::runtime_error, "torn file");
}

}  // namespace
}  // namespace eventgan
