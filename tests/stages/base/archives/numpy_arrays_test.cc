#include "stages/base/archives/numpy_arrays.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <random>
#include <span>
#include <stdexcept>
#include <utility>

#include "stages/base/archives/numpy_layout.h"
#include "stages/base/archives/zip_archive.h"
#include "tests/testing/npy_bytes.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using namespace std::string_literals;
using eventgan::npy_file;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::npy_file;
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
  // Those without a type of their own are kept in a larger one.
  EXPECT_THAT(values<std::int32_t>(decode({"|i1", false, {2}}, "\x7f\x80"s)),
              ElementsAre(127, -128));
  EXPECT_THAT(values<std::int32_t>(decode({"<i2", false, {1}}, "\x00\x80"s)), ElementsAre(-32768));
  EXPECT_THAT(values<std::int32_t>(decode({"<u2", false, {1}}, "\xff\xff"s)), ElementsAre(65535));
  EXPECT_THAT(values<std::int64_t>(decode({"<u4", false, {1}}, "\xff\xff\xff\xff"s)),
              ElementsAre(4294967295));
  EXPECT_THAT(values<std::int64_t>(decode({"<u8", false, {1}}, std::string(7, '\xff') + '\x7f')),
              ElementsAre(std::numeric_limits<std::int64_t>::max()));
  EXPECT_THROWS(decode({"<u8", false, {1}}, std::string(7, '\0') + '\x80'), std::runtime_error,
                "expected numbers below 2^63, got 9223372036854775808, in x.npy");
}

std::vector<NamedArray> fields(const std::string& bytes) {
  return parse_npy_fields(std::as_bytes(std::span(bytes)), "f.npy");
}

TEST(NpyFieldsTest, ReadsTheFieldsOfAStructuredArray) {
  // As numpy writes {'t': <i2, 'name': |S2} with two bytes between them.
  constexpr char kHeader[] =
      "{'descr': [('t', '<i2'), ('', '|V2'), ('name', '|S2')], 'fortran_order': False, "
      "'shape': (2,), }";
  const std::string data = "\x01\x00??ab\xff\xff??c\0"s;
  const std::vector<NamedArray> read = fields(npy_file(kHeader, data));
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].name, "t");
  EXPECT_THAT(values<std::int32_t>(read[0].values), ElementsAre(1, -1));
  EXPECT_EQ(read[1].name, "name");
  EXPECT_THAT(values<std::string>(read[1].values), ElementsAre("ab", "c"));
  for (const auto& [bytes, what] : std::vector<std::pair<std::string, std::string>>{
           {npy_file(kHeader, data + "?"), "expected 2 rows of 6 bytes, got 13 bytes, in f.npy"},
           {npy_file("{'descr': '<i2', 'fortran_order': False, 'shape': (1,), }", "ab"),
            "expected a structured array [N], got '<i2'"},
           {npy_file("{'descr': [], 'fortran_order': False, 'shape': (1,), }", ""),
            "expected a field in the .npy header"},
           {npy_file("{'descr': [('a', '|O')], 'fortran_order': False, 'shape': (0,), }", ""),
            "expected a field of numbers or text, got '|O'"},
           {npy_file("{'descr': [('a', '<i2')], 'fortran_order': False, 'shape': (1, 1), }", "ab"),
            "got 2 dimensions"}}) {
    EXPECT_THAT([&text = bytes] { fields(text); },
                ThrowsMessage<std::runtime_error>(HasSubstr(what)));
  }
  const std::string structured = npy_file(kHeader, data);
  EXPECT_THROWS(parse_npy(std::as_bytes(std::span(structured)), "f.npy"), std::runtime_error,
                "got one of fields");
}

