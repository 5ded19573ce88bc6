#include "stages/base/archives/mat_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdint>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "manifests/values/faults.h"
#include "stages/base/archives/mat_json.h"
#include "tests/stages/base/archives/mat_writer.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

namespace mat = testing::mat;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::read_file;
using ::testing::ThrowsMessage;
using testing::write_file;

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
  ASSERT_EQ(variable.array.dims, (std::vector<std::size_t>{1, 20000}));
  EXPECT_EQ(mat_element_to_json(variable.array, 19999), 1.0 / 20000);
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

// Files by hand, from "MAT-File Format" (MathWorks), level 5: little endian, elements of a tag
// (type, size in bytes) and data padded to eight bytes; up to four bytes lie in the tag itself.

std::string mat_u32(std::uint32_t value) {
  std::string bytes;
  for (int i = 0; i < 4; ++i) bytes += static_cast<char>(value >> 8 * i);
  return bytes;
}

/// `size` if the tag is to lie.
std::string element(std::uint32_t type, std::string data, std::int64_t size = -1) {
  const auto told = static_cast<std::uint32_t>(size < 0 ? data.size() : size);
  data.resize((data.size() + 7) / 8 * 8);
  return mat_u32(type) + mat_u32(told) + data;
}

/// The content of an array: flags with its class, dimensions, name, and what comes behind.
std::string array(std::uint32_t kind, const std::vector<std::uint32_t>& dims,
                  const std::string& behind, const std::string& name = "") {
  std::string sides;
  for (const std::uint32_t dim : dims) sides += mat_u32(dim);
  return element(6, mat_u32(kind) + mat_u32(0)) + element(5, sides) + element(1, name) + behind;
}

std::string file_of(const std::string& elements) {
  std::string header = "MATLAB 5.0 MAT-file";
  header.resize(124, ' ');
  return header + std::string("\x00\x01IM", 4) + elements;
}

class MatBytes : public ::testing::Test {
 protected:
  std::string outcome(const std::string& elements) const {
    write_file(file_, file_of(elements));
    try {
      return mat_to_json(read_mat_variable(file_, "v").array).dump();
    } catch (const std::runtime_error& error) {
      EXPECT_NE(std::string(error.what()).find("f.mat"), std::string::npos) << error.what();
      return "refused";
    } catch (const std::invalid_argument&) {  // of what lies deeper; its reader names the file
      return "refused";
    }
  }
  std::string outcome_of_array(const std::string& content) const {
    return outcome(element(14, content));
  }

  testing::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "f.mat";
};

constexpr std::uint32_t kCell = 1, kStruct = 2, kObject = 3, kChar = 4, kSparse = 5, kDouble = 6,
                        kInt8 = 8, kFunction = 16;

TEST_F(MatBytes, SoundArraysAreRead) {
  EXPECT_EQ(outcome_of_array(array(kDouble, {1, 3}, element(2, "\x01\x02\x03"), "v")), "[1,2,3]");
  // Three bytes in the tag itself: size in the upper half of its first word.
  EXPECT_EQ(outcome_of_array(
                array(kDouble, {1, 3}, mat_u32(3 << 16 | 2) + std::string("\1\2\3\0", 4), "v")),
            "[1,2,3]");
  EXPECT_EQ(outcome_of_array(array(kChar, {1, 2}, element(17, std::string("a\0b\0", 4)), "v")),
            "\"ab\"");
  const std::string one = element(14, array(kDouble, {1, 1}, element(2, "\x07")));
  EXPECT_EQ(outcome_of_array(array(kCell, {1, 2}, one + element(14, ""), "v")), "[7,[]]");
  const std::string names =
      mat_u32(4 << 16 | 5) + mat_u32(2) + element(1, std::string("a\0b\0", 4));
  EXPECT_EQ(outcome_of_array(array(kStruct, {1, 1}, names + one + one, "v")), R"({"a":7,"b":7})");
}

