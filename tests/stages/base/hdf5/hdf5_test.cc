#include "stages/base/hdf5/hdf5.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

#include "stages/base/hdf5/hdf5_output_file.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

TEST(Hdf5Lock, IsTakenAgainByItsOwnThreadAndWaitedForByOthers) {
  EXPECT_FALSE(Hdf5Lock::is_held());
  std::atomic<bool> in_turn{false};
  std::jthread other;
  {
    const Hdf5Lock lock;
    { const Hdf5Lock again; }
    EXPECT_TRUE(Hdf5Lock::is_held());
    other = std::jthread([&] {
      EXPECT_FALSE(Hdf5Lock::is_held());
      const Hdf5Lock lock_of_other;
      in_turn = true;
    });
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    EXPECT_FALSE(in_turn);
  }
  other.join();
  EXPECT_TRUE(in_turn);
  EXPECT_FALSE(Hdf5Lock::is_held());
}

TEST(Hdf5OutputFile, ManyThreadsWriteFilesAndReadThemBack) {
  const testing::TemporaryFolder folder;
  std::vector<std::jthread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&, i] {
      for (int round = 0; round < 10; ++round) {
        const auto path = folder / ("f" + std::to_string(i) + ".h5");
        const std::vector<std::string> texts{std::to_string(i), "", "b"};
        const std::vector<std::vector<char>> bytes{{'a', '\0'}, {}, {'c'}};
        {
          Hdf5OutputFile file(path);
          file.write([&] {
            write_dataset(file.id(), "texts", texts, {3}, 4);
            write_dataset(file.id(), "bytes", bytes, {3}, 4);
            file.close();
          });
          file.output().publish();
        }
        const Hdf5Lock lock;
        const Hdf5Handle file = open_hdf5_file(path);
        Dims dims;
        EXPECT_EQ(read_dataset<std::string>(file, "texts", dims), texts);
        EXPECT_EQ(dims, Dims{3});
        EXPECT_EQ(read_dataset<std::vector<char>>(file, "bytes", dims), bytes);
        EXPECT_THROWS(read_dataset<float>(file, "texts", dims), Hdf5Error,
                      "expected type float32 of texts, got another");
        EXPECT_THROWS(read_dataset<float>(file, "none", dims), Hdf5Error, "cannot open none");
      }
    });
  }
  threads.clear();
  EXPECT_EQ(testing::names_in(folder.path()).size(), 4u);
}

}  // namespace
}  // namespace eventgan
