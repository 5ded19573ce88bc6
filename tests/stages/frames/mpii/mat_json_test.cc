#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "stages/frames/mpii/mat_file_internal.h"
#include "stages/frames/mpii/mat_json_internal.h"
#include "tests/stages/frames/mpii/mat_writer.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

namespace mat = testing::mat;

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
  EXPECT_THROW(
      json_of(Mat_VarCreate(nullptr, MAT_C_DOUBLE, MAT_T_DOUBLE, 2, dims, &parts, MAT_F_COMPLEX)),
      std::invalid_argument);
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