TEST_F(MatBytes, NoSizeCountOrTypeIsBelieved) {
  const std::string one = element(14, array(kDouble, {1, 1}, element(2, "\x07")));
  const std::string length = mat_u32(4 << 16 | 5) + mat_u32(2);
  const std::string names = length + element(1, std::string("a\0b\0", 4));
  const std::uint32_t huge = 0xfffffff8;
  const std::pair<const char*, std::string> table[] = {
      {"more numbers than bytes", array(kDouble, {1, 4}, element(2, "\x01\x02\x03"), "v")},
      {"fewer numbers than bytes", array(kDouble, {1, 2}, element(2, "\x01\x02\x03"), "v")},
      {"numbers of half a type", array(kDouble, {1, 1}, element(9, "\x01\x02\x03\x04"), "v")},
      {"numbers of no type", array(kDouble, {1, 1}, element(14, "\x01"), "v")},
      {"numbers beyond the array", array(kDouble, {1, 1}, element(2, "\x01", huge), "v")},
      {"five bytes in a tag",
       array(kDouble, {1, 5}, mat_u32(5 << 16 | 2) + std::string(4, '\1'), "v")},
      {"dimensions whose product overflows",
       array(kDouble, {0x80000000, 0x80000000, 4}, element(2, "\x01"), "v")},
      {"a huge dimension", array(kDouble, {1, 0x7fffffff}, element(2, "\x01"), "v")},
      {"one dimension", array(kDouble, {1}, element(2, "\x01"), "v")},
      {"nine dimensions", array(kDouble, {1, 1, 1, 1, 1, 1, 1, 1, 1}, element(2, "\x01"), "v")},
      {"text beyond its characters", array(kChar, {1, 2}, element(2, "abc"), "v")},
      {"text in UTF-32", array(kChar, {1, 1}, element(18, "abcd"), "v")},
      {"half a UTF-16 unit", array(kChar, {1, 2}, element(17, "abc"), "v")},
      {"fewer cells", array(kCell, {1, 3}, one + one, "v")},
      {"more cells", array(kCell, {1, 1}, one + one, "v")},
      {"a cell that is no array", array(kCell, {1, 1}, element(2, "\x01"), "v")},
      {"a cell beyond its cell array", array(kCell, {1, 1}, mat_u32(14) + mat_u32(huge), "v")},
      {"fewer fields", array(kStruct, {1, 1}, names + one, "v")},
      {"field names without length",
       array(kStruct, {1, 1}, mat_u32(4 << 16 | 5) + mat_u32(0) + element(1, "ab"), "v")},
      {"a negative field length",
       array(kStruct, {1, 1}, mat_u32(4 << 16 | 5) + mat_u32(0xffffffff) + element(1, "ab"), "v")},
      {"long field names",
       array(kStruct, {1, 1},
             mat_u32(4 << 16 | 5) + mat_u32(65) + element(1, std::string(65, 'a')) + one, "v")},
      {"a field twice",
       array(kStruct, {1, 1}, length + element(1, std::string("a\0a\0", 4)) + one + one, "v")},
      {"many structs without fields",
       array(kStruct, {1, 0x7fffffff}, length + element(1, ""), "v")},
      {"an object", array(kObject, {1, 1}, one, "v")},
      {"a sparse matrix", array(kSparse, {1, 1}, one, "v")},
      {"a function", array(kFunction, {1, 1}, one, "v")},
      {"flags cut short", element(6, mat_u32(kDouble))},
      {"bytes behind the array", array(kDouble, {1, 1}, element(2, "\x01") + one, "v")},
      {"a number its class does not hold",
       array(kInt8, {1, 1}, element(4, std::string("\x00\x01", 2)), "v")},
      {"a fraction in a whole class", array(kInt8, {1, 1}, element(9, std::string(8, '\1')), "v")},
  };
  for (const auto& [what, content] : table) EXPECT_EQ(outcome_of_array(content), "refused") << what;
  EXPECT_EQ(outcome(mat_u32(14) + mat_u32(huge)), "refused");
  EXPECT_EQ(outcome(element(2, "abc")), "refused");
}

