#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "manifests/plan.h"
#include "manifests/shard.h"
#include "stages/frames/decoding/pair_reader.h"

namespace eventgan {

/// The stages whose busy time is reported: the processor time of the threads at work in them, since
/// waiting for a disk or for another thread is not work.
enum class Stage { kRead, kGenerate, kFinish, kWrite };
inline constexpr std::size_t kStageCount = 4;
inline constexpr std::array<const char*, kStageCount> kStageNames = {"read", "generate", "finish",
                                                                     "write"};
using StageSeconds = std::array<double, kStageCount>;

/// One sample on its way through the graph. Each stage fills its part and frees what later stages
/// do not need; a fault stays in `sample.fault` and later stages pass the message on untouched, so
/// that it reaches its slot.
struct SampleMessage {
  std::size_t number =
      0;  ///< position among all samples of this run, without gaps: the sequencer's key
  const PlannedShard* shard = nullptr;
  int slot = 0;
  ShardSample sample;            ///< read: everything but statistics
  PreparedPair prepared;         ///< read → generate
  std::vector<float> volume;     ///< generate → finish: [2 bins, H, W] of the content
  std::vector<std::byte> chunk;  ///< finish → write
  StageSeconds seconds{};
  std::int64_t traced_ns = 0;  ///< end of the last stage, by the trace; 0: none, or no trace

  const PlannedSample& planned() const { return shard->samples[static_cast<std::size_t>(slot)]; }
  bool failed() const { return !sample.valid; }
  void fail(std::string reason);
};

}  // namespace eventgan
