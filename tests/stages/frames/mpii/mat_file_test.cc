#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>

#include "manifests/faults.h"
#include "stages/frames/mpii/mat_file_internal.h"
#include "tests/stages/frames/mpii/mat_writer.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::read_file;
using ::testing::ThrowsMessage;
using testing::write_file;
namespace mat = testing::mat;

class MatFileTest : public ::testing::TestWithParam<matio_compression> {
 protected:
  MatFileTest() {
    std::vector<double> values(20000);  // more than one piece of input, however well it compresses
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = 1.0 / static_cast<double>(i + 1);
    mat::write_mat(file_, "values",
                   mat::array<double>(MAT_C_DOUBLE, MAT_T_DOUBLE, values, 1, values.size()),
                   GetParam());
  }
  void expect_refused(const std::string& text) const {
    EXPECT_THAT([&] { read_mat_variable(file_, "values"); },
                ThrowsMessage<InputError>(AllOf(HasSubstr(text), HasSubstr("f.mat"))));
  }

  testing::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "f.mat";
};

INSTANTIATE_TEST_SUITE_P(Both, MatFileTest,
                         ::testing::Values(MAT_COMPRESSION_NONE, MAT_COMPRESSION_ZLIB));

TEST_P(MatFileTest, ReadsAWholeFile) {
  const MatVariable variable = read_mat_variable(file_, "values");
  ASSERT_EQ(variable->dims[1], 20000u);
  EXPECT_EQ(static_cast<const double*>(variable->data)[19999], 1.0 / 20000);
}

TEST_P(MatFileTest, RefusesAMissingVariable) {
  EXPECT_THAT([&] { read_mat_variable(file_, "RELEASE"); },
              ThrowsMessage<InputError>(HasSubstr("expected a variable RELEASE, got none, in ")));
}

TEST_P(MatFileTest, RefusesATruncatedFile) {
  const std::string bytes = read_file(file_);
  for (const std::size_t size : {bytes.size() - 1, bytes.size() / 2, std::size_t{132}}) {
    write_file(file_, std::string_view(bytes).substr(0, size));
    expect_refused("cut off at byte " + std::to_string(size));
  }
}

TEST_P(MatFileTest, RefusesTrailingBytes) {
  write_file(file_, read_file(file_) + "abc");
  expect_refused("cut off");
}

TEST(MatFile, RefusesDamagedCompressedData) {
  testing::TemporaryFolder folder;
  const auto file = folder / "f.mat";
  std::vector<double> values(20000);
  std::iota(values.begin(), values.end(), 0.5);
  mat::write_mat(file, "values", mat::array<double>(MAT_C_DOUBLE, MAT_T_DOUBLE, values, 1, 20000));
  const std::string whole = read_file(file);
  // In zlib's header, in its middle, and in the checksum at its end.
  for (const std::size_t at : {std::size_t{136}, whole.size() / 2, whole.size() - 1}) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    write_file(file, damaged);
    EXPECT_THAT([&] { read_mat_variable(file, "values"); },
                ThrowsMessage<InputError>(HasSubstr("damaged data at byte 128")))
        << at;
  }
}

TEST(MatFile, RefusesOtherFiles) {
  testing::TemporaryFolder folder;
  const auto file = folder / "f.mat";
  const auto read = [&] { read_mat_variable(file, "x"); };
  EXPECT_THAT(read, ThrowsMessage<InputError>(HasSubstr("nothing readable")));
  write_file(file, "");
  EXPECT_THAT(read, ThrowsMessage<InputError>(HasSubstr("got something else")));
  write_file(file, std::string(500, 'x'));
  EXPECT_THAT(read, ThrowsMessage<InputError>(HasSubstr("got something else")));
  std::string hdf5_header(128, ' ');
  hdf5_header.replace(124, 4, std::string("\x00\x02IM", 4));
  write_file(file, hdf5_header);
  EXPECT_THAT(read, ThrowsMessage<InputError>(HasSubstr("got version 7.3")));
}

}  // namespace
}  // namespace eventgan