TEST(NumpyElementsTest, ReadsText) {
  // Three code points each: e acute and a euro sign, then padding; an empty text.
  const std::string wide = "\xe9\x00\x00\x00\xac\x20\x00\x00"s + std::string(4 + 12, '\0');
  EXPECT_THAT(values<std::string>(decode({"<U3", false, {2}}, wide)),
              ElementsAre("\xc3\xa9\xe2\x82\xac", ""));
  EXPECT_THAT(values<std::string>(decode({"|S3", false, {2}}, "ab\0abc"s)),
              ElementsAre("ab", "abc"));
  EXPECT_THAT(values<std::string>(decode({"<U0", false, {0}}, "")), ElementsAre());
  EXPECT_THROWS(decode({"<U1", false, {1}}, "\x00\xd8\x00\x00"s), std::runtime_error,
                "expected Unicode text, got code point 55296, in x.npy")
      << "a surrogate";
  EXPECT_THROWS(decode({"|S1", false, {1}}, "\xff"), std::runtime_error,
                "expected ASCII or UTF-8 text, got other bytes, in x.npy");
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
    EXPECT_THROWS(decode({"<U1", false, {1}}, wide), std::runtime_error,
                  "expected Unicode text, got code point")
        << std::uint32_t{code};
  }
}

TEST(NumpyElementsTest, RefusesMalformedText) {
  for (const std::string& bad : {"\x80"s, "\xc3"s, "\xc3("s, "\xe2\x82"s, "\xff"s,
                                 "\xc0\x81"s,          // overlong
                                 "\xe0\x80\xaf"s,      // overlong slash
                                 "\xed\xa0\x80"s,      // surrogate
                                 "\xf4\x90\x80\x80"s,  // beyond U+10FFFF
                                 "\xf8\x88\x80\x80\x80"s}) {
    EXPECT_THROWS(decode({"|S" + std::to_string(bad.size()), false, {1}}, bad), std::runtime_error,
                  "expected ASCII or UTF-8 text, got other bytes, in x.npy")
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
    EXPECT_THROWS(decode(layout, std::string(16, 'x')), std::runtime_error, "got 16, in x.npy");
  }
  EXPECT_THROWS(decode({"<U0", false, {huge}}, ""), std::runtime_error, "at least one character");
  EXPECT_THROWS(decode({"|u1", false, std::vector<std::size_t>(33, 1)}, "x"), std::runtime_error,
                "expected at most 32 dimensions, got 33, in x.npy");
}

TEST(NumpyElementsTest, RefusesOtherDtypesByName) {
  EXPECT_THROWS(decode({"|O", false, {1}}, "12345678"), std::runtime_error, "Python objects");
  for (const std::string descr :
       {"", ">f8", "<f2", "<c16", "<M8[ns]", "<U", "<Ux", "|S-1", "<U1x"}) {
    EXPECT_THROWS(decode({descr, false, {1}}, "12345678"), std::runtime_error,
                  "got '" + descr + "', in x.npy");
  }
}

TypedArray parse(const std::string& file) {
  return parse_npy(std::as_bytes(std::span(file)), "part.npy");
}

const std::string kHeader = "{'descr': '|u1', 'fortran_order': False, 'shape': (2,), }";

TEST(NpyArrayTest, ReadsEveryVersionAndFixtures) {
  for (const int version : {1, 2, 3}) {
    const TypedArray array = parse(npy_file(kHeader, "\x07\x08", version));
    EXPECT_THAT(array.shape, ElementsAre(2));
    EXPECT_EQ(array.number(1), 8);
  }
  const TypedArray numbers = parse(testing::npy_doubles({2, 2}, {1, 2, 3, 4.5}));
  EXPECT_THAT(numbers.shape, ElementsAre(2, 2));
  EXPECT_EQ(numbers.number(3), 4.5);
  const TypedArray names = parse(testing::npy_strings({"S1/a.jpg", "b"}));
  EXPECT_EQ(names.text(0), "S1/a.jpg");
  EXPECT_EQ(names.text(1), "b");
}

TEST(NpyArrayTest, ReadsTheHeaderHoweverPythonWritesIt) {
  for (const char* header :
       {"{'shape': (2,), 'fortran_order': False, 'descr': '|u1'}",
        "{\"descr\":\"|u1\",\"fortran_order\":False,\"shape\":(2,),}",
        "{ 'descr' : '|u1' , 'fortran_order' : True , 'shape' : ( 2L , ) , } \n"}) {
    EXPECT_EQ(parse(npy_file(header, "ab")).number(0), 'a') << header;
  }
  EXPECT_TRUE(
      parse(npy_file("{'descr': '|u1', 'fortran_order': False, 'shape': ()}", "a")).shape.empty());
}

