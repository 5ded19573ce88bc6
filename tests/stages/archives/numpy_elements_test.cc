#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <stdexcept>
#include <utility>

#include "stages/archives/numpy_elements_internal.h"

namespace eventgan {
namespace {

using namespace std::string_literals;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TypedArray decode(const NumpyLayout& layout, const std::string& data) {
  return decode_numpy_elements(layout, std::as_bytes(std::span(data)), "x.npy");
}

template <class T>
const std::vector<T>& values(const TypedArray& array) {
  return std::get<std::vector<T>>(array.values);
}

TEST(NumpyElementsTest, ReadsEveryDtype) {
  EXPECT_THAT(values<float>(decode({"<f4", false, {1}}, "\x00\x00\xc0\x3f"s)), ElementsAre(1.5f));
  EXPECT_THAT(values<double>(decode({"<f8", false, {1}}, "\x00\x00\x00\x00\x00\x00\xf8\x3f"s)),
              ElementsAre(1.5));
  EXPECT_THAT(values<std::int32_t>(decode({"<i4", false, {1}}, "\xfe\xff\xff\xff"s)),
              ElementsAre(-2));
  EXPECT_THAT(
      values<std::int64_t>(decode({"<i8", false, {1}}, "\x00\x00\x00\x00\x01\x00\x00\x00"s)),
      ElementsAre(std::int64_t{1} << 32));
  EXPECT_THAT(values<std::uint8_t>(decode({"|u1", false, {2}}, "\x00\xff"s)), ElementsAre(0, 255));
  EXPECT_THAT(values<bool>(decode({"|b1", false, {2}}, "\x00\x01"s)), ElementsAre(false, true));
}

TEST(NumpyElementsTest, ReadsText) {
  // Three code points each: e acute and a euro sign, then padding; an empty text.
  const std::string wide = "\xe9\x00\x00\x00\xac\x20\x00\x00"s + std::string(4 + 12, '\0');
  EXPECT_THAT(values<std::string>(decode({"<U3", false, {2}}, wide)),
              ElementsAre("\xc3\xa9\xe2\x82\xac", ""));
  EXPECT_THAT(values<std::string>(decode({"|S3", false, {2}}, "ab\0abc"s)),
              ElementsAre("ab", "abc"));
  EXPECT_THAT(values<std::string>(decode({"<U0", false, {0}}, "")), ElementsAre());
  EXPECT_THROW(decode({"<U1", false, {1}}, "\x00\xd8\x00\x00"s), std::runtime_error)
      << "a surrogate";
  EXPECT_THROW(decode({"|S1", false, {1}}, "\xff"), std::runtime_error);
}

TEST(NumpyElementsTest, TextMayReachTheEdgesOfEveryLengthOfUtf8) {
  // First and last code point of each length, from the table of RFC 3629; a zero would be padding.
  const std::pair<char32_t, std::string> cases[] = {
      {0x7f, "\x7f"},
      {0x80, "\xc2\x80"},
      {0x7ff, "\xdf\xbf"},
      {0x800, "\xe0\xa0\x80"},
      {0xd7ff, "\xed\x9f\xbf"},
      {0xe000, "\xee\x80\x80"},
      {0xffff, "\xef\xbf\xbf"},
      {0x10000, "\xf0\x90\x80\x80"},
      {0x10ffff, "\xf4\x8f\xbf\xbf"},
  };
  for (const auto& [code, utf8] : cases) {
    std::string wide(4, '\0');
    std::memcpy(wide.data(), &code, 4);
    EXPECT_THAT(values<std::string>(decode({"<U1", false, {1}}, wide)), ElementsAre(utf8));
    const std::string descr = "|S" + std::to_string(utf8.size());
    EXPECT_THAT(values<std::string>(decode({descr, false, {1}}, utf8)), ElementsAre(utf8));
  }
  for (const char32_t code : {0xd800, 0xdfff, 0x110000}) {
    std::string wide(4, '\0');
    std::memcpy(wide.data(), &code, 4);
    EXPECT_THROW(decode({"<U1", false, {1}}, wide), std::runtime_error) << std::uint32_t{code};
  }
}

TEST(NumpyElementsTest, RefusesMalformedText) {
  for (const std::string& bad : {"\x80"s, "\xc3"s, "\xc3("s, "\xe2\x82"s, "\xff"s,
                                 "\xc0\x81"s,          // overlong
                                 "\xe0\x80\xaf"s,      // overlong slash
                                 "\xed\xa0\x80"s,      // surrogate
                                 "\xf4\x90\x80\x80"s,  // beyond U+10FFFF
                                 "\xf8\x88\x80\x80\x80"s}) {
    EXPECT_THROW(decode({"|S" + std::to_string(bad.size()), false, {1}}, bad), std::runtime_error)
        << ::testing::PrintToString(bad);
  }
}

TEST(NumpyElementsTest, TurnsFortranOrderIntoCOrder) {
  // [2, 3, 2] with element (i, j, k) = 100 i + 10 j + k; Fortran's order runs over i first.
  std::string data;
  std::vector<std::uint8_t> expected;
  for (int k = 0; k < 2; ++k) {
    for (int j = 0; j < 3; ++j) {
      for (int i = 0; i < 2; ++i) data += static_cast<char>(100 * i + 10 * j + k);
    }
  }
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 3; ++j) {
      for (int k = 0; k < 2; ++k)
        expected.push_back(static_cast<std::uint8_t>(100 * i + 10 * j + k));
    }
  }
  EXPECT_EQ(values<std::uint8_t>(decode({"|u1", true, {2, 3, 2}}, data)), expected);
  EXPECT_THAT(values<std::string>(decode({"|S1", true, {2, 2}}, "acbd")),
              ElementsAre("a", "b", "c", "d"));
}

