#include "stages/frames/sequences/frames_dataset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(OpenFramesDataset, OpensFoldersAndRefusesWhatIsNeitherFolderNorVideo) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "clip/1.png", "");
  testing::write_file(folder / "notes.txt", "");
  testing::write_file(folder / "broken.mp4", "");
  testing::write_file(folder / "text.mp4", std::string(4000, 'x'));
  SourceSpec spec;
  spec.root = "clip";
  EXPECT_EQ(open_frames_dataset(spec, folder.path())->labelled_frames().size(), 1u);
  for (const auto& [root, got] :
       {std::pair("notes.txt", "got something else, in "), std::pair("absent", "got nothing, in "),
        std::pair("notes.txt/absent.mp4", "got nothing, in ")}) {
    spec.root = root;
    EXPECT_THAT([&] { open_frames_dataset(spec, folder.path()); },
                ThrowsMessage<InputError>(HasSubstr(got)))
        << root;
  }
  for (const char* root : {"broken.mp4", "text.mp4"}) {
    spec.root = root;
    EXPECT_THAT([&] { open_frames_dataset(spec, folder.path()); },
                ThrowsMessage<InputError>(HasSubstr("expected a video")))
        << root;
  }
}

}  // namespace
}  // namespace eventgan
