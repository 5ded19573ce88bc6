#include "pipeline/planning/outline_masks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <string>

#include "manifests/documents/job_manifest.h"
#include "manifests/values/counter_random.h"
#include "manifests/values/faults.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

/// Two photographs, and a text with their boxes.
class OutlineMasks : public ::testing::Test {
 protected:
  OutlineMasks() {
    write_photograph("photos/some/a.png", 1);
    write_photograph("photos/more/b.png", 2);
    write_boxes(
        "some/a.png,person,20,10,60,90\nsome/a.png,person,50,10,58,95\nmore/"
        "b.png,person,20,10,60,90\n");
  }

  /// Noise, and a disc that differs from it, in 100x80.
  void write_photograph(const fs::path& name, std::uint64_t seed) {
    const CounterRandom random = CounterRandom(seed).keyed("photograph");
    cv::Mat image(100, 80, CV_8UC3);
    std::uint64_t drawn = 0;
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        const bool inside = (x - 40) * (x - 40) * 4 + (y - 50) * (y - 50) < 40 * 40;
        for (int c = 0; c < 3; ++c) {
          image.at<cv::Vec3b>(y, x)[c] =
              static_cast<std::uint8_t>((inside && c == 2 ? 190 : 70) + random.below(drawn++, 30));
        }
      }
    }
    fs::create_directories((folder_.path() / name).parent_path());
    cv::imwrite((folder_.path() / name).string(), image);
  }

  void write_boxes(const std::string& rows) {
    testing::write_file(folder_.path() / "boxes.csv", "image,class,x1,y1,x2,y2\n" + rows);
  }

  JobManifest manifest(const std::string& sources) const {
    return parse_job_manifest(R"({"format": "eventgan-manifest", "version": 1, "name": "job",
        "sources": [)" + sources + R"(], "image": {"preset": "kitti"},
        "output": {"directory": "out"}})",
                              folder_.path(), "the manifest");
  }
  JobManifest manifest() const { return manifest(source("photos")); }
  static std::string source(const std::string& root) {
    return R"({"dataset": "frames", "root": ")" + root + R"(", "pairs": {"from": "stills"},
        "labels": {"format": "csv", "path": "boxes.csv"}})";
  }

  OutlineMasksReport make(const JobManifest& job, const std::string& out = "masks",
                          int threads = 1) {
    OutlineMasksOptions options;
    options.out = folder_.path() / out;
    options.threads = threads;
    return make_outline_masks(job, options);
  }

  cv::Mat mask(const fs::path& name) const {  // OpenCV would look colours up
    const cv::Mat colours = cv::imread((folder_.path() / name).string(), cv::IMREAD_COLOR);
    cv::Mat indices(colours.size(), CV_8U);
    for (int y = 0; y < colours.rows; ++y) {
      for (int x = 0; x < colours.cols; ++x) {
        const cv::Vec3b bgr = colours.at<cv::Vec3b>(y, x);
        indices.at<std::uint8_t>(y, x) =
            static_cast<std::uint8_t>((bgr[2] >> 7) | (bgr[1] >> 7) << 1 | (bgr[0] >> 7) << 2);
      }
    }
    return indices;
  }

  testing::TemporaryFolder folder_;
};

TEST_F(OutlineMasks, AreNumberedAsTheBoxesAndTheNearerOneCovers) {
  const OutlineMasksReport report = make(manifest());
  EXPECT_TRUE(report.complete());
  EXPECT_EQ(report.made, 2);
  EXPECT_EQ(report.outlines, (OutlineCounts{0, 2, 1}));
  EXPECT_THAT(report.of_ellipses, ElementsAre((folder_.path() / "masks/some/a.png").string()));
  const cv::Mat a = mask("masks/some/a.png");
  EXPECT_EQ(a.size(), cv::Size(80, 100));
  EXPECT_EQ(a.at<std::uint8_t>(50, 40), 1);
  EXPECT_EQ(a.at<std::uint8_t>(50, 54), 2);  // the narrow one, whose box ends lower
  EXPECT_EQ(a.at<std::uint8_t>(5, 5), 0);
  const cv::Mat b = mask("masks/more/b.png");
  EXPECT_EQ(b.at<std::uint8_t>(50, 54), 1);
}

