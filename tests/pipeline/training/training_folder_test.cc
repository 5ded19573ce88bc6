#include "pipeline/training/training_folder.h"

#include <gtest/gtest.h>

#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

TEST(TrainingFolder, DiscardsItsOwnFilesOnly) {
  const testing::TemporaryFolder root;
  const TrainingFolder folder{root.path()};
  folder.prepare();
  const std::vector<std::filesystem::path> own{folder.checkpoints() / "latest.safetensors",
                                               folder.checkpoints() / "previous.safetensors",
                                               folder.losses(),
                                               folder.curves(),
                                               folder.validation(),
                                               folder.weights(),
                                               folder.latest_weights(),
                                               folder.picture({TrainingPhase::kGenerator, 12})};
  for (const auto& file : own) testing::write_file(file, "x");
  testing::write_file(root / "notes.txt", "mine");
  testing::write_file(folder.pictures() / "mine.png", "mine");
  folder.discard();
  for (const auto& file : own) EXPECT_FALSE(std::filesystem::exists(file)) << file;
  EXPECT_TRUE(std::filesystem::exists(root / "notes.txt"));
  EXPECT_TRUE(std::filesystem::exists(folder.pictures() / "mine.png"));
}

TEST(TrainingFolder, DiscardsNothingWhereNothingIs) {
  EXPECT_NO_THROW(TrainingFolder{"/nowhere"}.discard());
}

}  // namespace
}  // namespace eventgan
