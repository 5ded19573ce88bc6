#include "pipeline/planning/fingerprint.h"

#include <dlfcn.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <libdeflate.h>
#include <zlib.h>

#include <cstdio>
// jpeglib.h needs the one above it.
#include <jpeglib.h>

#include "manifests/files/sha256.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

class Fingerprint : public ::testing::Test {
 protected:
  Fingerprint() {
    manifest_.directory = folder_.path();
    manifest_.text = R"({"seed": 1})";
    manifest_.sources.resize(1);
    manifest_.sources[0].dataset = DatasetKind::kKittiRaw;
    testing::write_file(folder_ / "labels.txt", "Car 1");
    testing::write_file(folder_ / "a.png", "12345");
    plan_.shards = {{"s.h5", 0, {1, 1}, {{"id", "", "", {{"a.png"}, {"b.png"}, 1, 0, 1}, ""}}}};
  }
  std::map<std::string, std::string> make() {
    return make_fingerprint(manifest_, plan_, {"labels.txt"}, "weights", "engine");
  }

  testing::TemporaryFolder folder_;
  JobManifest manifest_;
  Plan plan_;
};

TEST_F(Fingerprint, IsTheSameForTheSameInputs) { EXPECT_EQ(make(), make()); }

TEST_F(Fingerprint, ListsEachPathOnceSortedWithItsSizeOrHash) {
  // Where these values change, folders that were frozen before are refused.
  const PlannedSample sample = plan_.shards[0].samples[0];
  plan_.shards.push_back({"t.h5", 0, {1, 1}, {sample, sample}});
  plan_.shards[1].samples[0].pair.next.path = "B.png";
  const auto fields =
      make_fingerprint(manifest_, plan_, {"z.txt", "labels.txt", "z.txt"}, "weights", "engine");
  const std::string decided = "0\tid\tnan\tnan\t\t1\t1\n";
  EXPECT_EQ(fields.at("frames"), sha256_hex(sha256_hex("B.png\tabsent\na.png\t5\nb.png\tabsent\n") +
                                            "\n" + sha256_hex(decided + decided + decided)));
  EXPECT_EQ(fields.at("annotations"),
            sha256_hex("labels.txt\t" + sha256_hex("Car 1") + "\nz.txt\tabsent\n"));
  EXPECT_EQ(make_fingerprint(manifest_, {}, {}, "", "").at("frames"),
            sha256_hex(sha256_hex("") + "\n" + sha256_hex("")));
}

/// "libjpeg.so.62 0123456789abcdef" of the file that a function of this process lies in.
template <class Function>
std::string file_of(Function* function) {
  Dl_info info{};
  EXPECT_NE(dladdr(reinterpret_cast<void*>(function), &info), 0);
  const std::filesystem::path file = info.dli_fname;
  return file.filename().string() + " " + sha256_of_file(file).substr(0, 16);
}

TEST_F(Fingerprint, HasTheLibrariesThatAreLoaded) {
  using ::testing::HasSubstr;
  const std::string libraries = make().at("libraries");
  EXPECT_THAT(libraries, HasSubstr(std::string("zlib ") + zlibVersion()));
  EXPECT_THAT(file_of(jpeg_std_error), ::testing::StartsWith("libjpeg.so"));
  EXPECT_THAT(libraries, HasSubstr(file_of(jpeg_std_error)));
  EXPECT_THAT(file_of(libdeflate_alloc_compressor), ::testing::StartsWith("libdeflate.so"));
  EXPECT_THAT(libraries, HasSubstr(file_of(libdeflate_alloc_compressor)));
}

TEST_F(Fingerprint, HasFfmpegWhereFramesComeFromVideos) {
  EXPECT_THAT(make().at("libraries"), ::testing::Not(::testing::HasSubstr("FFmpeg")));
  plan_.shards[0].samples[0].pair.previous.video_frame = 0;
  EXPECT_THAT(make().at("libraries"), ::testing::ContainsRegex(", FFmpeg [0-9]+\\.[0-9]+"));
}

TEST_F(Fingerprint, HasHowStillsAreSampledAndObjectsCutOutWhereTheyMove) {
  EXPECT_FALSE(make().contains("stills"));
  manifest_.sources[0].pairs.stills.emplace();
  EXPECT_TRUE(make().contains("stills"));
  EXPECT_FALSE(make().contains("cut_out"));
  manifest_.sources[0].pairs.stills->objects.emplace();
  EXPECT_TRUE(make().contains("cut_out"));
}

TEST_F(Fingerprint, HasWhatCountsAsMotionWhereTheScopeAsksForIt) {
  for (const auto& [scope, is_there] :
       {std::pair(Scope::kWhole, false), std::pair(Scope::kMotion, true),
        std::pair(Scope::kLabels, true), std::pair(Scope::kLabelsOnly, false)}) {
    manifest_.generator.scope.scope = scope;
    EXPECT_EQ(make().contains("motion"), is_there) << to_string(scope);
  }
}