TEST_F(OutlineMasks, AreTheSameBytesForAnyNumberOfThreads) {
  for (int i = 0; i < 8; ++i)
    write_photograph("photos/some/c" + std::to_string(i) + ".png", 10 + i);
  std::string rows;
  for (int i = 0; i < 8; ++i) rows += "some/c" + std::to_string(i) + ".png,person,18,11,62,89\n";
  write_boxes(rows);
  make(manifest(), "one", 1);
  make(manifest(), "eight", 8);
  for (int i = 0; i < 8; ++i) {
    const std::string name = "c" + std::to_string(i) + ".png";
    EXPECT_EQ(testing::read_file(folder_.path() / "one/some" / name),
              testing::read_file(folder_.path() / "eight/some" / name));
  }
}

TEST_F(OutlineMasks, ProgressCountsWhatIsMade) {
  std::ostringstream shown;
  OutlineMasksOptions options;
  options.out = folder_.path() / "masks";
  options.make_progress = [&](std::int64_t total) {
    return std::make_unique<Progress>(shown, ProgressStyle::kLines, nullptr, total);
  };
  testing::write_file(folder_.path() / "masks/some/a.png", "mended");
  make_outline_masks(manifest(), options);
  EXPECT_THAT(shown.str(), AllOf(HasSubstr("1/1 "), Not(HasSubstr("1/2 "))));
  shown.str("");
  EXPECT_EQ(make_outline_masks(manifest(), options).kept, 2);
  EXPECT_EQ(shown.str(), "");
}

TEST_F(OutlineMasks, ThatAreThereAreKept) {
  testing::write_file(folder_.path() / "masks/some/a.png", "mended");
  const OutlineMasksReport report = make(manifest());
  EXPECT_EQ(report.made, 1);
  EXPECT_EQ(report.kept, 1);
  EXPECT_EQ(testing::read_file(folder_.path() / "masks/some/a.png"), "mended");
  const OutlineMasksReport again = make(manifest());
  EXPECT_EQ(again.kept, 2);
  EXPECT_EQ(again.outlines, OutlineCounts());
}

TEST_F(OutlineMasks, WhatFailsIsNamedAndLeavesTheOthers) {
  testing::write_file(folder_.path() / "photos/more/b.png", "no image");
  write_photograph("photos/some/a.jpg", 3);
  write_boxes(
      "some/a.png,person,20,10,60,90\nsome/a.jpg,person,20,10,60,90\nmore/"
      "b.png,person,20,10,60,90\n");
  const OutlineMasksReport report = make(manifest());
  EXPECT_EQ(report.made, 1);
  ASSERT_EQ(report.faults.size(), 2u);
  EXPECT_THAT(report.faults[1],
              AllOf(HasSubstr("expected one image of"), HasSubstr("a.jpg"), HasSubstr("a.png")));
  EXPECT_THAT(report.faults[0], HasSubstr("b.png"));
  EXPECT_TRUE(report.complete());
  EXPECT_FALSE(fs::exists(folder_.path() / "masks/more/b.png"));
  EXPECT_THAT(to_text(report), HasSubstr("masks: 1 made, 0 kept, 2 failed\n"));
}

TEST_F(OutlineMasks, TellWhatToPutIntoTheManifest) {
  EXPECT_THAT(to_text(make(manifest())), HasSubstr("\"outlines\": \"masks\"\n"));
  write_photograph("others/photos/some/a.png", 4);
  const OutlineMasksReport two =
      make(manifest(source("photos") + "," + source("others/photos")), "of-both");
  EXPECT_THAT(to_text(two), AllOf(HasSubstr("\"outlines\": \"of-both/photos\"\n"),
                                  HasSubstr("\"outlines\": \"of-both/photos-2\"\n")));
  EXPECT_TRUE(fs::exists(folder_.path() / "of-both/photos-2/some/a.png"));
}

TEST_F(OutlineMasks, AreMadeUntilSomebodySaysStop) {
  OutlineMasksOptions options;
  options.out = folder_.path() / "masks";
  options.threads = 1;
  int asked = 0;
  options.stop = [&] { return ++asked > 1; };
  const OutlineMasksReport report = make_outline_masks(manifest(), options);
  EXPECT_EQ(report.made, 1);
  EXPECT_FALSE(report.complete());
}

TEST_F(OutlineMasks, NeedAPlaceForTheMasks) {
  testing::write_file(folder_.path() / "masks", "a file");
  EXPECT_THROWS(make(manifest()), std::exception, "cannot create directories");
}

}  // namespace
}  // namespace eventgan
