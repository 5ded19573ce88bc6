#include "stages/frames/kitti/object_pictures.h"

#include <gtest/gtest.h>

#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using State = Neighbour::State;
using testing::TemporaryFolder;
using testing::write_file;

TEST(ObjectPictures, FindsThePictureAndTheThreeBeforeIt) {
  const TemporaryFolder folder;
  for (const char* name : {"image_2/001497.png", "prev_2/001497_01.png", "prev_2/001497_02.jpg",
                           "prev_2/001497_03.webp", "prev_2/001498_01.png"}) {
    write_file(folder / name, "");
  }
  const ObjectPictures pictures(SourceRoot(".", folder.path()));
  const char* expected[] = {"image_2/001497.png", "prev_2/001497_01.png", "prev_2/001497_02.jpg",
                            "prev_2/001497_03.webp"};
  for (int back = 0; back <= 3; ++back) {
    const auto place = pictures.at(1497, "001497", -back);
    EXPECT_EQ(place.state, State::kPresent);
    EXPECT_EQ(place.path, expected[back]);
  }
}

TEST(ObjectPictures, AMissingPreviousFrameIsAHoleIfOneFurtherBackIsThere) {
  const TemporaryFolder folder;
  for (const char* name : {"image_2/000001.png", "prev_2/000001_02.png"}) {
    write_file(folder / name, "");
  }
  const ObjectPictures pictures(SourceRoot(".", folder.path()));
  EXPECT_EQ(pictures.at(1, "000001", -1).state, State::kHole);
  EXPECT_EQ(pictures.at(1, "000001", -1).path, "prev_2/000001_01.png");
  EXPECT_EQ(pictures.at(1, "000001", -2).state, State::kPresent);
  EXPECT_EQ(pictures.at(1, "000001", -3).state, State::kBeyond);
}

TEST(ObjectPictures, AMissingPictureIsAHoleEvenWithoutOthers) {
  const TemporaryFolder folder;
  write_file(folder / "image_2/000001.png", "");
  const ObjectPictures pictures(SourceRoot(".", folder.path()));
  EXPECT_EQ(pictures.at(7, "000007", 0).state, State::kHole);
  EXPECT_EQ(pictures.at(7, "000007", 0).path, "image_2/000007.png");
  EXPECT_EQ(pictures.at(7, "000007", -1).state, State::kBeyond);
}

TEST(ObjectPictures, NeedsAFolderOfPictures) {
  const TemporaryFolder folder;
  EXPECT_THROW(ObjectPictures(SourceRoot(".", folder.path())), InputError);
}

}  // namespace
}  // namespace eventgan
