#include "stages/frames/kitti/kitti_tracking_dataset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using State = Neighbour::State;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::write_file;

constexpr const char* kFirst =
    "0 2 Van 0 1 -1.79 296.7 161.7 455.2 292.3 2 1.8 4.4 -4.5 1.8 13 -2\n";
constexpr const char* kThird =
    "2 2 Van 0 1 -1.79 290.7 161.7 455.2 292.3 2 1.8 4.4 -4.5 1.8 13 -2\n";
constexpr const char* kNinth =
    "9 2 Van 0 1 -1.79 290.7 161.7 455.2 292.3 2 1.8 4.4 -4.5 1.8 13 -2\n";

/// Sequence 0001 with pictures 0..3 and labels for 0, 2 and 9; 0002 with labels alone; 0003 with
/// pictures alone.
class KittiTrackingDatasetTest : public ::testing::Test {
 protected:
  KittiTrackingDatasetTest() {
    for (const char* name :
         {"0001/000000", "0001/000001", "0001/000002", "0001/000003", "0003/000000"}) {
      write_file(folder_ / ("tracking/image_02/" + std::string(name) + ".png"), "");
    }
    write_file(folder_ / "tracking/label_02/0001.txt", std::string(kFirst) + kThird + kNinth);
    write_file(folder_ / "tracking/label_02/0002.txt", kFirst);
    spec_.root = "tracking";
  }

  std::unique_ptr<Dataset> open() const {
    return open_kitti_tracking_dataset(spec_, folder_.path());
  }

  const testing::TemporaryFolder folder_;
  SourceSpec spec_;
};

TEST_F(KittiTrackingDatasetTest, EveryPictureAndEveryLabelOfALabelledSequenceIsALabelledFrame) {
  const auto dataset = open();
  std::vector<std::string> ids;
  for (const auto& frame : dataset->labelled_frames()) ids.push_back(frame.sample_id);
  EXPECT_THAT(ids, ElementsAre("0001/000000", "0001/000001", "0001/000002", "0001/000003",
                               "0001/000009", "0002/000000"));
  const LabelledFrame& frame = dataset->labelled_frames()[2];
  EXPECT_EQ(frame.sequence, "0001");
  EXPECT_EQ(frame.label_key, "label_02/0001.txt#2");
  EXPECT_EQ(frame.frame.path, "tracking/image_02/0001/000002.png");
  EXPECT_EQ(frame.frame.index, 2);
  EXPECT_DOUBLE_EQ(frame.frame.time_s, 0.2);
  EXPECT_THAT(dataset->annotation_files(),
              ElementsAre("tracking/label_02/0001.txt", "tracking/label_02/0002.txt"));
  EXPECT_THAT(dataset->notes(), ElementsAre("1 sequences without labels in tracking/image_02"));
}

TEST_F(KittiTrackingDatasetTest, AnnotationsAreTheFramesLines) {
  const auto dataset = open();
  const auto original = [&](const std::string& key) {
    return std::get<Annotation>(dataset->annotation(key)).original;
  };
  EXPECT_EQ(original("label_02/0001.txt#0"), kFirst);
  EXPECT_EQ(original("label_02/0001.txt#1"), "");
  EXPECT_EQ(original("label_02/0001.txt#2"), kThird);
  EXPECT_EQ(dataset->label_place("label_02/0001.txt#2"), "tracking/label_02/0001.txt#2");
}

TEST_F(KittiTrackingDatasetTest, AKeyOfAnotherFormIsAFault) {
  const auto dataset = open();
  for (const char* key : {"", "#", "label_02/0001.txt", "label_02/0001.txt#", "label_02/0007.txt#0",
                          "label_02/0001.txt#x"}) {
    const auto outcome = dataset->annotation(key);
    ASSERT_TRUE(is_fault(outcome)) << key;
    EXPECT_THAT(std::get<SampleFault>(outcome).reason, HasSubstr("in tracking"));
  }
}

TEST_F(KittiTrackingDatasetTest, NeighboursAreTheSequencesPictures) {
  const auto dataset = open();
  const auto& frames = dataset->labelled_frames();
  EXPECT_EQ(dataset->neighbour(frames[2], -2).frame.path, "tracking/image_02/0001/000000.png");
  EXPECT_EQ(dataset->neighbour(frames[2], 1).state, State::kPresent);
  EXPECT_EQ(dataset->neighbour(frames[2], 2).state, State::kBeyond);
  EXPECT_EQ(dataset->neighbour(frames[2], -3).state, State::kBeyond);
}