TEST_F(MatBytes, ACompressedArrayOfMoreThanAGibibyteIsRefusedAtItsTag) {
  // RFC 1950 and 1951: a header, and one stored block of eight bytes; what follows is never read.
  const std::string stream =
      std::string("\x78\x01\x01\x08\x00\xf7\xff", 7) + mat_u32(14) + mat_u32(0x40000001);
  write_file(file_,
             file_of(mat_u32(15) + mat_u32(static_cast<std::uint32_t>(stream.size())) + stream));
  EXPECT_THAT(
      [&] { read_mat_variable(file_, "v"); },
      ThrowsMessage<InputError>(AllOf(
          HasSubstr("expected at most 1073741824 bytes in a compressed array, got 1073741825"),
          HasSubstr("f.mat"))));
}

TEST_F(MatBytes, NestingEndsAt32) {
  std::string content = array(kDouble, {1, 1}, element(2, "\x07"));
  for (int depth = 0; depth < 32; ++depth)
    content = array(kCell, {1, 1}, element(14, content), "v");
  EXPECT_EQ(outcome_of_array(content), std::string(32, '[') + "7" + std::string(32, ']'));
  for (int depth = 0; depth < 2000; ++depth)
    content = array(kCell, {1, 1}, element(14, content), "v");
  EXPECT_EQ(outcome_of_array(content), "refused");
}

TEST_F(MatBytes, TakesRegularFilesOnlyAndNeverWaits) {
  ASSERT_EQ(::mkfifo(file_.c_str(), 0600), 0);
  EXPECT_THAT([&] { read_mat_variable(file_, "v"); },
              ThrowsMessage<InputError>(HasSubstr("Not a regular file")));
}

