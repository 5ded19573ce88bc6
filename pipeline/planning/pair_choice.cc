#include "pipeline/planning/pair_choice.h"

#include <optional>
#include <string_view>

#include "manifests/counter_random.h"

namespace eventgan {
namespace {

struct Window {
  int first = 0;        // steps from the labelled frame to the previous frame
  int last = 0;         // ... to the next frame
  double position = 1;  // of the labelled frame within the pair
};

Window window(PairSide side, int gap) {
  switch (side) {
    case PairSide::kBefore:
      return {-gap, 0, 1.0};
    case PairSide::kAfter:
      return {0, gap, 0.0};
    case PairSide::kAround:
      return {-gap / 2, gap / 2, 0.5};
  }
  return {};
}

struct Candidate {
  Neighbour::State state = Neighbour::State::kBeyond;
  PlannedSample sample;
};

/// Times are differences of large numbers: what the clock ticks off as 0.1 s may be a little more.
bool too_far_apart(const FramePair& pair, std::optional<double> max_gap_s) {
  constexpr double kTolerance_s = 1e-6;
  return max_gap_s && pair.gap_s() > *max_gap_s + kTolerance_s;  // false if a time is unknown
}

Candidate candidate(const Dataset& dataset, const LabelledFrame& frame, const PairSpec& spec,
                    int gap) {
  using State = Neighbour::State;
  const Window place = window(spec.side, gap);
  const Neighbour previous = dataset.neighbour(frame, place.first);
  const Neighbour next = dataset.neighbour(frame, place.last);

  Candidate result;
  result.sample = {frame.sample_id,
                   frame.sequence,
                   frame.label_key,
                   {previous.frame, next.frame, gap, frame.frame.index, place.position},
                   ""};
  if (too_far_apart(result.sample.pair, spec.max_gap_s)) return result;
  for (const Neighbour* neighbour : {&previous, &next}) {
    if (neighbour->state == State::kHole && result.sample.fault.empty()) {
      result.sample.fault = "expected a frame, got no file, in " + neighbour->frame.path + " (" +
                            frame.sample_id + ")";
    }
  }
  if (!result.sample.fault.empty()) {
    result.state = State::kHole;
  } else if (previous.state == State::kPresent && next.state == State::kPresent) {
    result.state = frame.fault.empty() ? State::kPresent : State::kHole;
    result.sample.fault = frame.fault;
  }
  return result;
}

PairChoiceResult choose_one(const Dataset& dataset, const LabelledFrame& frame,
                            const SourceSpec& source, std::uint64_t seed) {
  std::vector<PlannedSample> present;
  std::vector<PlannedSample> damaged;
  for (const int gap : source.pairs.gaps) {
    Candidate found = candidate(dataset, frame, source.pairs, gap);
    if (found.state == Neighbour::State::kPresent) present.push_back(std::move(found.sample));
    if (found.state == Neighbour::State::kHole) damaged.push_back(std::move(found.sample));
  }
  auto& choices = present.empty() ? damaged : present;
  if (choices.empty()) return {{}, source.pairs.gaps};
  const CounterRandom random =
      CounterRandom(seed).keyed(to_string(source.dataset)).keyed(frame.sample_id);
  return {{std::move(choices[random.below(0, choices.size())])}, {}};
}

PairChoiceResult choose_all(const Dataset& dataset, const LabelledFrame& frame,
                            const SourceSpec& source) {
  PairChoiceResult result;
  for (const int gap : source.pairs.gaps) {
    Candidate found = candidate(dataset, frame, source.pairs, gap);
    if (found.state == Neighbour::State::kBeyond) {
      result.without_partner.push_back(gap);
      continue;
    }
    found.sample.sample_id += "@" + std::string(to_string(source.pairs.side)) + std::to_string(gap);
    result.samples.push_back(std::move(found.sample));
  }
  return result;
}

}  // namespace

PairChoiceResult choose_pairs(const Dataset& dataset, const LabelledFrame& frame,
                              const SourceSpec& source, std::uint64_t seed) {
  return source.pairs.choose == PairChoice::kOne ? choose_one(dataset, frame, source, seed)
                                                 : choose_all(dataset, frame, source);
}

void renew_sample(const Dataset& dataset, const LabelledFrame& frame, const SourceSpec& source,
                  PlannedSample& sample) {
  const Window place = window(source.pairs.side, sample.pair.gap_frames);
  const auto renew = [&](FrameRef& planned, int steps) {
    const FrameRef today = dataset.neighbour(frame, steps).frame;
    if (today == planned) planned.time_s = today.time_s;
  };
  renew(sample.pair.previous, place.first);
  renew(sample.pair.next, place.last);
  sample.label_key = frame.label_key;
  if (sample.fault.empty()) sample.fault = frame.fault;
}

}  // namespace eventgan
