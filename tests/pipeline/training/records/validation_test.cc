#include "pipeline/training/records/validation.h"

#include <gtest/gtest.h>

#include "tests/pipeline/training/samples/fake_training_recording.h"
#include "tests/testing/fake_generator.h"
#include "tests/testing/fake_recording.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

CropReader reader_of(std::vector<int> frame_counts) {
  std::vector<TrainingRecording> recordings;
  for (const int count : frame_counts) {
    recordings.push_back(testing::opened(testing::moving_bar_recording({24, 32}, count)));
  }
  return CropReader(std::move(recordings), 3);
}

TEST(ValidationPairs, AreConsecutiveFramesInTheMiddle) {
  const CropReader reader = reader_of({3, 2});
  const ValidationPairs pairs(reader, {16, 16});
  ASSERT_EQ(pairs.samples().size(), 3u);
  EXPECT_EQ(pairs.samples()[0].origin, "fake recording frames 0-1 crop 8,4");
  EXPECT_EQ(pairs.samples()[1].origin, "fake recording frames 1-2 crop 8,4");
  EXPECT_EQ(pairs.samples()[2].origin, "fake recording frames 0-1 crop 8,4");
}

TEST(ValidationPairs, AreSpreadEvenlyWhereThereAreMany) {
  const CropReader reader = reader_of({33});
  const ValidationPairs pairs(reader, {100, 100});  // larger than the picture: all of it
  ASSERT_EQ(pairs.samples().size(), 16u);
  for (int i = 0; i < 16; ++i) {
    EXPECT_EQ(pairs.samples()[i].origin, "fake recording frames " + std::to_string(2 * i) + "-" +
                                             std::to_string(2 * i + 1) + " crop 0,0");
  }
}

TEST(ValidationPairs, AreJudgedByTheirMeans) {
  const CropReader reader = reader_of({3});
  const ValidationPairs pairs(reader, {24, 32});
  const testing::FakeGenerator generator(3);
  const ValidationScores scores = pairs.judge(generator);
  EXPECT_EQ(generator.calls(), 2);
  // The bar's columns that change have events, and the fake generator's volume is not zero where
  // the frames differ: the same pixels, the same polarity.
  EXPECT_DOUBLE_EQ(scores.realism.f1_time, 1);
  EXPECT_GT(scores.volume_loss, 0);
}

TEST(ValidationLog, GoesOnAfterTheCheckpoint) {
  const testing::TemporaryFolder folder;
  const auto file = folder / "validation.csv";
  ValidationScores scores;
  scores.volume_loss = 0.5;
  {
    ValidationLog log(file, -1);
    for (const int step : {10, 20, 30}) log.add(step, scores);
  }
  ValidationLog log(file, 20);
  scores.volume_loss = 0.25;
  log.add(25, scores);
  const std::string text = testing::read_file(file);
  EXPECT_NE(text.find("\n20,0.5,"), std::string::npos);
  EXPECT_NE(text.find("\n25,0.25,"), std::string::npos);
  EXPECT_EQ(text.find("\n30,"), std::string::npos);
}

}  // namespace
}  // namespace eventgan
