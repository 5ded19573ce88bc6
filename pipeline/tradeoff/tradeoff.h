#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/job.h"
#include "pipeline/runtime/progress.h"
#include "pipeline/tradeoff/configuration.h"
#include "pipeline/tradeoff/loss.h"
#include "stages/events/realism/realism_scores.h"
#include "stages/recordings/readers/recording.h"

namespace eventgan {

struct TradeoffOptions {
  TradeoffAxes axes;
  /// Leave out precisions that this processor has no instructions for, but for the manifest's own,
  /// and say so.
  bool only_native = true;
  /// What the others are compared with; none: the widest weights of the axes, float32, size 1.
  std::optional<Computation> reference;
  int pairs = 32;                                ///< of the job, ≥ 1
  int rounds = 5;                                ///< of measuring cost, ≥ 1
  int threads = 0;                               ///< 0: all cores
  std::vector<std::unique_ptr<Recording>> real;  ///< to score the configurations by, too
  std::function<bool()> stop_requested;          ///< none: never
  /// Told before the first pair how many configurations there are and how long it will take. None:
  /// silent.
  std::function<void(const std::string&)> tell;
  /// Called with the number of pairs to work through; shows progress. None: silent.
  std::function<std::unique_ptr<Progress>(std::int64_t)> make_progress;
};

/// What a configuration cost in one round. Times are processor time; nothing is written to disk.
struct RoundCost {
  double generator_s = 0;   ///< a pair
  double conversion_s = 0;  ///< a pair: read, generate, finish
  double reference_s = 0;   ///< the same of the reference in this round, with the manifest's dtype
  double pairs_per_s = 0;   ///< on all threads: cores kept busy / conversion_s
  double peak_bytes = 0;    ///< of the process, the pairs that wait left out; 0: not known
  double stored_bytes = 0;  ///< a pair, compressed
};

/// A configuration and what was measured of it.
struct Trial {
  Configuration configuration;
  std::vector<std::string> lines;  ///< for the manifest
  std::vector<PairLoss> losses;    ///< of each pair that can be compared
  std::int64_t quarantined = 0;    ///< pairs whose volume, or the reference's, is not sound
  std::vector<RoundCost> rounds;
  /// Means over its intervals, by recording.
  std::map<std::string, RealismScores> real;
};

struct RefusedComputation {
  Computation computation;
  std::string reason;
};

struct TradeoffReport {
  std::string job;        ///< the manifest's name
  std::string processor;  ///< "Intel(R) Xeon(R) Processor, avx512_core_vnni"
  int threads = 1;
  std::int64_t pairs = 0;  ///< that could be read
  Computation reference;
  StoredType reference_dtype = StoredType::kFloat16;  ///< with which its cost is measured
  Configuration own;                                  ///< the manifest's, one of the trials or none
  std::vector<std::string> skipped;                   ///< "SAMPLE: reason" of the other pairs
  std::vector<Trial> trials;
  std::vector<RefusedComputation> refused;
};

/// The axes where the user names none: the network with the shipped weights and the manifest's own
/// in all precisions, and the manifest's simulator if it has one; all else as the manifest says.
/// Not more than ten configurations.
TradeoffAxes default_axes(const JobManifest& manifest);

/// Takes pairs of a job, spread evenly over its plan, through every configuration of the axes.
///
/// Loss: each volume as it would be read back from a shard (a simulator's counts divided by their
/// η98, unless the job does that), laid on the reference's grid (on_grid), against the reference's
/// before it is stored. Real: the same volumes of a recording's frames against its events; at most
/// as many intervals as pairs, spread evenly.
///
/// Cost: in each round every computation takes its turn once, after the reference's. Reading is
/// the same for all configurations of a size and is measured apart, on pairs that follow each other
/// in the plan, since neighbours share frames; one turn of a computation serves all stored types.
///
/// Throws UsageError if no configuration or not the reference can be run, InputError if weights or
/// inputs cannot be read or no pair can, Stopped on a request to stop.
TradeoffReport measure_tradeoff(const JobManifest& manifest, const TradeoffOptions& options);

}  // namespace eventgan
