#include "stages/base/archives/npz_array.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <limits>
#include <span>
#include <stdexcept>
#include <thread>

#include "stages/base/archives/numpy_arrays.h"
#include "tests/testing/npy_bytes.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"
#include "tests/testing/zip_file.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;

// [3, 2, 2], element (i, j, k) = 100 i + 10 j + k + 0.5.
template <class Number>
std::vector<Number> small_flow() {
  std::vector<Number> values;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 2; ++j) {
      for (int k = 0; k < 2; ++k) values.push_back(static_cast<Number>(100 * i + 10 * j + k + 0.5));
    }
  }
  return values;
}

class NpzArrayTest : public ::testing::Test {
 protected:
  /// Opens the array "a" of a file that holds this member.
  NpzArray open(const std::string& npy, bool deflated = false) {
    testing::write_zip(file_, {{"before.npy", "x"}, {"a.npy", npy, deflated}});
    return {file_, "a"};
  }
  /// The same, of a header's text.
  NpzArray open_described(const std::string& header, const std::string& data) {
    return open(testing::npy_file(header, data));
  }

  testing::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "some.npz";
};

TEST_F(NpzArrayTest, ReadsSlicesOfStoredAndDeflatedArraysInAnyOrder) {
  for (const bool deflated : {false, true}) {
    const NpzArray doubles = open(npy_file("<f8", {3, 2, 2}, small_flow<double>()), deflated);
    EXPECT_THAT(doubles.shape(), ElementsAre(3, 2, 2));
    for (const int i : {2, 0, 1, 1}) {
      const TypedArray slice = doubles.slice(i);
      EXPECT_THAT(slice.shape, ElementsAre(2, 2));
      const double first = 100 * i + 0.5;
      EXPECT_THAT(std::get<std::vector<double>>(slice.values),
                  ElementsAre(first, first + 1, first + 10, first + 11));
    }
    const NpzArray floats = open(npy_file("<f4", {3, 2, 2}, small_flow<float>()), deflated);
    EXPECT_THAT(std::get<std::vector<float>>(floats.slice(2).values),
                ElementsAre(200.5f, 201.5f, 210.5f, 211.5f));
  }
}

TEST_F(NpzArrayTest, SlicesAreWhatParseNpyMakesOfTheWhole) {
  for (const int version : {1, 2, 3}) {
    const std::string npy = testing::npy_file(
        "{'descr': '<i2', 'fortran_order': False, 'shape': (2, 3), }", "abcdefghijkl", version);
    const TypedArray whole = parse_npy(std::as_bytes(std::span(npy)), "whole");
    const NpzArray array = open(npy);
    for (std::size_t i = 0; i < 2; ++i) {
      const TypedArray slice = array.slice(i);
      EXPECT_THAT(slice.shape, ElementsAre(3));
      for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(slice.number(k), whole.number(3 * i + k));
    }
  }
  const NpzArray texts = open(npy_texts({"ab", "", "c"}));
  EXPECT_EQ(texts.slice(2).text(0), "c");
}

TEST_F(NpzArrayTest, OfOneDimensionASliceIsASingleValue) {
  const TypedArray slice = open(testing::npy_doubles({3}, {1.5, 2.5, 3.5})).slice(1);
  EXPECT_TRUE(slice.shape.empty());
  EXPECT_EQ(slice.number(0), 2.5);
  // Both orders are one.
  const NpzArray bytes =
      open_described("{'descr': '|u1', 'fortran_order': True, 'shape': (2,), }", "\x07\x08");
  EXPECT_EQ(bytes.slice(1).number(0), 8);
}

TEST_F(NpzArrayTest, ReadsNothingBeyondTheEnd) {
  const NpzArray array = open(npy_file("<f8", {3, 2, 2}, small_flow<double>()));
  EXPECT_THROWS(array.slice(3), std::out_of_range, "expected an index below 3, got 3, in ",
                "some.npz (member a.npy)");
  EXPECT_THROWS(array.slice(std::numeric_limits<std::size_t>::max()), std::out_of_range, "below 3");
}

TEST_F(NpzArrayTest, AxesMayBeEmpty) {
  for (const bool deflated : {false, true}) {
    const NpzArray none = open(npy_file("<f8", {0, 260, 346}, std::vector<double>()), deflated);
    EXPECT_THAT(none.shape(), ElementsAre(0, 260, 346));
    EXPECT_THROWS(none.slice(0), std::out_of_range, "expected an index below 0, got 0");
    const NpzArray flat = open(npy_file("<f8", {2, 0, 3}, std::vector<double>()), deflated);
    EXPECT_THAT(flat.slice(1).shape, ElementsAre(0, 3));
    EXPECT_EQ(flat.slice(1).size(), 0u);
    EXPECT_THROWS(flat.slice(2), std::out_of_range, "below 2");
  }
}