// Labels may name frames beyond a video's end, and be corrected.
TEST_F(Fingerprint, HasNoOrientationOfVideosWhateverTheirLabelsName) {
  manifest_.sources[0].dataset = DatasetKind::kFrames;
  EXPECT_TRUE(make().contains("orientation"));
  plan_.shards.push_back(plan_.shards[0]);
  PlannedSample& sample = plan_.shards[0].samples[0];
  sample.pair.previous.video_frame = sample.pair.next.video_frame = 0;
  EXPECT_FALSE(make().contains("orientation"));
}

TEST_F(Fingerprint, NoticesAnInputOfAnotherSize) {
  const auto before = make();
  testing::write_file(folder_ / "a.png", "123456");
  const auto differences = fingerprint_differences(before, make());
  ASSERT_EQ(differences.size(), 1u);
  EXPECT_TRUE(differences[0].starts_with("frames: "));
}

// Else the plan would be another one, and no field would say why: nothing that `retry` could
// record.
TEST_F(Fingerprint, NoticesWhateverTheInputsDecide) {
  plan_.sources.resize(1);
  const Plan before = plan_;
  const auto fields = make();
  const auto differs = [&](const auto& change) {
    plan_ = before;
    change(plan_);
    const auto differences = fingerprint_differences(fields, make());
    return differences.size() == 1 && differences[0].starts_with("frames: ");
  };
  EXPECT_TRUE(differs([](Plan& plan) { plan.sources[0].labelled_frames = 1; }));
  EXPECT_TRUE(differs([](Plan& plan) { plan.sources[0].unpaired = 1; }));
  EXPECT_TRUE(differs([](Plan& plan) { plan.sources[0].unpaired_ids = {"x"}; }));
  EXPECT_TRUE(differs([](Plan& plan) { plan.shards[0].volume_size = {2, 1}; }));
  EXPECT_TRUE(differs([](Plan& plan) { plan.shards[0].samples[0].fault = "x"; }));
  EXPECT_TRUE(differs([](Plan& plan) { plan.shards[0].samples[0].sample_id = "x"; }));
  EXPECT_TRUE(differs([](Plan& plan) { plan.shards[0].samples[0].pair.next.time_s = 1; }));
  EXPECT_FALSE(differs([](Plan& plan) { plan.sources[0].notes = {"x"}; }));
}

TEST_F(Fingerprint, NoticesAnImageOfUnknownSizeThatWasMendedWithinItsBytes) {
  const auto whole = make();
  plan_.shards[0].size_unknown = true;
  const auto differences = fingerprint_differences(make(), whole);
  ASSERT_EQ(differences.size(), 1u);
  EXPECT_TRUE(differences[0].starts_with("frames: "));
}

TEST_F(Fingerprint, NoticesAnAnnotationOfTheSameSize) {
  const auto before = make();
  testing::write_file(folder_ / "labels.txt", "Van 1");
  const auto differences = fingerprint_differences(before, make());
  ASSERT_EQ(differences.size(), 1u);
  EXPECT_TRUE(differences[0].starts_with("annotations: "));
}

TEST_F(Fingerprint, NoticesTheManifestAndThePreprocessing) {
  const auto before = make();
  manifest_.text = R"({"seed": 2})";
  manifest_.image.blur = 3;
  EXPECT_THAT(fingerprint_differences(before, make()),
              ::testing::ElementsAre("manifest $.seed: expected 1, got 2",
                                     ::testing::StartsWith("preprocessing: ")));
}

// Images of one's own were taken as stored, in folders without the field.
TEST_F(Fingerprint, SaysThatImagesAreTurned) {
  EXPECT_FALSE(make().contains("orientation"));
  manifest_.sources[0].dataset = DatasetKind::kFrames;
  EXPECT_THAT(make().at("orientation"), ::testing::StartsWith("upright, by libexif.so."));
  PlannedSample& sample = plan_.shards[0].samples[0];
  sample.pair.previous.video_frame = 0;
  sample.pair.next.video_frame = 1;
  EXPECT_FALSE(make().contains("orientation"));
}

/// Its samples are quarantined; the run goes on, and knows the file once it is mended.
TEST_F(Fingerprint, AnAnnotationThatCannotBeReadIsStatedAsSuch) {
  const auto before = make();
  std::filesystem::remove(folder_ / "labels.txt");
  std::filesystem::create_symlink("labels.txt", folder_ / "labels.txt");  // a loop
  EXPECT_EQ(make().at("annotations"), sha256_hex("labels.txt\tunreadable\n"));
  std::filesystem::remove(folder_ / "labels.txt");
  std::filesystem::create_directory(folder_ / "labels.txt");
  EXPECT_EQ(make().at("annotations"), sha256_hex("labels.txt\tunreadable\n"));
  std::filesystem::remove(folder_ / "labels.txt");
  testing::write_file(folder_ / "labels.txt", "Car 1");
  EXPECT_EQ(make(), before);
}

}  // namespace
}  // namespace eventgan
