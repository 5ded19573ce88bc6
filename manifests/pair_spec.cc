#include <algorithm>

#include "manifests/job_words_internal.h"
#include "manifests/source_spec_internal.h"

namespace eventgan {

std::vector<int> read_gaps(const StrictValue& value, PairSide side) {
  std::vector<int> gaps;
  for (const StrictValue& element : value.elements(1)) {
    const auto gap = element.sound_integer(1, 6);
    if (!gap) continue;
    if (side == PairSide::kAround && *gap % 2 != 0) {
      element.fault("an even gap (2, 4 or 6), since side is \"around\"");
    }
    if (std::find(gaps.begin(), gaps.end(), *gap) != gaps.end()) element.fault("each gap once");
    gaps.push_back(static_cast<int>(*gap));
  }
  std::sort(gaps.begin(), gaps.end());
  return gaps;
}

PairSpec read_pairs(const StrictValue& value) {
  PairSpec spec;
  StrictObject object = value.object();
  if (const auto side = object.find("side")) spec.side = side->choice(kSideWords);
  if (const auto choose = object.find("choose")) spec.choose = choose->choice(kChoiceWords);
  if (const auto least = object.find("min_pairs")) {
    spec.min_pairs = least->integer<std::int64_t>(0, 1'000'000'000);
  }
  if (const auto most = object.find("max_gap_s")) spec.max_gap_s = most->number(1e-6, 1e6);
  spec.gaps = read_gaps(object.at("gaps"), spec.side);
  object.finish();
  return spec;
}

}  // namespace eventgan
