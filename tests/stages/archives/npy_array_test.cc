#include "stages/archives/npy_array.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <stdexcept>

#include "stages/archives/zip_archive.h"
#include "tests/testing/npy_bytes.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using namespace std::string_literals;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::npy_file;
using ::testing::ThrowsMessage;

TypedArray parse(const std::string& file) {
  return parse_npy(std::as_bytes(std::span(file)), "part.npy");
}

const std::string kHeader = "{'descr': '|u1', 'fortran_order': False, 'shape': (2,), }";

TEST(NpyArrayTest, ReadsEveryVersion) {
  for (const int version : {1, 2, 3}) {
    const TypedArray array = parse(npy_file(kHeader, "\x07\x08", version));
    EXPECT_THAT(array.shape, ElementsAre(2));
    EXPECT_EQ(array.number(1), 8);
  }
}

TEST(NpyArrayTest, ReadsFixturesOfDoublesAndText) {
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
    EXPECT_THAT(
        [&] { parse(npy_file(header, "ab")); },
        ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("expected "), HasSubstr("in part.npy"))))
        << header;
  }
}

TEST(NpyArrayTest, RefusesWhatIsNoNpyFile) {
  EXPECT_THROW(parse(""), std::runtime_error);
  EXPECT_THROW(parse("\x93NUMPX\x01\x00"s), std::runtime_error);
  EXPECT_THROW(parse("\x93NUMPY"), std::runtime_error);
  EXPECT_THROW(parse("\x93NUMPY\x01\x00\x10"s), std::runtime_error);
  EXPECT_THROW(parse(npy_file(kHeader, "ab", 4)), std::runtime_error);
  EXPECT_THROW(parse("\x93NUMPY\x02\x00\xff\xff\xff\xff{"s), std::runtime_error);
}

TEST(NpyArrayTest, RefusesTruncatedDataAndObjects) {
  const std::string whole = npy_file(kHeader, "ab");
  EXPECT_THROW(parse(whole.substr(0, whole.size() - 1)), std::runtime_error);
  EXPECT_THROW(parse(whole + "c"), std::runtime_error);
  EXPECT_THAT(
      [] { parse(npy_file("{'descr': '|O', 'fortran_order': False, 'shape': (1,)}", "x")); },
      ThrowsMessage<std::runtime_error>(HasSubstr("Python objects")));
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
  // The same joint stands in h36m_coco.json as 473.6835632324219.
  EXPECT_NEAR(joints.number(0), 473.6835632324219, 1e-9);
}

}  // namespace
}  // namespace eventgan
