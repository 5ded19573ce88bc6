#include <algorithm>

#include "manifests/job_words_internal.h"
#include "manifests/source_spec_internal.h"

namespace eventgan {

PairSpec read_pairs(const StrictValue& value) {
  PairSpec spec;
  StrictObject object = value.object();
  if (const auto side = object.find("side")) spec.side = side->choice(kSideWords);
  if (const auto choose = object.find("choose")) spec.choose = choose->choice(kChoiceWords);
  if (const auto least = object.find("min_pairs")) {
    spec.min_pairs = least->integer<std::int64_t>(0, 1'000'000'000);
  }
  for (const StrictValue& element : object.at("gaps").elements(1)) {
    const auto gap = element.sound_integer(1, 6);
    if (!gap) continue;
    if (spec.side == PairSide::kAround && *gap % 2 != 0) {
      element.fault("an even gap (2, 4 or 6), since side is \"around\"");
    }
    if (std::find(spec.gaps.begin(), spec.gaps.end(), *gap) != spec.gaps.end()) {
      element.fault("each gap once");
    }
    spec.gaps.push_back(static_cast<int>(*gap));
  }
  std::sort(spec.gaps.begin(), spec.gaps.end());
  object.finish();
  return spec;
}

}  // namespace eventgan
