#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "manifests/documents/job_manifest.h"
#include "manifests/values/counter_random.h"
#include "pipeline/conversion/convert.h"
#include "pipeline/dataset/source_comparison.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/generators/simulated_generator.h"
#include "stages/shards/shard_reader.h"
#include "tests/testing/fake_generator.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// Photographs with COCO's polygons, whose objects move on their own, from the manifest to shards.
class MovingObjects : public ::testing::Test {
 protected:
  static constexpr int kImages = 6, kHeight = 48, kWidth = 64;

  MovingObjects() {
    const CounterRandom random = CounterRandom(2).keyed("noise");
    std::string images, annotations;
    for (int i = 0; i < kImages; ++i) {
      std::string pixels = "P5\n64 48\n255\n";
      for (int p = 0; p < kHeight * kWidth; ++p) {
        const int x = p % kWidth, y = p / kWidth;
        const bool is_object = x >= 20 && x < 40 && y >= 12 && y < 32;
        pixels += static_cast<char>((is_object ? 150 : 20) +
                                    random.below(static_cast<std::uint64_t>(p + i), 60));
      }
      const std::string id = std::to_string(i);
      testing::write_file(folder_ / "photos" / (id + ".pgm"), pixels);
      images += (i == 0 ? "" : ",") + std::string(R"({"id":)") + id + R"(,"file_name":")" + id +
                R"(.pgm","width":64,"height":48})";
      annotations +=
          (i == 0 ? "" : ",") + std::string(R"({"id":)") + id + R"(,"image_id":)" + id +
          R"(,"category_id":1,"bbox":[20,12,20,20],"segmentation":[[20,12,40,12,40,32,20,32]]})";
    }
    testing::write_file(folder_ / "labels.json",
                        R"({"categories":[{"id":1,"name":"car"}],"images":[)" + images +
                            R"(],"annotations":[)" + annotations + "]}");
  }

  /// The shards' bytes, one after the other.
  std::string convert_with(int threads, const std::string& pairs, const Generator& generator) {
    manifest_ = parse_job_manifest(
        R"({"format": "eventgan-manifest", "version": 1, "name": "job",
            "sources": [{"dataset": "frames", "root": "photos",
                         "labels": {"format": "coco", "path": "labels.json"},
                         "pairs": {"from": "stills", )" +
            pairs + R"(}}],
            "image": {"width": 32, "height": 24, "fit": "letterbox", "preset": "demo"},
            "generator": {"kind": ")" +
            std::string(generator_) +
            R"("}, "output": {"directory": "out", "samples_per_shard": 64}})",
        folder_.path(), "manifest.json");
    std::filesystem::remove_all(folder_ / "out");
    ConversionOptions options;
    options.threads = threads;
    convert(manifest_, generator, "weights", options);
    plan_ = read_frozen_plan(folder_ / "out").plan;
    std::string bytes;
    for (const PlannedShard& shard : plan_.shards) {
      bytes += testing::read_file(folder_ / "out" / shard.name);
    }
    return bytes;
  }

  std::vector<ShardSample> samples() const {
    const ShardReader reader(folder_ / "out" / plan_.shards.at(0).name);
    std::vector<ShardSample> all;
    for (int i = 0; i < reader.header().sample_count; ++i) all.push_back(reader.sample(i));
    return all;
  }

  std::vector<std::string> faults() const {
    SourceComparison comparison(manifest_);
    return comparison.faults(plan_.shards.at(0),
                             ShardReader(folder_ / "out" / plan_.shards.at(0).name));
  }

  testing::TemporaryFolder folder_;
  JobManifest manifest_;
  Plan plan_;
  std::string_view generator_ = "difference";
};

constexpr char kObjects[] = R"("motion": {"translation_px": [1, 3], "objects": {"rests": 0}})";

TEST_F(MovingObjects, GiveTheSameBytesForAnyNumberOfThreadsAndAreVerified) {
  for (const std::string side : {"before", "after"}) {
    const std::string pairs = R"("side": ")" + side + R"(", )" + kObjects;
    const std::string bytes = convert_with(1, pairs, testing::FakeGenerator());
    EXPECT_TRUE(convert_with(3, pairs, testing::FakeGenerator()) == bytes);
    EXPECT_THAT(faults(), IsEmpty());
    int at_rest = 0;
    for (const ShardSample& sample : samples()) {
      ASSERT_TRUE(sample.valid) << sample.fault;
      ASSERT_EQ(sample.pair.objects.size(), 1u);
      EXPECT_NE(sample.pair.objects[0], ImageMotion());
      at_rest += sample.pair.motion == ImageMotion();
      EXPECT_GT(sample.statistics.nonzero_fraction, 0);
    }
    EXPECT_GT(at_rest, 0);
    EXPECT_LT(at_rest, kImages);
  }
  manifest_.seed = 1;  // draws others
  EXPECT_THAT(faults(), Contains(HasSubstr("/labels/boxes/motion of box 0")));
}

TEST_F(MovingObjects, EsimSeesThemMove) {
  generator_ = "esim";
  GeneratorSpec spec;
  spec.kind = GeneratorKind::kEsim;
  const auto esim = make_simulated_generator(spec, 9, 0);
  const std::string pairs = R"("motion": {"rests": 1, "objects": {"translation_px": [4, 8]}})";
  const std::string bytes = convert_with(1, pairs, *esim);
  EXPECT_TRUE(convert_with(3, pairs, *esim) == bytes);
  // Nothing happens away from the object, of 10 x 10 pixels in the volume's middle.
  const ShardReader reader(folder_ / "out" / plan_.shards.at(0).name);
  for (int slot = 0; slot < kImages; ++slot) {
    const std::vector<float> volume = reader.volume(slot);
    double inside = 0, outside = 0;
    for (std::size_t i = 0; i < volume.size(); ++i) {
      const std::size_t x = i % 32, y = i / 32 % 24;
      (x > 2 && x < 28 && y < 24 && y > 0 ? inside : outside) += volume[i];
    }
    EXPECT_GT(inside, 0);
    EXPECT_EQ(outside, 0);
  }
}

TEST_F(MovingObjects, MakeClipsWithTracks) {
  const std::string pairs = std::string(R"("frames": 5, )") + kObjects;
  const std::string bytes = convert_with(1, pairs, testing::FakeGenerator());
  EXPECT_TRUE(convert_with(3, pairs, testing::FakeGenerator()) == bytes);
  EXPECT_THAT(faults(), IsEmpty());
  const std::vector<ShardSample> all = samples();
  ASSERT_EQ(all.size(), 5u * kImages);
  for (std::size_t i = 0; i < all.size(); ++i) {
    ASSERT_TRUE(all[i].valid) << all[i].fault;
    EXPECT_EQ(all[i].source_size, (ImageSize{36, 48}));  // without an eighth a side
    EXPECT_NEAR(all[i].pair.gap_s(), 0.05, 1e-12);
    EXPECT_FALSE(all[i].pair.motion);
    if (i % 5 > 0) {
      EXPECT_EQ(all[i].sequence, all[i - 1].sequence);
    }
    for (const Box& box : all[i].annotation.boxes) EXPECT_EQ(box.track_id, 0);
  }
}

}  // namespace
}  // namespace eventgan
