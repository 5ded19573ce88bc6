#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "manifests/faults.h"
#include "stages/recordings/ecd_image_list_internal.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class EcdImageListTest : public ::testing::Test {
 protected:
  EcdImageList read(const std::string& text) {
    testing::write_file(path_, text);
    return read_ecd_image_list(path_);
  }
  testing::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "images.txt";
};

TEST_F(EcdImageListTest, ReadsTimesAndPaths) {
  const EcdImageList list = read("0.000000000 images/frame_0.png\r\n0.04 my images/b.png \n\n");
  EXPECT_THAT(list.times_s, ElementsAre(0, 0.04));
  EXPECT_THAT(list.paths, ElementsAre("images/frame_0.png", "my images/b.png"));
  EXPECT_THAT(read("1.5\ta.png").paths, ElementsAre("a.png"));
}

TEST_F(EcdImageListTest, NamesTheLineThatIsWrong) {
  for (const char* line : {"0.5", "a.png", "0.5a.png", "0.5 ", "x a.png", "0.5 /etc/a.png",
                           "0.5 ../a.png", "0.5 images/../../a.png"}) {
    EXPECT_THAT([&] { read(std::string("0 a.png\n") + line + "\n1 c.png\n"); },
                ThrowsMessage<InputError>(HasSubstr("images.txt (line 2)")))
        << line;
  }
  EXPECT_THAT([&] { read("0 a.png\n\n1 b.png\n"); },
              ThrowsMessage<InputError>(HasSubstr("(line 2)")));
}

TEST_F(EcdImageListTest, RefusesTimesOutOfOrder) {
  EXPECT_THAT([&] { read("0 a.png\n1 b.png\n1 c.png\n"); },
              ThrowsMessage<InputError>(HasSubstr("images.txt (frame 2)")));
  EXPECT_THAT([&] { read("nan a.png\n"); }, ThrowsMessage<InputError>(HasSubstr("finite")));
}

TEST_F(EcdImageListTest, RefusesAListWithoutFramesAndNone) {
  EXPECT_THAT([&] { read(""); }, ThrowsMessage<InputError>(HasSubstr("at least one frame")));
  EXPECT_THAT([&] { read_ecd_image_list(folder_ / "absent.txt"); },
              ThrowsMessage<InputError>(HasSubstr("absent.txt")));
  EXPECT_THAT([&] { read_ecd_image_list(folder_.path()); },
              ThrowsMessage<InputError>(HasSubstr("no readable file")));
  ASSERT_EQ(::mkfifo((folder_ / "fifo").c_str(), 0600), 0);
  EXPECT_THAT([&] { read_ecd_image_list(folder_ / "fifo"); },
              ThrowsMessage<InputError>(HasSubstr("Not a regular file")));
}

}  // namespace
}  // namespace eventgan
