#include "stages/frames/mpii/mpii_annotations.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>

#include "manifests/faults.h"
#include "tests/stages/frames/mpii/mpii_fixture.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;
namespace mat = testing::mat;

class MpiiAnnotationsTest : public ::testing::Test {
 protected:
  std::vector<MpiiEntry> read() const { return read_mpii_annotations(annotations_, keyframes_); }

  testing::TemporaryFolder folder_;
  std::filesystem::path annotations_ = folder_ / "mpii_human_pose_v1_u12_1.mat";
  std::filesystem::path keyframes_ = folder_ / "mpii_human_pose_v1_sequences_keyframes.mat";
};

TEST_F(MpiiAnnotationsTest, ReadsEveryEntryWhole) {
  mat::write_mpii(folder_.path(), {{"a.jpg", mat::two_persons(), true, "a/00000007.jpg"},
                                   {"b.jpg", mat::empty(), false, "b/00000001.jpg"},
                                   {"c.jpg", mat::centre_only(), false, "c/00000020.jpg"}});
  const auto entries = read();
  ASSERT_EQ(entries.size(), 3u);
  EXPECT_EQ(entries[0].image, "a.jpg");
  EXPECT_EQ(entries[0].keyframe, "a/00000007.jpg");
  EXPECT_TRUE(entries[0].is_train && entries[0].has_persons);
  EXPECT_FALSE(entries[1].is_train || entries[1].has_persons);
  EXPECT_TRUE(!entries[2].is_train && entries[2].has_persons);

  // MPII's own numbers from 1, every field also of unknown name, is_visible as it was.
  EXPECT_EQ(entries[0].json,
            R"({"image":{"name":"a.jpg"},"annorect":[{"x1":706,"y1":52,"x2":776,"y2":164,)"
            R"("annopoints":{"point":[{"x":711,"y":621,"id":0,"is_visible":1},)"
            R"({"x":715.5,"y":491,"id":1,"is_visible":"1"},)"
            R"({"x":705,"y":371,"id":2,"is_visible":[]},)"
            R"({"x":781,"y":365,"id":9,"is_visible":0}]},)"
            R"("scale":3.05,"objpos":{"x":742,"y":350},"silhouette":"kept"},)"
            R"({"x1":[],"y1":[],"x2":[],"y2":[],"annopoints":[],"scale":1.2,)"
            R"("objpos":{"x":100,"y":120},"silhouette":[]}],"frame_sec":2,"vididx":[],)"
            R"("img_train":1,"single_person":[1,2],)"
            R"("act":{"cat_name":"sports","act_name":[],"act_id":-1},)"
            R"("annolist_keyframes":{"image":{"name":"a/00000007.jpg"}}})");
  EXPECT_EQ(read_mpii_keyframes(keyframes_),
            (std::vector<std::string>{"a/00000007.jpg", "b/00000001.jpg", "c/00000020.jpg"}));
}

TEST_F(MpiiAnnotationsTest, RefusesArraysOfOtherLength) {
  mat::write_mpii(folder_.path(), {{"a.jpg", mat::empty(), true, "a/1.jpg"},
                                   {"b.jpg", mat::empty(), true, "b/1.jpg"}});
  mat::write_mat(keyframes_, "annolist_keyframes",
                 mat::structs({{{"image", mat::image("a/1.jpg")}}}));
  EXPECT_THAT([&] { read(); }, ThrowsMessage<InputError>(
                                   AllOf(HasSubstr("expected 2 elements in annolist_keyframes"),
                                         HasSubstr("got 1, in "), HasSubstr("keyframes.mat"))));
  mat::write_mat(annotations_, "RELEASE",
                 mat::structure({{"annolist", mat::structs({{{"image", mat::image("a.jpg")}}})},
                                 {"img_train", mat::empty()}}));
  EXPECT_THAT([&] { read(); },
              ThrowsMessage<InputError>(HasSubstr("expected 1 elements in img_train")));
}

TEST_F(MpiiAnnotationsTest, RefusesWhatIsNoAnnotation) {
  mat::write_mpii(folder_.path(), {{"", mat::empty(), true, ""}});
  EXPECT_THAT([&] { read(); }, ThrowsMessage<InputError>(
                                   HasSubstr("expected image.name in annolist[0], got none, in ")));
  mat::write_mat(annotations_, "RELEASE", mat::number(1));
  EXPECT_THAT([&] { read(); },
              ThrowsMessage<InputError>(HasSubstr("expected images in RELEASE.annolist")));
}

/// Without compression there is no checksum: some changes give other labels, but none may end the
/// program, take memory without bound, or let bytes from elsewhere in the file into the labels.
TEST_F(MpiiAnnotationsTest, DamageAnywhereIsRefusedByNameOrStaysWhereItIs) {
  mat::write_mpii(folder_.path(), {{"a.jpg", mat::two_persons(), true, "a/00000007.jpg"}},
                  MAT_COMPRESSION_NONE);
  const std::string sound = read().at(0).json;
  for (const auto& file : {annotations_, keyframes_}) {
    const std::string whole = testing::read_file(file);
    int refused = 0;
    const auto attempt = [&](const std::string& bytes) {
      testing::write_file(file, bytes);
      try {
        for (const MpiiEntry& entry : read()) {
          EXPECT_LE(entry.json.size(), sound.size() + 64);
        }
      } catch (const InputError& error) {
        EXPECT_THAT(error.what(), HasSubstr(file.filename().string()));
        ++refused;
      }
    };
    for (std::size_t at = 0; at < whole.size(); ++at) {
      std::string bytes = whole;
      bytes[at] = static_cast<char>(bytes[at] ^ std::array{0x01, 0x80, 0xff}[at % 3]);
      attempt(bytes);
    }
    EXPECT_GT(refused, static_cast<int>(whole.size() / 3));
    refused = 0;
    int attempts = 0;
    for (std::size_t size = 0; size < whole.size(); size += 7, ++attempts) {
      attempt(whole.substr(0, size));
    }
    EXPECT_EQ(refused, attempts);
    testing::write_file(file, whole);
  }
}

}  // namespace
}  // namespace eventgan
