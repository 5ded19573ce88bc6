#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <tuple>

#include "manifests/image_spec_internal.h"

namespace eventgan {
namespace {

ImageSpec read(const char* text) {
  FaultList faults("m");
  const auto document = nlohmann::json::parse(text);
  const ImageSpec spec = read_image(StrictValue(document, faults));
  EXPECT_EQ(faults.text(), "");
  return spec;
}

TEST(ImageSpec, PresetsAreThoseOfThePublishedScripts) {
  const auto read_preset = [](const char* text) {
    const ImageSpec spec = read(text);
    return std::tuple(spec.preset, spec.grey, spec.blur);
  };
  EXPECT_EQ(read_preset(R"({"preset": "kitti"})"),
            std::tuple("kitti", GreyOrder::kBeforeResize, 3));
  EXPECT_EQ(read_preset(R"({"preset": "mpii"})"), std::tuple("mpii", GreyOrder::kBeforeResize, 0));
  EXPECT_EQ(read_preset(R"({"preset": "demo"})"), std::tuple("demo", GreyOrder::kAfterResize, 0));
}

TEST(ImageSpec, KeysGivenOneByOneNameNoPreset) {
  const ImageSpec spec = read(R"({"grey": "before_resize", "blur": 3})");
  EXPECT_EQ(spec.preset, "");  // though these are the numbers of "kitti"
  EXPECT_EQ(spec.grey, GreyOrder::kBeforeResize);
  EXPECT_EQ(spec.blur, 3);
}

TEST(ImageSpec, WithoutSizeEveryPictureKeepsItsOwn) {
  EXPECT_EQ(read(R"({"preset": "demo"})").size, std::nullopt);
}

}  // namespace
}  // namespace eventgan