TEST(NpyArrayTest, RefusesMalformedHeaders) {
  for (const char* header :
       {"", "{", "{}", "[]", "{'descr': '|u1'}", "{'descr': '|u1', 'fortran_order': False}",
        "{'descr': '|u1', 'fortran_order': False, 'shape': (2)}",
        "{'descr': '|u1', 'fortran_order': False, 'shape': (2,}",
        "{'descr': '|u1', 'fortran_order': False, 'shape': (-2,)}",
        "{'descr': '|u1', 'fortran_order': False, 'shape': (2.0,)}",
        "{'descr': '|u1', 'fortran_order': False, 'shape': (99999999999999999999,)}",
        "{'descr': '|u1', 'fortran_order': 0, 'shape': (2,)}",
        "{'descr': [('a', '|u1')], 'fortran_order': False, 'shape': (2,)}",
        "{'descr': '|u1, 'fortran_order': False, 'shape': (2,)}",
        "{'descr': '|u1', 'descr': '|u1', 'fortran_order': False, 'shape': (2,)}",
        "{'descr': '|u1', 'fortran_order': False, 'shape': (2,), 'more': 1}",
        "{'descr': '|u1', 'fortran_order': False, 'shape': (2,)} + x",
        "{'descr': __import__('os'), 'fortran_order': False, 'shape': (2,)}"}) {
    EXPECT_THROWS(parse(npy_file(header, "ab")), std::runtime_error, "expected ", "in part.npy")
        << header;
  }
}

TEST(NpyArrayTest, RefusesWhatIsNoNpyFileTruncatedDataAndObjects) {
  EXPECT_THROWS(parse(""), std::runtime_error,
                "expected a .npy file, got 0 bytes without its magic");
  EXPECT_THROWS(parse("\x93NUMPX\x01\x00"s), std::runtime_error,
                "expected a .npy file, got 8 bytes without its magic");
  EXPECT_THROWS(parse("\x93NUMPY"), std::runtime_error,
                "expected a .npy file, got 6 bytes without its magic");
  EXPECT_THROWS(parse("\x93NUMPY\x01\x00\x10"s), std::runtime_error,
                "expected a .npy header, got the end of the file, in part.npy");
  EXPECT_THROWS(parse(npy_file(kHeader, "ab", 4)), std::runtime_error,
                "expected .npy version 1-3, got 4, in part.npy");
  EXPECT_THROWS(parse("\x93NUMPY\x02\x00\xff\xff\xff\xff{"s), std::runtime_error,
                "expected a .npy header of 4294967295 bytes, got 1");
  const std::string whole = npy_file(kHeader, "ab");
  EXPECT_THROWS(parse(whole.substr(0, whole.size() - 1)), std::runtime_error,
                "expected 2 bytes for shape [2] of |u1, got 1, in part.npy");
  EXPECT_THROWS(parse(whole + "c"), std::runtime_error,
                "expected 2 bytes for shape [2] of |u1, got 3, in part.npy");
  EXPECT_THROWS(parse(npy_file("{'descr': '|O', 'fortran_order': False, 'shape': (1,)}", "x")),
                std::runtime_error, "Python objects");
}

TEST(NpyArrayTest, RandomDamageNeverCrashes) {
  const std::string valid = npy_file(kHeader, "ab");
  std::mt19937 random(7);
  int taken = 0;
  int refused = 0;
  for (int trial = 0; trial < 5000; ++trial) {
    std::string damaged = valid;
    damaged[random() % damaged.size()] = static_cast<char>(random());
    try {
      const TypedArray array = parse(damaged);
      ASSERT_EQ(std::visit([](const auto& values) { return values.size(); }, array.values),
                array.size());
      ++taken;
    } catch (const std::runtime_error& error) {
      ASSERT_THAT(error.what(), AllOf(HasSubstr("expected "), HasSubstr("in part.npy")));
      ++refused;
    }
  }
  // Data bytes and padding may be anything, the rest of the file may not.
  EXPECT_GT(taken, 0);
  EXPECT_GT(refused, 0);
  EXPECT_EQ(taken + refused, 5000);
}