/// What `value` becomes when written to a file, read, and turned into JSON.
std::string json_of(matvar_t* value, matio_compression compression = MAT_COMPRESSION_ZLIB) {
  testing::TemporaryFolder folder;
  mat::write_mat(folder / "f.mat", "value", value, compression);
  return mat_to_json(read_mat_variable(folder / "f.mat", "value").array)
      .dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

TEST(MatToJson, Numbers) {
  EXPECT_EQ(json_of(mat::number(711)), "711");
  EXPECT_EQ(json_of(mat::number(-0.25)), "-0.25");
  EXPECT_EQ(json_of(mat::number(1e300)), "1e+300");
  EXPECT_EQ(json_of(mat::byte(255)), "255");
  EXPECT_EQ(json_of(mat::array<std::int8_t>(MAT_C_INT8, MAT_T_INT8, {-128}, 1, 1)), "-128");
  EXPECT_EQ(json_of(mat::array<std::uint16_t>(MAT_C_UINT16, MAT_T_UINT16, {65535}, 1, 1)), "65535");
  EXPECT_EQ(json_of(mat::array<std::int64_t>(MAT_C_INT64, MAT_T_INT64, {9007199254740993}, 1, 1)),
            "9007199254740993");
  EXPECT_EQ(json_of(mat::array<float>(MAT_C_SINGLE, MAT_T_SINGLE, {0.5f}, 1, 1)), "0.5");
}

TEST(MatToJson, NumbersThatJsonLacksAreNull) {
  EXPECT_EQ(json_of(mat::number(std::numeric_limits<double>::quiet_NaN())), "null");
  EXPECT_EQ(json_of(mat::number(-std::numeric_limits<double>::infinity())), "null");
}

TEST(MatToJson, LogicalsAreBooleans) {
  EXPECT_EQ(json_of(mat::byte(1, MAT_F_LOGICAL)), "true");
  EXPECT_EQ(json_of(mat::byte(0, MAT_F_LOGICAL)), "false");
}

TEST(MatToJson, VectorsAreFlatAndMatricesNestedRowByRow) {
  using V = std::vector<double>;
  const auto doubles = [](const V& values, std::size_t rows, std::size_t columns) {
    return mat::array<double>(MAT_C_DOUBLE, MAT_T_DOUBLE, values, rows, columns);
  };
  EXPECT_EQ(json_of(doubles({1, 2, 3}, 1, 3)), "[1,2,3]");
  EXPECT_EQ(json_of(doubles({1, 2, 3}, 3, 1)), "[1,2,3]");
  // MATLAB stores columns: 1 2 is the first column.
  EXPECT_EQ(json_of(doubles({1, 2, 3, 4, 5, 6}, 2, 3)), "[[1,3,5],[2,4,6]]");
  EXPECT_EQ(json_of(mat::empty()), "[]");
  EXPECT_EQ(json_of(doubles({}, 0, 3)), "[]");
}

TEST(MatToJson, Text) {
  EXPECT_EQ(json_of(mat::text("soccer, \"juggling\"")), R"("soccer, \"juggling\"")");
  EXPECT_EQ(json_of(mat::text("")), R"("")");
  EXPECT_EQ(json_of(mat::array<std::uint16_t>(MAT_C_CHAR, MAT_T_UINT16, {'a', 0xE9, 0x20AC}, 1, 3)),
            "\"a\u00e9\u20ac\"");
  EXPECT_EQ(json_of(mat::array<std::uint16_t>(MAT_C_CHAR, MAT_T_UINT16, {0xD83D, 0xDE00}, 1, 2)),
            "\"\U0001F600\"");
  // Two rows "ab", "cd", stored by columns.
  EXPECT_EQ(
      json_of(mat::array<std::uint16_t>(MAT_C_CHAR, MAT_T_UINT16, {'a', 'c', 'b', 'd'}, 2, 2)),
      R"(["ab","cd"])");
}

TEST(MatToJson, InvalidTextIsMarkedNotThrown) {
  const std::string json =
      json_of(mat::array<std::uint16_t>(MAT_C_CHAR, MAT_T_UINT16, {'a', 0xD800, 'b'}, 1, 3));
  EXPECT_EQ(json.front(), '"');
  EXPECT_NE(json.find("\uFFFD"), std::string::npos);
}

TEST(MatToJson, StructsAndCells) {
  EXPECT_EQ(json_of(mat::structure({{"y", mat::number(1)}, {"x", mat::empty()}})),
            R"({"y":1,"x":[]})");
  EXPECT_EQ(json_of(mat::structs({{{"x", mat::number(1)}}, {{"x", mat::text("1")}}})),
            R"([{"x":1},{"x":"1"}])");
  EXPECT_EQ(json_of(mat::cells({mat::number(1), mat::empty(), mat::text("a")})), R"([1,[],"a"])");
  EXPECT_EQ(json_of(mat::cells({mat::number(1)})), "[1]");
  EXPECT_EQ(json_of(mat::structure({{"a", mat::structure({{"b", mat::cells({mat::byte(3)})}})}}),
                    MAT_COMPRESSION_NONE),
            R"({"a":{"b":[3]}})");
}

TEST(MatToJson, RefusesComplexNumbers) {
  double real = 1, imaginary = 2;
  mat_complex_split_t parts{&real, &imaginary};
  std::size_t dims[] = {1, 1};
  EXPECT_THROWS(
      json_of(Mat_VarCreate(nullptr, MAT_C_DOUBLE, MAT_T_DOUBLE, 2, dims, &parts, MAT_F_COMPLEX)),
      std::invalid_argument, "complex");
}

TEST(MatField, FindsFieldsOfOneStructOnly) {
  testing::TemporaryFolder folder;
  const auto read = [&](matvar_t* value) {
    mat::write_mat(folder / "f.mat", "value", value);
    return read_mat_variable(folder / "f.mat", "value");
  };
  const MatVariable one = read(mat::structure({{"a", mat::number(5)}}));
  ASSERT_TRUE(mat_field(one.array, "a"));
  EXPECT_EQ(mat_to_json(*mat_field(one.array, "a")), 5);
  EXPECT_FALSE(mat_field(one.array, "b"));
  EXPECT_FALSE(mat_field(MatArray{}, "a"));
  const MatVariable two = read(mat::structs({{{"a", mat::number(1)}}, {{"a", mat::number(2)}}}));
  EXPECT_FALSE(mat_field(two.array, "a"));
  EXPECT_EQ(two.array.size, 2u);
  EXPECT_EQ(mat_element_to_json(two.array, 1).dump(), R"({"a":2})");
}

}  // namespace
}  // namespace eventgan