TEST_F(KittiTrackingDatasetTest, LostPicturesAreHolesHoweverManyAreLost) {
  for (const char* name : {"000000", "000001", "000002"}) {
    std::filesystem::remove(folder_ / ("tracking/image_02/0001/" + std::string(name) + ".png"));
  }
  write_file(folder_ / "tracking/image_02/0001/000005.png", "");
  const auto dataset = open();  // 3 and 5 are left: every second frame is not what is stored
  const LabelledFrame& third = dataset->labelled_frames()[2];
  ASSERT_EQ(third.frame.index, 3);
  EXPECT_EQ(dataset->neighbour(third, 1).state, State::kHole);
  EXPECT_EQ(dataset->neighbour(third, 1).frame.path, "tracking/image_02/0001/000004.png");
  EXPECT_EQ(dataset->neighbour(third, 2).frame.index, 5);
}

TEST_F(KittiTrackingDatasetTest, ALabelWithoutAPictureIsAHole) {
  const auto dataset = open();
  const Neighbour ninth = dataset->neighbour(dataset->labelled_frames()[4], 0);
  EXPECT_EQ(ninth.state, State::kHole);
  EXPECT_EQ(ninth.frame.path, "tracking/image_02/0001/000009.png");
  const Neighbour without_folder = dataset->neighbour(dataset->labelled_frames()[5], 0);
  EXPECT_EQ(without_folder.state, State::kHole);
  EXPECT_EQ(without_folder.frame.path, "tracking/image_02/0002/000000.png");
}

TEST_F(KittiTrackingDatasetTest, NoFrameIsBeforeNumberZero) {
  std::filesystem::remove(folder_ / "tracking/image_02/0001/000000.png");
  const auto dataset = open();
  const LabelledFrame& first = dataset->labelled_frames()[0];
  EXPECT_EQ(dataset->neighbour(first, 0).state, State::kHole);
  EXPECT_EQ(dataset->neighbour(first, -1).state, State::kBeyond);
  EXPECT_EQ(dataset->neighbour(first, -1).frame.path, "");
}

TEST_F(KittiTrackingDatasetTest, FilesLeftOutAreCountedAndNamed) {
  write_file(folder_ / "tracking/label_02/0003.csv", "");
  write_file(folder_ / "tracking/image_02/0001/frame_7.png", "");
  write_file(folder_ / "tracking/image_02/0001/000002.jpg", "");
  EXPECT_THAT(open()->notes(),
              ElementsAre("2 files left out in tracking/image_02/0001: 000002.jpg, frame_7.png",
                          "1 files left out in tracking/label_02: 0003.csv",
                          "1 sequences without labels in tracking/image_02"));
}

TEST_F(KittiTrackingDatasetTest, NeedsItsFolders) {
  spec_.root = "elsewhere";
  EXPECT_THROW(open(), InputError);
  write_file(folder_ / "elsewhere/label_02/0000.txt", "");
  EXPECT_THROW(open(), InputError);
  write_file(folder_ / "elsewhere/image_02/0000/note.md", "");
  EXPECT_THAT(open()->labelled_frames(), IsEmpty());
}

TEST_F(KittiTrackingDatasetTest, AnUnreadableLabelFileIsAFaultOfItsSequenceAlone) {
  std::filesystem::remove(folder_ / "tracking/label_02/0001.txt");
  std::filesystem::create_symlink("0001.txt", folder_ / "tracking/label_02/0001.txt");
  const auto dataset = open();
  std::size_t faults = 0;
  for (const LabelledFrame& frame : dataset->labelled_frames()) {
    const auto annotation = dataset->annotation(frame.label_key);
    EXPECT_EQ(is_fault(annotation), frame.sequence == "0001") << frame.sample_id;
    if (!is_fault(annotation)) continue;
    EXPECT_EQ(std::get<SampleFault>(annotation).reason,
              "expected a readable file, got 'Too many levels of symbolic links', in "
              "tracking/label_02/0001.txt");
    ++faults;
  }
  EXPECT_EQ(faults, 4u);  // its pictures

  std::filesystem::remove(folder_ / "tracking/label_02/0001.txt");
  std::filesystem::create_directory(folder_ / "tracking/label_02/0001.txt");
  EXPECT_THAT(std::get<SampleFault>(open()->annotation("label_02/0001.txt#2")).reason,
              HasSubstr("'Is a directory', in tracking/label_02/0001.txt"));
}

}  // namespace
}  // namespace eventgan
