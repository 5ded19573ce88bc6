#include "stages/generator/weights_files/safetensors.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

namespace eventgan {
namespace {

std::string with_header(const std::string& header, const std::string& data) {
  const std::uint64_t length = header.size();
  std::string bytes(8, '\0');
  std::memcpy(bytes.data(), &length, 8);
  return bytes + header + data;
}

TEST(Safetensors, RoundTrips) {
  const SafetensorsFile content{
      {{"b", {{2, 1}, {1.5f, -2}}}, {"a", {{}, {3}}}, {"empty", {{0, 4}, {}}}},
      {{"format", "x"}, {"note", "\"quoted\" ünicode"}}};
  const std::string bytes = serialize_safetensors(content);
  const SafetensorsFile back = parse_safetensors(bytes, "test");
  EXPECT_EQ(back.metadata, content.metadata);
  ASSERT_EQ(back.tensors.size(), 3u);
  EXPECT_EQ(back.tensors.at("b").shape, (std::vector<std::int64_t>{2, 1}));
  EXPECT_EQ(back.tensors.at("b").values, (std::vector<float>{1.5f, -2}));
  EXPECT_EQ(back.tensors.at("a").values, std::vector<float>{3});
  EXPECT_EQ(serialize_safetensors(back), bytes);
}

TEST(Safetensors, HeaderIsAlignedAndTensorsHaveNoHoles) {
  const std::string bytes = serialize_safetensors({{{"t", {{1}, {1}}}}, {}});
  std::uint64_t length = 0;
  std::memcpy(&length, bytes.data(), 8);
  EXPECT_EQ(length % 8, 0u);
  EXPECT_EQ(bytes.size(), 8 + length + 4);
}

TEST(Safetensors, RefusesMalformedFiles) {
  const std::string data(4, '\0');
  const auto tensor = [](const std::string& dtype, const std::string& shape,
                         const std::string& offsets) {
    return R"({"t":{"dtype":")" + dtype + R"(","shape":)" + shape + R"(,"data_offsets":)" +
           offsets + "}}";
  };
  const std::string bad[] = {
      "",
      "1234567",
      std::string(8, '\xff'),
      with_header("{", ""),
      with_header("[]", "") + "x",
      with_header(tensor("F64", "[1]", "[0,4]"), data),
      with_header(tensor("F32", "[2]", "[0,4]"), data),
      with_header(tensor("F32", "[1]", "[4,8]"), data),
      with_header(R"({"a":{"dtype":"F32","shape":[1],"data_offsets":[0,4],"shape":[1]}})", data),
      with_header(tensor("F32", "[1]", "[4,0]"), data),
      with_header(tensor("F32", "[-1]", "[0,4]"), data),
      with_header(tensor("F32", "[1.5]", "[0,4]"), data),
      with_header(tensor("F32", "[true]", "[0,4]"), data),
      with_header(tensor("F32", "[1]", "[0,4,4]"), data),
      with_header(tensor("F32", "[0,9223372036854775808]", "[0,0]"), ""),
      with_header(tensor("F32", "[4611686018427387904,4]", "[0,4]"), data),
      with_header(tensor("F32", "[1]", "[0,4]"), data + "tail"),
      with_header(tensor("F32", "\"x\"", "[0,4]"), data),
  };
  for (const std::string& bytes : bad) {
    EXPECT_THROW(parse_safetensors(bytes, "test"), std::runtime_error)
        << bytes.substr(8 < bytes.size() ? 8 : 0);
  }
}

TEST(Safetensors, RefusesHeadersThatWouldGrow) {
  const auto message = [](const std::string& bytes) -> std::string {
    try {
      parse_safetensors(bytes, "test");
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "not refused";
  };
  EXPECT_THAT(message(with_header(R"({"a":)" + std::string(1 << 19, '['), "")),
              ::testing::HasSubstr("levels of nesting"));
  EXPECT_THAT(message(with_header(std::string((1 << 20) + 1, '{'), "")),
              ::testing::HasSubstr("at most 1048576 bytes"));
  EXPECT_THAT(message(with_header(" {}", "")), ::testing::HasSubstr("begins with {"));
}

TEST(Safetensors, WritesTensorsThatAreElsewhere) {
  const std::vector<float> values = {1, 2};
  EXPECT_EQ(serialize_safetensors({{"a", {{2}, values}}}, {{"k", "v"}}),
            serialize_safetensors({{{"a", {{2}, values}}}, {{"k", "v"}}}));
}

TEST(Safetensors, SaysWhichFileIsMissing) {
  EXPECT_THAT(
      [] { read_safetensors("/nowhere/w.safetensors"); },
      ::testing::ThrowsMessage<std::runtime_error>(::testing::HasSubstr("/nowhere/w.safetensors")));
}

}  // namespace
}  // namespace eventgan
