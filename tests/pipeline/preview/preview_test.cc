#include "pipeline/preview/preview.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "manifests/documents/job_manifest.h"
#include "manifests/values/faults.h"
#include "manifests/values/placement.h"
#include "pipeline/conversion/convert.h"
#include "pipeline/preview/preview_reader.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/decoding/frame_decoder.h"
#include "stages/frames/decoding/moving_still.h"
#include "stages/frames/decoding/prepared_frame.h"
#include "stages/frames/sources/open_dataset.h"
#include "stages/shards/shard_reader.h"
#include "tests/testing/fake_generator.h"
#include "tests/testing/image_file.h"
#include "tests/testing/small_job.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(ParseSlots, TakesNumbersAndRangesAndNothingElse) {
  EXPECT_THAT(parse_slots("0,3-5", 8), ElementsAre(0, 3, 4, 5));
  EXPECT_THAT(parse_slots("5,1,4-5,1", 8), ElementsAre(1, 4, 5));
  EXPECT_THAT(parse_slots("7", 8), ElementsAre(7));
  for (const char* text :
       {"", ",", "1,", "8", "-1", "5-3", "1-", "a", "1 2", "0x1", "99999999999"}) {
    EXPECT_THROWS(parse_slots(text, 8), UsageError,
                  "--samples: expected slots 0..7 such as 0,3-5, got \"")
        << text;
  }
  EXPECT_THROWS(parse_slots("0", 0), UsageError,
                "--samples: expected slots 0..-1 such as 0,3-5, got \"0\"");
}

/// Six samples, 11 to 16, in two shards of four and two: images 10 to 16, of which 13 is as
/// bright as 12, and 15 is 60 levels brighter than 14. So the emptiest sample is 13, and the
/// fullest 15.
class Preview : public ::testing::Test {
 protected:
  Preview() {
    const JobManifest job = testing::make_small_job(folder_, 7);
    constexpr int kGreys[] = {0, 20, 40, 40, 60, 120, 140};
    for (int frame = 0; frame < 7; ++frame) {
      testing::write_flat_image(folder_ / "clip" / ("f_" + std::to_string(10 + frame) + ".png"),
                                {20, 30}, kGreys[frame]);
    }
    ConversionOptions options;
    options.output = folder_ / "out";
    options.threads = 1;
    convert(job, testing::FakeGenerator(), "weights", options);
    options_.out = folder_ / "images";
  }

  /// Names of what it wrote.
  std::vector<std::string> draw(const std::string& where) {
    warnings_.clear();
    std::vector<std::string> names;
    for (const auto& image : preview(folder_ / where, options_, warnings_)) {
      EXPECT_GT(std::filesystem::file_size(image), 100u);
      names.push_back(image.filename());
    }
    return names;
  }

  testing::TemporaryFolder folder_;
  PreviewOptions options_;
  std::vector<std::string> warnings_;
  const std::string shard_ = "out/job-train-00000-of-00002.h5";
};

TEST_F(Preview, OfAShardDrawsTheSlots) {
  options_.slots = "1,3";
  EXPECT_THAT(draw(shard_), ElementsAre("job-train-00000-of-00002_0001.png",
                                        "job-train-00000-of-00002_0003.png"));
  EXPECT_THAT(warnings_, ::testing::IsEmpty());
  options_.slots = "4";
  EXPECT_THROWS(draw(shard_), UsageError,
                "--samples: expected slots 0..3 such as 0,3-5, got \"4\"");
  EXPECT_THROWS(draw("out"), UsageError, "--samples: expected one shard, got the folder")
      << "slots are of a shard";
}

TEST_F(Preview, OfAFolderSpreadsOverAllShards) {
  options_.count = 2;
  const std::vector<std::string> expected{"job-train-00000-of-00002_0000.png",
                                          "job-train-00000-of-00002_0003.png"};
  EXPECT_EQ(draw("out"), expected);
  EXPECT_EQ(draw("out/dataset.h5"), expected) << "which is a view of its folder's shards";
  options_.count.reset();
  EXPECT_EQ(draw("out").size(), 6u);
}

