#include "stages/base/archives/cdf_matrix.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>

#include "stages/base/archives/numpy_arrays.h"
#include "stages/base/archives/zip_archive.h"
#include "tests/testing/cdf_file.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using testing::cdf_bytes;
using testing::CdfMatrix;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using namespace std::string_literals;

std::vector<std::uint32_t> bits(const TypedArray& array) {
  std::vector<std::uint32_t> words;
  for (const float value : std::get<std::vector<float>>(array.values)) {
    words.push_back(std::bit_cast<std::uint32_t>(value));
  }
  return words;
}

class CdfMatrixTest : public ::testing::Test {
 protected:
  TypedArray read(const std::string& bytes, const std::string& variable = "Pose") {
    testing::write_file(folder_ / "a.cdf", bytes);
    return read_cdf_matrix(folder_ / "a.cdf", variable);
  }
  TypedArray read(const CdfMatrix& matrix) { return read(cdf_bytes(matrix)); }

  void expect_refused(const std::string& bytes, const std::string& why) {
    EXPECT_THROWS(read(bytes), std::runtime_error,
                  AllOf(StartsWith("expected "), HasSubstr(why), EndsWith("a.cdf (Pose)")));
  }

  testing::TemporaryFolder folder_;
};

/// Numbers that differ in every byte, and those whose bits are easily lost.
CdfMatrix floats() { return {2, 3, std::vector{1.2345678f, -0.0f, 3e-42f, -7e30f, INFINITY, NAN}}; }

TEST_F(CdfMatrixTest, ReadsEveryWayInWhichAMatrixIsStored) {
  const std::vector doubles{1.23456789012345678, -0.0, 3e-320, -7e300, 5.0, 6.0};
  for (const std::uint32_t encoding : {1u, 6u}) {
    for (int ways = 0; ways < 16; ++ways) {
      CdfMatrix matrix = floats();
      matrix.encoding = encoding;
      matrix.is_row_major = (ways & 1) != 0;
      matrix.packs_values = (ways & 2) != 0;
      matrix.packs_file = (ways & 4) != 0;
      matrix.room = (ways & 8) != 0 ? 6 : 0;
      const TypedArray read_floats = read(matrix);
      EXPECT_EQ(read_floats.shape, (std::vector<std::size_t>{2, 3}));
      EXPECT_EQ(bits(read_floats), bits({{}, std::get<0>(matrix.values)})) << ways;
      matrix.values = doubles;
      EXPECT_EQ(std::get<std::vector<double>>(read(matrix).values), doubles) << ways;
    }
  }
}

TEST_F(CdfMatrixTest, ReadsTheSharedFilesAsAnotherReaderDoes) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto root = data / "human36m_official";
  const ZipArchive expected(root / "expected.npz");
  int files = 0;
  for (const std::string& member : expected.names()) {  // "D2_Positions/54138969.npy"
    const std::string kind = member.substr(0, member.find('/'));
    const std::string camera = member.substr(kind.size() + 1, 8);
    const TypedArray pose = parse_npy(expected.read(member), member);
    const TypedArray matrix = read_cdf_matrix(
        root / "S1" / "MyPoseFeatures" / kind / ("Directions 1." + camera + ".cdf"), "Pose");
    EXPECT_EQ(pose.shape, (std::vector<std::size_t>{1, matrix.shape[0], matrix.shape[1]}));
    EXPECT_EQ(bits(matrix), bits(pose)) << member;
    ++files;
  }
  EXPECT_EQ(files, 4);
}

TEST_F(CdfMatrixTest, RefusesFilesOfOtherKinds) {
  const std::string bytes = cdf_bytes(floats());
  const auto with_start = [&](const std::string& magic) {
    return magic + bytes.substr(magic.size());
  };
  expect_refused("", "a CDF file of version 3, got another");
  expect_refused("no CDF at all", "a CDF file of version 3, got another");
  expect_refused(with_start("\xCD\xF2\x60\x02\x00\x00\xFF\xFF"s), "version 3");
  expect_refused(with_start("\xCD\xF3\x00\x01\xCC\xCC\x00\x02"s), "compressed or not, got neither");
  EXPECT_THROWS(read(bytes, "Pos"), std::runtime_error,
                AllOf(HasSubstr("expected a variable of that name, got none"), EndsWith("(Pos)")));
  EXPECT_THROWS(read_cdf_matrix(folder_ / "none.cdf", "Pose"), std::runtime_error, "none.cdf");
}