TEST(NpyArrayTest, ReadsHuman36mLists) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const ZipArchive archive(data / "human36m_lists" / "test_h36m_body3d.npz");
  const TypedArray names = parse_npy(archive.read("imgname.npy"), "imgname.npy");
  ASSERT_EQ(names.size(), 4u);
  EXPECT_EQ(names.text(0), "S1/S1_Directions_1.54138969/S1_Directions_1.54138969_000001.jpg");
  const TypedArray joints = parse_npy(archive.read("part.npy"), "part.npy");
  EXPECT_THAT(joints.shape, ElementsAre(4, 17, 3));
  // The same joint is in h36m_coco.json as 473.6835632324219.
  EXPECT_NEAR(joints.number(0), 473.6835632324219, 1e-9);
}

TEST(NpyFile, IsAsNumpyWritesItAndIsReadBack) {
  const std::vector<double> values{1, 2.5, -3, 4, 5, 6};
  TypedArray array = parse(npy_file("<f8", {2, 3}, values));
  EXPECT_EQ(array.shape, (std::vector<std::size_t>{2, 3}));
  EXPECT_EQ(std::get<std::vector<double>>(array.values), values);
  const std::string file = npy_file("|u1", {3}, std::vector<std::uint8_t>{7, 8, 9});
  EXPECT_EQ(file.substr(0, 10), std::string("\x93NUMPY\x01\x00\x76\x00", 10));
  EXPECT_EQ(file.substr(10, 59), "{'descr': '|u1', 'fortran_order': False, 'shape': (3,), }  ");
  EXPECT_EQ(file.size(), 128u + 3);  // the values begin at a multiple of 64
  EXPECT_EQ(file.substr(127), "\n\x07\x08\x09");
  array = parse(npy_file("<f4", {}, std::vector<float>{0.5f}));
  EXPECT_TRUE(array.shape.empty());
  EXPECT_EQ(array.number(0), 0.5);
  EXPECT_THROWS(npy_file("<f4", {2}, std::vector<float>{1}), std::invalid_argument,
                "expected 8 bytes of an array, got 4");
}

TEST(NpyRecordsTest, HaveTheirFieldsInTheHeader) {
  constexpr char kFields[] = "[('t', '|u1'), ('', '|V1')]";
  const std::string file = npy_records(kFields, 2, "\x07\x00\x09\x00"s);
  EXPECT_EQ(file.size(), 128u + 4);
  EXPECT_THAT(file, HasSubstr("{'descr': [('t', '|u1'), ('', '|V1')], 'fortran_order': False, "
                              "'shape': (2,), }"));
  EXPECT_TRUE(file.ends_with("\n\x07\x00\x09\x00"s));
  EXPECT_THAT(npy_records(kFields, 2, ""), HasSubstr("'shape': (0,)"));
  EXPECT_THROWS(npy_records(kFields, 2, "123"), std::invalid_argument,
                "expected 2 bytes of an array, got 3");
}

TEST(NpyTexts, AreReadBackInUtf8) {
  const std::vector<std::string> texts{"S1/a", "", "\xc3\xa9t\xc3\xa9"};
  const TypedArray array = parse(npy_texts(texts));
  EXPECT_EQ(std::get<std::vector<std::string>>(array.values), texts);
  EXPECT_EQ(parse(npy_texts({"a\xff"})).text(0), "a\xef\xbf\xbd");
}

PickleDocument read(const std::string& pickle) {
  return PickleDocument(std::as_bytes(std::span(pickle)), numpy_globals(), "test.pkl");
}

// What numpy pickles: _reconstruct(ndarray, (0,), 'b'), then the state
// (1, shape, dtype, is Fortran order, bytes); the dtype is dtype(NAME, 0, 1) with the state (3,
// ORDER).
std::string pickled_array(const std::string& shape, const std::string& dtype,
                          const std::string& order, const std::string& is_fortran,
                          const std::string& bytes) {
  return "cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x00\x85U\x01"
         "b\x87R(K\x01"s +
         shape + "cnumpy\ndtype\nU\x02" + dtype + "K" + "\x00"s + "K\x01\x87R(K\x03U\x01" + order +
         "tb" + is_fortran + bytes + "tb.";
}

