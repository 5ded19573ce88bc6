#include "stages/archives/pickled_array.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <span>
#include <stdexcept>

#include "tests/testing/shared_data.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using namespace std::string_literals;
using ::testing::ElementsAre;

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
    EXPECT_THROW(parse_pickled_array(document.root(), "test.pkl"), std::runtime_error)
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
