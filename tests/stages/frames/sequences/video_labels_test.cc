#include "stages/frames/sequences/video_labels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Optional;
using ::testing::Pair;
using ::testing::ThrowsMessage;

class VideoLabelsTest : public ::testing::Test {
 protected:
  std::optional<VideoLabels> read(const std::string& text) const {
    testing::write_file(folder_ / "clip.json", text);
    return read_video_labels(folder_ / "clip.json", "clip.mp4");
  }

  testing::TemporaryFolder folder_;
};

TEST_F(VideoLabelsTest, GivesEachFrameItsCompactText) {
  EXPECT_THAT(
      read(R"({ "10": { "b": 1, "a": [ 1.5 ] }, "000002": null, "0": "x" })"),
      Optional(ElementsAre(Pair(0, "\"x\""), Pair(2, "null"), Pair(10, R"({"b":1,"a":[1.5]})"))));
  EXPECT_THAT(read("{}"), Optional(IsEmpty()));
  EXPECT_THAT(read("{\"1\": 5 // five\n}"), Optional(ElementsAre(Pair(1, "5"))));
}

TEST_F(VideoLabelsTest, AManifestHoldsNoLabels) {
  EXPECT_EQ(read("// comments are allowed\n{\"name\": \"x\", \"format\": \"eventgan-manifest\"}"),
            std::nullopt);
}

TEST_F(VideoLabelsTest, RefusesMalformedFiles) {
  const std::pair<const char*, const char*> bad[] = {
      {"", "expected a JSON object"},
      {"[1]", "got array"},
      {R"({"a": 1})", "got \"a\""},
      {R"({"format": "other"})", "got \"format\""},
      {R"({"format": 1})", "got \"format\""},
      {R"({"-1": 1})", "got \"-1\""},
      {R"({"1.5": 1})", "got \"1.5\""},
      {R"({"": 1})", "got \"\""},
      {R"({"1": 1, "01": 2})", "frame 1 twice"},
      {R"({"1": 1, "1": 2})", "$.1: expected the key once"},
      {R"({"1": {"a": 1, "a": 2}})", ".a: expected the key once"}};
  for (const auto& [text, message] : bad) {
    EXPECT_THAT([&] { read(text); },
                ThrowsMessage<InputError>(AllOf(
                    HasSubstr(message), HasSubstr("clip.json (taken as the labels of clip.mp4)"))))
        << text;
  }
}

TEST_F(VideoLabelsTest, NestingWithoutEndDoesNoHarm) {
  const std::string deep = std::string(100'000, '[') + std::string(100'000, ']');
  EXPECT_THAT([&] { read("{\"1\": " + deep + "}"); },
              ThrowsMessage<InputError>(HasSubstr("levels of nesting")));
}

TEST_F(VideoLabelsTest, OfManyFramesAreReadInNoTime) {
  std::string text = "{";
  for (int i = 0; i < 200'000; ++i) text += (i == 0 ? "\"" : ",\"") + std::to_string(i) + "\":0";
  EXPECT_EQ(read(text + "}")->size(), 200'000u);
}

}  // namespace
}  // namespace eventgan