TEST_F(Preview, FindsSamplesByTheirId) {
  options_.samples = {"f_16", "f_12"};
  EXPECT_THAT(draw("out"), ElementsAre("job-train-00000-of-00002_0001.png",
                                       "job-train-00001-of-00002_0001.png"));
  options_.samples = {"f_16", "1"};
  EXPECT_THAT(draw("out/job-train-00001-of-00002.h5"),
              ElementsAre("job-train-00001-of-00002_0001.png"))
      << "id and slot of one sample";
  options_.samples = {"f_12", "f_99"};
  EXPECT_THROWS(draw("out"), UsageError, "\"f_99\"");
}

TEST_F(Preview, TheWorstAreTheEmptiestAndTheFullest) {
  options_.worst = 1;
  EXPECT_THAT(draw("out"), ElementsAre("job-train-00000-of-00002_0002.png",
                                       "job-train-00001-of-00002_0000.png"));
  options_.worst = 100;
  EXPECT_EQ(draw("out").size(), 6u) << "each once";
}

TEST_F(Preview, RanksByKind) {
  ShardOverview shard;
  shard.header.volume = {9, {2, 5}};
  shard.tables.events.sum_positive = {5, 1, 9};
  shard.tables.events.sum_negative = {5, 1, 0};
  shard.tables.events.flags = {kFlagExtrapolated, kFlagSaturated, kFlagExtrapolated};
  shard.tables.pairs.gap_frames = {6, 3, 6};
  shard.tables.valid = {1, 1, 0};
  EXPECT_EQ(rank(Extreme::kFullest, shard, 0), 1.0);
  EXPECT_EQ(rank(Extreme::kEmptiest, shard, 1), -0.2);
  EXPECT_EQ(rank(Extreme::kExtrapolated, shard, 0), 6.0);
  EXPECT_EQ(rank(Extreme::kExtrapolated, shard, 1), std::nullopt);
  EXPECT_EQ(rank(Extreme::kFullest, shard, 2), std::nullopt) << "in quarantine";
}

TEST_F(Preview, AClassThatNoBoxHasIsRefused) {
  options_.class_name = "Car";
  EXPECT_THROWS(draw("out"), UsageError, "none of the samples has boxes");
}

TEST_F(Preview, ASheetIsOneImage) {
  options_.sheet = true;
  EXPECT_THAT(draw("out"), ElementsAre("sheet.png"));
}

TEST_F(Preview, AVideoHasTheSequence) {
  options_.video = true;
  EXPECT_THAT(draw("out"), ElementsAre("clip.mp4"));
  EXPECT_FALSE(is_fault(probe_image_size(folder_ / "images/clip.mp4", ImageOrientation::kStored)));
}

TEST_F(Preview, WarnsOfFramesThatAreGone) {
  std::filesystem::remove_all(folder_ / "clip");
  options_.slots = "0";
  EXPECT_EQ(draw(shard_).size(), 1u);
  EXPECT_THAT(warnings_, ::testing::Each(HasSubstr("clip/f_1")));
  EXPECT_EQ(warnings_.size(), 2u);
}