TEST(NumpyElementsTest, ReadsScalarsAndEmptyArrays) {
  EXPECT_THAT(values<std::uint8_t>(decode({"|u1", false, {}}, "\x05")), ElementsAre(5));
  const TypedArray empty = decode({"<f8", true, {0, 1000000, 3}}, "");
  EXPECT_EQ(empty.size(), 0u);
  EXPECT_THAT(empty.shape, ElementsAre(0, 1000000, 3));
}

TEST(NumpyElementsTest, ComparesTheSizeBeforeItAllocates) {
  const std::size_t huge = std::size_t{1} << 62;
  for (const NumpyLayout& layout :
       {NumpyLayout{"<f8", false, {3}}, NumpyLayout{"<f8", false, {1}},
        NumpyLayout{"<f8", false, {huge}},           // 2^65 bytes
        NumpyLayout{"<f8", false, {huge, huge}},     // an overflow
        NumpyLayout{"<f8", false, {huge, 4, 0, 2}},  // none, but of bytes there are 16
        NumpyLayout{"|u1", false, {huge}}, NumpyLayout{"<U4294967295", false, {huge}}}) {
    EXPECT_THAT([&] { decode(layout, std::string(16, 'x')); },
                ThrowsMessage<std::runtime_error>(HasSubstr("got 16, in x.npy")));
  }
  EXPECT_THAT(
      [&] {
        decode({"<U0", false, {huge}}, "");
      },
      ThrowsMessage<std::runtime_error>(HasSubstr("at least one character")));
  EXPECT_THROW(decode({"|u1", false, std::vector<std::size_t>(33, 1)}, "x"), std::runtime_error);
}

TEST(NumpyElementsTest, RefusesOtherDtypesByName) {
  EXPECT_THAT(
      [] {
        decode({"|O", false, {1}}, "12345678");
      },
      ThrowsMessage<std::runtime_error>(HasSubstr("Python objects")));
  for (const std::string descr :
       {"", ">f8", "<f2", "<c16", "<M8[ns]", "<U", "<Ux", "|S-1", "<U1x"}) {
    EXPECT_THAT(
        [&] {
          decode({descr, false, {1}}, "12345678");
        },
        ThrowsMessage<std::runtime_error>(HasSubstr("got '" + descr + "', in x.npy")));
  }
}

}  // namespace
}  // namespace eventgan