TEST_F(CdfMatrixTest, RefusesWhatHuman36mDoesNotUseAndWhatCannotBe) {
  using namespace testing;
  CdfMatrix packed = floats();
  packed.packs_values = true;
  const std::size_t index = kCdfValues + 12 + 24;  // behind six floats
  struct Change {
    std::size_t at;
    std::string bytes;
    const char* why;
  };
  for (const Change& change : std::initializer_list<Change>{
           {kCdfDescriptor + 8, "\0\0\0\2"s, "a file's descriptor, got a record of type 2"},
           {kCdfDescriptor + 12, "\0\0\0\0\0\xff\0\0"s, "a global descriptor within the file"},
           {kCdfDescriptor + 28, "\0\0\0\3"s, "IEEE's numbers, got 3"},  // VAX
           {kCdfDescriptor, "\0\0\0\0\0\0\0\x0b"s, "descriptor within the file, got 11 bytes"},
           {kCdfDescriptor, "\0\0\0\0\0\0\0\x10"s, "with all of its fields, got one cut short"},
           {kCdfDescriptor, "\xff\xff\xff\xff\xff\xff\xff\xff"s, "within the file"},
           {kCdfVariable + 20, "\0\0\0\x04"s, "float or double, got type 4"},
           {kCdfVariable + 24, "\xff\xff\xff\xff"s, "one record, got 0"},
           {kCdfVariable + 24, "\x7f\xff\xff\xff"s, "one record, got 2147483648"},
           {kCdfVariable + 340, "\0\0\0\3"s, "two dimensions, got 3"},
           {kCdfVariable + 344, "\0\0\0\0"s, "got 0 x 3 numbers"},
           {kCdfVariable + 344, "\x7f\xff\xff\xff\x7f\xff\xff\xff"s, "at most 67108864 bytes"},
           {kCdfVariable + 344, "\0\0\0\4"s, "a record's values with all of its fields"},
           {kCdfVariable + 356, "\0\0\0\0"s, "dimensions that vary"},
           {index + 8, "\0\0\0\7"s, "an index of records, got a record of type 7"},
           {index + 20, "\0\0\0\0"s, "one entry in the index"},
           {index + 20, "\x7f\xff\xff\xff"s, "an index of records with all of its fields"},
           {index + 24, "\0\0\0\2"s, "one entry in the index of records, got 2"},
           {index + 28, "\0\0\0\1"s, "an index of record 0 and perhaps others, got 1 to 0"},
           {index + 59, "\xff"s, "a record's values within the file"},
           {kCdfValues + 8, "\0\0\0\6"s, "a record's values, got a record of type 6"}}) {
    std::string bytes = cdf_bytes(floats());
    bytes.replace(change.at, change.bytes.size(), change.bytes);
    expect_refused(bytes, change.why);
  }
  // A list that goes round, if the name is another.
  std::string round = cdf_bytes({1, 1, std::vector{1.0f}, "Other"});
  round.replace(kCdfVariable + 12, 8, "\0\0\0\0\0\0\1\xb0"s);
  expect_refused(round, "a list of variables that ends, got one that does not");

  std::string other = cdf_bytes(packed);
  other.replace(kCdfCompression + 12, 4, "\0\0\0\1"s);
  expect_refused(other, "GZIP (5) as compression, got 1");
  const std::size_t data = kCdfValues + 24 + 10;  // behind GZIP's header
  const std::size_t checksum = cdf_bytes(packed).size() - 76 - 8;
  for (const std::size_t place : {data, checksum}) {
    std::string damaged = cdf_bytes(packed);
    damaged[place] ^= '\x10';
    expect_refused(damaged, "24 bytes of GZIP'd data with a matching checksum");
  }
}

TEST_F(CdfMatrixTest, ReadsOtherVariablesOver) {
  // The first variable's list leads on to a second one, a copy with another name, at the end.
  std::string bytes = cdf_bytes({1, 2, std::vector{1.0f, 2.0f}, "Other"});
  const std::string second = cdf_bytes({1, 2, std::vector{1.0f, 2.0f}});
  const std::size_t place = bytes.size();
  bytes += second.substr(testing::kCdfVariable, testing::kCdfValues - testing::kCdfVariable);
  bytes[testing::kCdfVariable + 18] = static_cast<char>(place >> 8);
  bytes[testing::kCdfVariable + 19] = static_cast<char>(place & 0xff);
  EXPECT_EQ(std::get<std::vector<float>>(read(bytes).values), (std::vector{1.0f, 2.0f}));
}

TEST_F(CdfMatrixTest, NeverBelievesASizeBeforeItsBytesAreThere) {
  CdfMatrix matrix{1, 1, std::vector{1.0f}};
  matrix.packs_values = true;
  std::string bytes = cdf_bytes(matrix);  // 60 MB of numbers out of some 30 bytes
  bytes.replace(testing::kCdfVariable + 344, 4, "\0\xe0\0\0"s);
  expect_refused(bytes, "bytes of GZIP'd data, got 58720256");
  matrix.packs_values = false;
  matrix.packs_file = true;
  bytes = cdf_bytes(matrix);
  bytes.replace(8 + 20, 8, "\0\0\0\0\x03\xff\xff\xff"s);
  expect_refused(bytes, "bytes of GZIP'd data, got 67108863");
}

TEST_F(CdfMatrixTest, ReadsOrRefusesWhateverIsChanged) {
  CdfMatrix matrix = floats();
  for (const bool packs : {false, true}) {
    matrix.packs_values = packs;
    const std::string sound = cdf_bytes(matrix);
    int refused = 0;
    const auto attempt = [&](const std::string& bytes) {
      try {
        EXPECT_LE(read(bytes).size(), 1u << 24);
      } catch (const std::runtime_error& error) {
        EXPECT_THAT(error.what(), AllOf(HasSubstr("expected "), HasSubstr("a.cdf")));
        ++refused;
      }
    };
    for (std::size_t at = 0; at < sound.size(); ++at) {
      for (const char value : {'\0', '\x7f', '\xff'}) {
        std::string bytes = sound;
        bytes[at] = value;
        attempt(bytes);
      }
      attempt(sound.substr(0, at));
    }
    // All that are cut short before the index, where they are not packed behind it.
    EXPECT_GE(refused, static_cast<int>(sound.size()));
  }
}

}  // namespace
}  // namespace eventgan
