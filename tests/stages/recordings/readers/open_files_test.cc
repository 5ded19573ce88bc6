#include "stages/recordings/readers/detail/open_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <filesystem>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "manifests/values/faults.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

std::ptrdiff_t open_descriptors() {
  return std::distance(std::filesystem::directory_iterator("/proc/self/fd"),
                       std::filesystem::directory_iterator());
}

TEST(OpenFiles, MoreThanAProcessMayHaveOpenAreRead) {
  const testing::TemporaryFolder folder;
  rlimit limit{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &limit), 0);
  const std::ptrdiff_t before = open_descriptors();
  std::vector<std::unique_ptr<RecordingFile>> files;
  constexpr int kFiles = 2000;
  for (int i = 0; i < kFiles; ++i) {
    const std::string name = std::to_string(i);
    testing::write_file(folder / name, "file " + name);
    files.push_back(std::make_unique<RecordingFile>(folder / name));
  }
  const auto kept = std::min<std::ptrdiff_t>(static_cast<std::ptrdiff_t>(limit.rlim_cur) / 4, 1024);
  for (int turn = 0; turn < 2; ++turn) {
    EXPECT_LE(open_descriptors() - before, kept);
    for (int i = 0; i < kFiles; ++i) {
      const RecordingFile& file = *files[static_cast<std::size_t>(i)];
      ASSERT_EQ(file.read_between(5, file.end_byte()), std::to_string(i));
    }
  }
  testing::write_file(folder / "0", "file 0, longer");
  EXPECT_THROWS(files[0]->read_between(0, 1), InputError,
                "expected a file of 6 bytes as before, got 14");
  files.clear();
  EXPECT_EQ(open_descriptors(), before);
}

}  // namespace
}  // namespace eventgan