const std::string kDoubles =
    "\x00\x00\x00\x00\x00\x00\xf8\x3f\x00\x00\x00\x00\x00\x00\x00\xc0"s;  // 1.5, -2

TEST(PickledArrayTest, ReadsBytesOfPython2And3) {
  std::string latin1;  // the doubles' bytes as UTF-8, as Python 3 writes them for protocol 2
  for (const char c : kDoubles) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= 0x80) latin1 += static_cast<char>(0xc0 | byte >> 6);
    latin1 += static_cast<char>(byte >= 0x80 ? 0x80 | (byte & 0x3f) : byte);
  }
  const std::string encoded = "c_codecs\nencode\nX" +
                              std::string(1, static_cast<char>(latin1.size())) + "\x00\x00\x00"s +
                              latin1 + "U\x06latin1\x86R";
  for (const std::string& bytes : {"C\x10"s + kDoubles, "U\x10"s + kDoubles, encoded}) {
    const PickleDocument document = read(pickled_array("K\x02K\x01\x86", "f8", "<", "\x89", bytes));
    ASSERT_TRUE(is_pickled_array(document.root()));
    const TypedArray array = parse_pickled_array(document.root(), "test.pkl");
    EXPECT_THAT(array.shape, ElementsAre(2, 1));
    EXPECT_THAT(std::get<std::vector<double>>(array.values), ElementsAre(1.5, -2));
  }
}

TEST(PickledArrayTest, ReadsFortranOrder) {
  const PickleDocument document = read(pickled_array("K\x02K\x02\x86", "u1", "|", "\x88",
                                                     "C\x04"
                                                     "acbd"));
  EXPECT_THAT(
      std::get<std::vector<std::uint8_t>>(parse_pickled_array(document.root(), "test.pkl").values),
      ElementsAre('a', 'b', 'c', 'd'));
}

TEST(PickledArrayTest, RefusesWhatIsNoArray) {
  for (const std::string& pickle :
       {"N."s, "]."s,
        "cnumpy\ndtype\nU\x02"
        "f8\x85R."s,
        "cnumpy.core.multiarray\n_reconstruct\n)R."s,
        "cnumpy.core.multiarray\n_reconstruct\n)RN\x85"
        "b."s,
        pickled_array("K\x03\x85", "f8", "<", "\x89", "C\x10" + kDoubles),  // wrong size
        pickled_array("K\xff\x85", "f8", "<", "\x89", "N"),
        pickled_array("J\xff\xff\xff\xff\x85", "f8", "<", "\x89", "C\x10" + kDoubles),
        pickled_array("]", "f8", "<", "\x89", "C\x10" + kDoubles),
        pickled_array("K\x02\x85", "f8", ">", "\x89", "C\x10" + kDoubles),
        pickled_array("K\x02\x85", "O8", "|", "\x89", "]"),
        pickled_array("K\x02\x85", "f8", "<", "N", "C\x10" + kDoubles)}) {
    const PickleDocument document = read(pickle);
    EXPECT_THROWS(parse_pickled_array(document.root(), "test.pkl"), std::runtime_error,
                  ", in test.pkl")
        << ::testing::PrintToString(pickle);
  }
}

TEST(PickledArrayTest, ReadsCameras) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const PickleDocument document = read(testing::read_file(data / "human36m_lists" / "cameras.pkl"));
  const PickleNode& camera = *document.root().items[1];  // S1, 54138969
  const TypedArray focal = parse_pickled_array(*camera.find("f"), "cameras.pkl");
  EXPECT_THAT(focal.shape, ElementsAre(2, 1));
  // As python3 -c "import pickle; ..." prints them.
  EXPECT_NEAR(focal.number(0), 1145.04940459, 1e-8);
  EXPECT_NEAR(focal.number(1), 1143.78109572, 1e-8);
}

}  // namespace
}  // namespace eventgan