TEST(PreviewOfClips, MakesTheFramesOfAStillAgain) {
  const testing::TemporaryFolder folder;
  constexpr ImageSize kStill{64, 96};
  std::vector<int> levels;
  for (int i = 0; i < 64 * 96; ++i) levels.push_back((i % 96 / 4 * 37 + i / 96 / 4 * 53) % 251);
  testing::write_index_image(folder / "photos/a.png", kStill, levels);
  const JobManifest job = parse_job_manifest(R"({
    "format": "eventgan-manifest", "version": 1, "name": "job", "seed": 3,
    "sources": [{ "dataset": "frames", "root": "photos", "pairs": { "from": "stills", "frames": 5,
                  "motion": { "translation_px": [2, 3] } } }],
    "image": { "preset": "mpii" }, "generator": { "weights": "untrained:1" },
    "output": { "directory": "out" } })",
                                             folder.path(), "manifest.json");
  ConversionOptions options;
  options.output = folder / "out";
  convert(job, testing::FakeGenerator(), "weights", options);
  const std::filesystem::path shard = folder / "out/job-train-00000-of-00001.h5";
  std::vector<std::string> warnings;
  {
    PreviewReader reader(folder.path(), warnings);
    std::vector<std::uint8_t> last;
    for (int slot = 0; slot < 5; ++slot) {
      const PreviewContent content = reader.content(shard, slot);
      EXPECT_THAT(content.title, HasSubstr("clip of a still"));
      ASSERT_EQ(content.previous_bgr.size(), 3u * 48 * 72) << "an eighth less on each side";
      if (slot == 0) {
        for (int y = 0; y < 48; ++y) {
          for (int x = 0; x < 72; ++x) {
            ASSERT_EQ(content.previous_bgr[static_cast<std::size_t>(3 * (72 * y + x))],
                      levels[static_cast<std::size_t>(96 * (y + 8) + x + 12)]);
          }
        }
      } else {
        EXPECT_EQ(content.previous_bgr, last) << "they follow each other";
      }
      EXPECT_NE(content.next_bgr, content.previous_bgr);
      last = content.next_bgr;
    }
  }
  EXPECT_THAT(warnings, ::testing::IsEmpty());
  std::filesystem::remove(folder / "photos/a.png");
  std::filesystem::create_directories(folder / "photos/b");
  const PreviewContent without = PreviewReader(folder.path(), warnings).content(shard, 0);
  EXPECT_TRUE(without.next_bgr.empty());
  EXPECT_EQ(warnings.size(), 1u);
}

// Corners on whole numbers, as labelling tools write them: an edge goes through pixels' centres,
// and in float32 of the volume it lies beside them.
TEST(PreviewOfStills, ObjectsMoveByTheLabelsOwnOutlines) {
  const testing::TemporaryFolder folder;
  constexpr ImageSize kStill{133, 69};
  constexpr int kStills = 12;
  std::vector<int> levels;
  for (int i = 0; i < 133 * 69; ++i) levels.push_back((i % 69 / 2 * 37 + i / 69 / 2 * 53) % 251);
  std::string images, annotations;
  for (int i = 0; i < kStills; ++i) {
    const std::string number = std::to_string(i);
    testing::write_index_image(folder / "photos" / (number + ".png"), kStill, levels);
    images += (i ? ", " : "") + std::string(R"({"id": )") + number + R"(, "file_name": ")" +
              number + R"(.png", "width": 69, "height": 133})";
    const int x = 13 + i, y = 40 + 3 * i;  // corners of a triangle
    const std::string left = std::to_string(x), top = std::to_string(y);
    annotations += (i ? ", " : "") + std::string(R"({"image_id": )") + number +
                   R"(, "category_id": 1, "bbox": [)" + left + ", " + top +
                   R"(, 21, 33], "segmentation": [[)" + left + ", " + top + ", " +
                   std::to_string(x + 21) + ", " + std::to_string(y + 7) + ", " +
                   std::to_string(x + 9) + ", " + std::to_string(y + 33) + "]]}";
  }
  testing::write_file(folder / "labels.json",
                      R"({"images": [)" + images + R"(], "annotations": [)" + annotations +
                          R"(], "categories": [{"id": 1, "name": "car"}]})");
  const JobManifest job = parse_job_manifest(R"({
    "format": "eventgan-manifest", "version": 1, "name": "job", "seed": 3,
    "sources": [{ "dataset": "frames", "root": "photos",
                  "labels": { "format": "coco", "path": "labels.json" },
                  "pairs": { "from": "stills",
                             "motion": { "translation_px": [2, 3], "objects": {} } } }],
    "image": {}, "generator": { "weights": "untrained:1" }, "output": { "directory": "out" } })",
                                             folder.path(), "manifest.json");
  ConversionOptions options;
  options.output = folder / "out";
  convert(job, testing::FakeGenerator(), "weights", options);
  const std::filesystem::path shard = folder / "out/job-train-00000-of-00001.h5";
  const auto dataset = open_dataset(job.sources[0], folder.path());
  const ShardReader shards(shard);
  std::vector<std::string> warnings;
  PreviewReader reader(folder.path(), warnings);
  int otherwise = 0;
  for (int slot = 0; slot < kStills; ++slot) {
    const ShardSample sample = shards.sample(slot);
    const auto labelled =
        std::ranges::find(dataset->labelled_frames(), sample.sample_id, &LabelledFrame::sample_id);
    const auto colour =
        FrameDecoder(folder.path(), 1).decode(labelled->frame, 1, ImageOrientation::kUpright, {});
    const std::vector<Box> boxes = dataset->annotation(labelled->label_key)->boxes;
    const auto moved = [&](const std::vector<Box>& of_still) {
      return place_colour(move_still(*colour, sample.pair, of_still),
                          place(kStill, job.image, sample.pair));
    };
    const bool is_first = sample.pair.label_position == 1;
    const PreviewContent content = reader.content(shard, slot);
    EXPECT_EQ(is_first ? content.previous_bgr : content.next_bgr, moved(boxes)) << sample.sample_id;
    otherwise += moved(sample.annotation.boxes) != moved(boxes);
  }
  EXPECT_GT(otherwise, 0) << "by the shard's outlines";
  EXPECT_THAT(warnings, ::testing::IsEmpty());
}