TEST_F(NpzArrayTest, RefusesOtherArrays) {
  EXPECT_THROWS(open_described("{'descr': '<f8', 'fortran_order': True, 'shape': (2, 1), }",
                               "12345678ABCDEFGH"),
                std::runtime_error,
                ::testing::Eq("expected an array in C order, got Fortran's order, in " +
                              file_.string() + " (member a.npy)"));
  EXPECT_THROWS(open(testing::npy_doubles({}, {1})), std::runtime_error,
                "expected at least one dimension, got a single value, in ", "(member a.npy)");
  EXPECT_THROWS(
      open_described("{'descr': '>f8', 'fortran_order': False, 'shape': (1,), }", "12345678"),
      std::runtime_error, "got '>f8'", "(member a.npy)");
  EXPECT_THROWS(
      open_described("{'descr': '|O', 'fortran_order': False, 'shape': (1,), }", "12345678"),
      std::runtime_error, "Python objects", "(member a.npy)");
  EXPECT_THROWS(
      open_described("{'descr': [('t', '|u1')], 'fortran_order': False, 'shape': (1,), }", "1"),
      std::runtime_error, "got one of fields", "(member a.npy)");
  EXPECT_THROWS(open("no array"), std::runtime_error, "expected a .npy file", "(member a.npy)");
  EXPECT_THROWS(open(""), std::runtime_error, "expected a .npy file", "(member a.npy)");
  const std::string wide = "{'descr': '|u1', 'fortran_order': False, 'shape': (1,), }";
  EXPECT_EQ(open(testing::npy_file(wide + std::string(65300, ' '), "1")).slice(0).number(0), '1');
  EXPECT_THROWS(open(testing::npy_file(wide + std::string(65536, ' '), "1", 2)), std::runtime_error,
                "expected a .npy header of ", "(member a.npy)");
}

TEST_F(NpzArrayTest, RefusesAMemberOfAnotherSizeThanItsShapes) {
  const std::string whole = npy_file("<f8", {3, 2, 2}, small_flow<double>());
  for (const bool deflated : {false, true}) {
    EXPECT_THROWS(open(whole.substr(0, whole.size() - 1), deflated), std::runtime_error,
                  "expected 96 bytes for shape [3, 2, 2] of <f8, got 95, in ", "(member a.npy)");
    EXPECT_THROWS(open(whole + "x", deflated), std::runtime_error, "expected 96 bytes", "got 97");
    EXPECT_THROWS(open(whole.substr(0, 100), deflated), std::runtime_error,
                  "expected a .npy header");
  }
  // 2^61 x 8 bytes are 2^64, which 64 bits hold as 0.
  for (const char* shape : {"(2305843009213693952,)", "(4294967296, 4294967296, 2)"}) {
    EXPECT_THROWS(
        open_described(
            "{'descr': '<f8', 'fortran_order': False, 'shape': " + std::string(shape) + "}", ""),
        std::runtime_error, "expected countless bytes", "got 0");
  }
}

TEST_F(NpzArrayTest, NamesWhatIsMissing) {
  EXPECT_THROWS(NpzArray(folder_ / "absent.npz", "a"), std::runtime_error, "absent.npz");
  testing::write_zip(file_, {{"b.npy", testing::npy_doubles({1}, {1})}, {"a", "x"}});
  EXPECT_THROWS(NpzArray(file_, "a"), std::runtime_error, "expected a member of that name",
                "some.npz (member a.npy)");
}

TEST_F(NpzArrayTest, RefusesATruncatedFile) {
  const std::vector<double> values(300000, 1.5);
  for (const bool deflated : {false, true}) {
    open(npy_file("<f8", {3, 100000}, values), deflated);
    const std::string whole = testing::read_file(file_);
    for (const std::size_t size : {whole.size() / 2, whole.size() - 1, std::size_t{0}}) {
      testing::write_file(file_, whole.substr(0, size));
      EXPECT_THROWS(NpzArray(file_, "a"), std::runtime_error, "some.npz");
    }
  }
  const NpzArray array = open(npy_file("<f8", {3, 100000}, values));
  EXPECT_EQ(array.slice(2).number(99999), 1.5);
  std::filesystem::resize_file(file_, 1'700'000);  // within the third of 800,000 bytes each
  EXPECT_EQ(array.slice(1).number(99999), 1.5);
  EXPECT_THROWS(array.slice(2), std::runtime_error, "some.npz (member a.npy)");
}

TEST_F(NpzArrayTest, ThreadsMayShareIt) {
  constexpr std::size_t kSlices = 50;
  constexpr std::size_t kValues = 2000;
  std::vector<float> values(kSlices * kValues);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i);
  for (const bool deflated : {false, true}) {
    const NpzArray array = open(npy_file("<f4", {kSlices, kValues}, values), deflated);
    std::atomic<int> right = 0;
    const auto read = [&](std::size_t step) {
      for (std::size_t n = 0; n < kSlices; ++n) {
        const std::size_t i = n * step % kSlices;
        const std::vector<float> expected(values.begin() + i * kValues,
                                          values.begin() + (i + 1) * kValues);
        right += std::get<std::vector<float>>(array.slice(i).values) == expected;
      }
    };
    { const std::jthread one(read, std::size_t{1}), other(read, std::size_t{7}); }
    EXPECT_EQ(right, 100) << "each thread reads each slice once";
  }
}

}  // namespace
}  // namespace eventgan
