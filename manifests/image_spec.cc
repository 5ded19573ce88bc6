#include "manifests/image_spec_internal.h"
#include "manifests/job_words_internal.h"

namespace eventgan {
namespace {

// Below 16 pixels a side the network's four halvings leave less than one pixel of the picture at
// its bottom; above 8192 no camera of these datasets goes, so that a larger number is a slip.
constexpr int kSmallestSide = 16;
constexpr int kLargestSide = 8192;

struct Preset {
  std::string_view name;
  GreyOrder grey;
  int blur;
};

/// DESIGN section 4: the published scripts for KITTI, for MPII and Human3.6M, and for the demo.
constexpr std::array kPresetWords{Word<Preset>{"kitti", {"kitti", GreyOrder::kBeforeResize, 3}},
                                  Word<Preset>{"mpii", {"mpii", GreyOrder::kBeforeResize, 0}},
                                  Word<Preset>{"demo", {"demo", GreyOrder::kAfterResize, 0}}};

int read_blur(const StrictValue& value) {
  const int blur = value.integer(0, 31);
  if (blur == 1 || (blur > 0 && blur % 2 == 0)) value.fault("0 (no blur) or an odd integer 3..31");
  return blur;
}

}  // namespace

ImageSpec read_image(const StrictValue& value) {
  ImageSpec spec;
  StrictObject object = value.object();
  if (object.find("width") || object.find("height")) {
    spec.size = {object.at("height").integer(kSmallestSide, kLargestSide),
                 object.at("width").integer(kSmallestSide, kLargestSide)};
  }
  if (const auto fit = object.find("fit")) spec.fit = fit->choice(kFitWords);

  const auto preset = object.find("preset");
  const auto grey = object.find("grey");
  const auto blur = object.find("blur");
  if (preset) {
    const Preset chosen = preset->choice(kPresetWords);
    spec.preset = chosen.name;
    spec.grey = chosen.grey;
    spec.blur = chosen.blur;
    if (grey) grey->fault("no such key beside a preset, which decides it");
    if (blur) blur->fault("no such key beside a preset, which decides it");
  } else if (!grey && !blur) {
    object.at("preset").fault("\"kitti\", \"mpii\" or \"demo\", or else the keys grey and blur");
  } else {
    spec.grey = object.at("grey").choice(kGreyWords);
    spec.blur = read_blur(object.at("blur"));
  }
  object.finish();
  return spec;
}

}  // namespace eventgan