TEST(PreviewOfClips, ASourceThatIsGoneLeavesTheOthers) {
  const testing::TemporaryFolder folder;
  const std::vector<int> levels(64 * 96, 7);
  testing::write_index_image(folder / "a/a.png", {64, 96}, levels);
  testing::write_index_image(folder / "b/b.png", {64, 96}, levels);
  const std::string pairs = R"("pairs": { "from": "stills", "frames": 2,
                                          "motion": { "translation_px": [2, 3] } } })";
  const JobManifest job =
      parse_job_manifest(R"({
    "format": "eventgan-manifest", "version": 1, "name": "job", "seed": 3,
    "sources": [{ "dataset": "frames", "root": "a", )" +
                             pairs + R"(, { "dataset": "frames", "root": "b", )" + pairs + R"(],
    "image": { "preset": "mpii" }, "generator": { "weights": "untrained:1" },
    "output": { "directory": "out", "samples_per_shard": 2 } })",
                         folder.path(), "manifest.json");
  ConversionOptions options;
  options.output = folder / "out";
  convert(job, testing::FakeGenerator(), "weights", options);
  std::filesystem::remove_all(folder / "b");
  std::vector<std::string> warnings;
  PreviewReader reader(folder.path(), warnings);
  std::size_t frames = 0;
  for (int turn = 0; turn < 2; ++turn) {
    for (const auto& entry : std::filesystem::directory_iterator(folder / "out")) {
      if (entry.path().extension() != ".h5") continue;
      frames += reader.content(entry.path(), 0).next_bgr.empty() ? 0 : 1;
    }
  }
  EXPECT_EQ(frames, 2u);
  EXPECT_EQ(warnings.size(), 2u);
}

TEST_F(Preview, WithoutShardsThereIsNothingToDraw) {
  EXPECT_THROWS(draw("clip"), InputError,
                "expected a folder that eventgan convert has written, got no");
  for (const char* shard : {"out/job-train-00000-of-00002.h5", "out/job-train-00001-of-00002.h5"}) {
    std::filesystem::remove(folder_ / shard);
  }
  EXPECT_THROWS(draw("out"), InputError, "got none");
}

}  // namespace
}  // namespace eventgan
