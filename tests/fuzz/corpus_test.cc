// Every input that is kept, good or bad, through every reader: it is read or refused, nothing else.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <span>

#include "stages/base/archives/cdf_matrix.h"
#include "stages/frames/mpii/detail/mat_json.h"
#include "stages/generator/checkpoints/checkpoint.h"
#include "stages/generator/safetensors.h"
#include "tests/fuzz/readers.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using Reader = void (*)(std::span<const std::uint8_t>, const std::filesystem::path&);

class FuzzCorpus : public ::testing::TestWithParam<Reader> {};

INSTANTIATE_TEST_SUITE_P(Readers, FuzzCorpus,
                         ::testing::Values(testing::read_checkpoint_input,
                                           testing::read_zip_pickle_input,
                                           testing::read_safetensors_input, testing::read_mat_input,
                                           testing::read_cdf_input));

TEST_P(FuzzCorpus, IsReadOrRefused) {
  const testing::TemporaryFolder folder;
  const std::filesystem::path corpus =
      std::filesystem::path(EVENTGAN_SOURCE_DIR) / "tests" / "fuzz" / "corpus";
  int inputs = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(corpus)) {
    if (!entry.is_regular_file()) continue;
    const std::string bytes = testing::read_file(entry.path());
    const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data());
    EXPECT_NO_THROW(GetParam()({data, bytes.size()}, folder / "input")) << entry.path();
    ++inputs;
  }
  EXPECT_GE(inputs, 10);
}

/// Else every input might be refused at its first byte, and nothing behind it be tried.
TEST(FuzzCorpusSeeds, AreReadWhereTheyAreSound) {
  const std::filesystem::path corpus =
      std::filesystem::path(EVENTGAN_SOURCE_DIR) / "tests" / "fuzz" / "corpus";
  for (const char* name : {"zip", "legacy"}) {
    EXPECT_FALSE(read_checkpoint(corpus / "checkpoint" / name, "gen").empty()) << name;
  }
  const std::string bytes = testing::read_file(corpus / "safetensors" / "two");
  EXPECT_FALSE(parse_safetensors(bytes, "two").tensors.empty());
  for (const char* name : {"plain", "big_endian", "compressed"}) {
    const MatVariable release = read_mat_variable(corpus / "mat" / name, "RELEASE");
    EXPECT_EQ(
        mat_to_json(release.array).dump(),
        R"({"annolist":[{"name":"a.jpg","x":[1,2.5]},{"name":"b","x":[]}],"img_train":[true,false]})")
        << name;
  }
  for (const char* name : {"plain", "big_endian", "packed_values", "packed_file"}) {
    const TypedArray pose = read_cdf_matrix(corpus / "cdf" / name, "Pose");
    EXPECT_EQ(pose.shape, (std::vector<std::size_t>{2, 3})) << name;
    EXPECT_EQ(std::get<std::vector<float>>(pose.values), (std::vector<float>{0, 1, 2, 3, 4, 5}))
        << name;
  }
}

}  // namespace
}  // namespace eventgan
