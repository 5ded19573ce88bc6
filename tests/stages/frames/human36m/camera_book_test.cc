#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "stages/frames/human36m/camera_book_internal.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using namespace std::string_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

// A pickled numpy array of bytes, shape [n].
std::string byte_array(const std::string& bytes) {
  const std::string count(1, static_cast<char>(bytes.size()));
  return "cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x00\x85U\x01"s +
         "b\x87R(K\x01K" + count + "\x85" +
         "cnumpy\ndtype\nU\x02u1K\x00K\x01\x87R(K\x03U\x01|tb\x89U"s + count + bytes + "tb";
}

// {("S1", "7"): {CONTENT}}
std::string book(const std::string& content) {
  return "}U\x02S1U\x01"
         "7\x86}(" +
         content + "us.";
}

CameraBook read(const std::string& pickle) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "cameras.pkl", pickle);
  return read_camera_book(folder / "cameras.pkl");
}

TEST(CameraBookTest, ReadsIntrinsicsAndAllFields) {
  const CameraBook cameras =
      read(book("U\x01"
                "f" +
                byte_array("\x0b\x0c") +
                "U\x01"
                "c" +
                byte_array("\x05\x06") +
                "U\x04nameX\x04\x00\x00\x00"
                "cam1U\x01wM\xe8\x03U\x01oNU\x01xG\x3f\xf0\x00\x00\x00\x00\x00\x00"s));
  ASSERT_EQ(cameras.size(), 1u);
  const Human36mCamera& camera = cameras.at({"S1", "7"});
  EXPECT_EQ(camera.intrinsics, (Intrinsics{11, 12, 5, 6}));
  EXPECT_EQ(camera.fields.dump(),
            R"({"f":[11,12],"c":[5,6],"name":"cam1","w":1000,"o":null,"x":1.0})");
}

TEST(CameraBookTest, RefusesOtherPickles) {
  const std::string focal =
      "U\x01"
      "f" +
      byte_array("\x0b\x0c");
  const std::string centre =
      "U\x01"
      "c" +
      byte_array("\x05\x06");
  for (const std::string& pickle :
       {"N."s, "no pickle"s, ""s, "}NNs."s,
        "}U\x01"
        "aU\x01"
        "b\x86Ns."s,
        book(focal), book(centre),
        book(focal + "U\x01"
                     "cN"),
        book(focal +
             "U\x01"
             "c" +
             byte_array("\x05")),
        book(focal + centre + "U\x01x]"), "}]]\x86}(" + focal + centre + "us.",
        "cos\nsystem\n(S'true'\ntR."s}) {
    EXPECT_THAT([&] { read(pickle); },
                ThrowsMessage<InputError>(AllOf(HasSubstr("expected "), HasSubstr("cameras.pkl"))))
        << ::testing::PrintToString(pickle);
  }
}

TEST(CameraBookTest, ReadsSharedData) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const CameraBook cameras = read_camera_book(data / "human36m_lists" / "cameras.pkl");
  EXPECT_EQ(cameras.size(), 44u);  // 11 subjects with 4 cameras
  const Human36mCamera& camera = cameras.at({"S1", "54138969"});
  // As Python prints them: f = 1145.04940459, 1143.78109572; c = 512.54150496, 515.45148698.
  EXPECT_NEAR(camera.intrinsics.focal_x, 1145.04940459, 1e-8);
  EXPECT_NEAR(camera.intrinsics.focal_y, 1143.78109572, 1e-8);
  EXPECT_NEAR(camera.intrinsics.centre_x, 512.54150496, 1e-8);
  EXPECT_NEAR(camera.intrinsics.centre_y, 515.45148698, 1e-8);
}

}  // namespace
}  // namespace eventgan
