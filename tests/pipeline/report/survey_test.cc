#include "pipeline/report/survey.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>
#include <optional>
#include <string>

#include "manifests/values/faults.h"
#include "pipeline/conversion/convert.h"
#include "tests/testing/fake_generator.h"
#include "tests/testing/small_job.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

TEST(LogHistogram, BinsAreSixthsOfADecade) {
  LogHistogram histogram;
  for (const double value : {1.0, 1.4, 1.5, 10.0, 0.0, -1.0, 1e-30, 1e30}) histogram.add(value);
  const int one = 6 * LogHistogram::kPerDecade;  // 10^0, six decades above the first
  EXPECT_DOUBLE_EQ(LogHistogram::edge(one), 1);
  EXPECT_EQ(histogram.counts[one], 2) << "1.4 < 10^(1/6) = 1.468 < 1.5";
  EXPECT_EQ(histogram.counts[one + 1], 1);
  EXPECT_EQ(histogram.counts[one + 6], 1);
  EXPECT_EQ(histogram.counts.front(), 1);
  EXPECT_EQ(histogram.counts.back(), 1);
  EXPECT_EQ(histogram.zeros, 2);
}

/// Eight samples of flat images, each 20 grey levels brighter than the one before, in two shards
/// of four; image 13 is damaged, so that samples 13 and 14 are in quarantine.
class SurveyFolder : public ::testing::Test {
 protected:
  void make(const std::string& damaged, const std::optional<LabelSpec>& labels = {}) {
    JobManifest job = testing::make_small_job(folder_, 9);
    job.errors.max_fraction = 1;
    job.sources[0].labels = labels;
    if (!damaged.empty()) {
      const std::filesystem::path image = folder_ / "clip" / damaged;
      std::filesystem::resize_file(image, std::filesystem::file_size(image) - 20);
    }
    ConversionOptions options;
    options.output = folder_ / "out";
    options.threads = 1;
    convert(job, testing::FakeGenerator(), "weights", options);
  }

  testing::TemporaryFolder folder_;
};

TEST_F(SurveyFolder, HasTheNumbersOfEverySample) {
  make("");
  const Survey survey = survey_folder(folder_ / "out");
  EXPECT_EQ(survey.counts.samples, 8);
  EXPECT_EQ(survey.counts.quarantined(), 0);
  EXPECT_EQ(survey.gaps.at(1).samples, 8);
  EXPECT_EQ(survey.gaps.at(1).least_s, std::nullopt) << "images have no time";
  EXPECT_TRUE(survey.flags.empty());
  EXPECT_TRUE(survey.stage_seconds.contains("generate"));
  EXPECT_GT(survey.peak_bytes, 1 << 20);

  // The fake generator's bin b of 9 is (b + 1) / 9 of the change, 2 x 20 / 255 (float16: 3 digits).
  const double change = 2 * 20 / 255.0;
  EXPECT_EQ(survey.volumes, 8);
  ASSERT_EQ(survey.positive_bins.size(), 9u);
  for (int bin = 0; bin < 9; ++bin) {
    EXPECT_NEAR(survey.positive_bins[bin], change * (bin + 1) / 9, 1e-3);
    EXPECT_EQ(survey.negative_bins[bin], 0);
  }
  LogHistogram expected;
  for (int i = 0; i < 8; ++i) expected.add(5 * change);  // 1 + ... + 9 = 45 ninths
  EXPECT_EQ(survey.sources.at(0).events_per_pixel.counts, expected.counts);
}

TEST_F(SurveyFolder, ABoxIsNarrowByItsShorterSide) {
  testing::write_file(folder_ / "boxes.csv",
                      "image,class,left,top,right,bottom\n"
                      "f_11.png,wide,0,0,30,16\n"    // 16 lines are enough
                      "f_11.png,wide,0,0,30,15.5\n"  // narrow, though it is wide
                      "f_11.png,high,2,0,17.5,20\n"  // narrow
                      "f_12.png,high,2,0,18,20\n"
                      "f_12.png,wide,1,1,30,20\n");
  make("", LabelSpec{LabelFormat::kCsv, "boxes.csv"});
  const Survey survey = survey_folder(folder_ / "out");
  EXPECT_EQ(survey.counts.boxes, 5);
  EXPECT_THAT(survey.narrow_boxes,
              ::testing::ElementsAre(::testing::Pair("high", 1), ::testing::Pair("wide", 1)));
}

TEST_F(SurveyFolder, PicksRandomOnesBySeedAndTheExtremes) {
  make("");
  const auto picked = [&] { return survey_folder(folder_ / "out").sources.at(0).picked; };
  const std::vector<PickedSample> first = picked();
  // Six random ones; the emptiest and the fullest may be among them: all are alike.
  EXPECT_GE(first.size(), 6u);
  EXPECT_LE(first.size(), 8u);
  std::string why;
  for (const PickedSample& sample : first) why += sample.why + "; ";
  for (const char* kind : {"random", "emptiest", "fullest"}) {
    EXPECT_THAT(why, ::testing::HasSubstr(kind)) << "also of a sample that is drawn, too";
  }
  const std::vector<PickedSample> again = picked();
  ASSERT_EQ(again.size(), first.size());
  for (std::size_t i = 0; i < first.size(); ++i) EXPECT_EQ(again[i].sample_id, first[i].sample_id);
}

TEST_F(SurveyFolder, TellsWhatIsInQuarantineAndWhy) {
  make("f_13.png");
  const Survey survey = survey_folder(folder_ / "out");
  EXPECT_EQ(survey.counts.quarantined(), 2);
  EXPECT_EQ(survey.volumes, 6);
  ASSERT_EQ(survey.faults.size(), 1u);
  EXPECT_EQ(survey.faults.begin()->second.samples, 2);
  ASSERT_EQ(survey.quarantined.size(), 2u);
  EXPECT_EQ(survey.quarantined[0].sample_id, "f_13");
  EXPECT_THAT(survey.quarantined[0].reason, ::testing::HasSubstr("f_13.png"));
}

TEST_F(SurveyFolder, OfAPartTakesWhatIsDone) {
  make("");
  std::filesystem::remove(folder_ / "out/job-train-00001-of-00002.h5");
  const Survey survey = survey_folder(folder_ / "out");
  EXPECT_EQ(survey.counts.samples, 4);
  EXPECT_EQ(survey.parts.missing.size(), 1u);
  std::filesystem::remove(folder_ / "out/job-train-00000-of-00002.h5");
  EXPECT_THROWS(survey_folder(folder_ / "out"), InputError, "expected finished shards, got none");
  EXPECT_THROWS(survey_folder(folder_.path()), InputError,
                "expected a folder that eventgan convert has written, got no");
}

}  // namespace
}  // namespace eventgan
