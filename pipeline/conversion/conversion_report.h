#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "manifests/documents/commit_record.h"
#include "manifests/documents/plan.h"

namespace eventgan {

/// What a run did. Pairs and shards are those of its part, unless a field says otherwise.
struct ConversionReport {
  std::string folder;
  std::string part = "all shards";  ///< to_text(ShardPart)
  std::int64_t planned = 0;
  std::int64_t written = 0;
  std::vector<QuarantinedSample> quarantined;
  int shards_planned = 0;
  int shards_done = 0;               ///< by this run, before it, and by others meanwhile
  int shards_done_before = 0;        ///< when it started
  int shards_done_by_others = 0;     ///< by other workers while it ran
  std::vector<std::string> damaged;  ///< what was found committed and not whole, and made again
  std::vector<std::string> lost;     ///< committed by this run or before it, and gone at its end
  std::int64_t stored_bytes = 0;     ///< size of the shards
  std::map<std::string, std::int64_t> boxes;  ///< by class
  std::int64_t persons = 0;
  std::int64_t volume_bytes = 0;  ///< size of their volumes uncompressed, in the stored type
  std::map<std::string, double> stage_seconds;  ///< busy time by stage, of this run
  double wall_seconds = 0;
  bool stopped = false;    ///< a request to stop came before the part was complete
  bool finalized = false;  ///< the dataset is complete, too (see finalize)

  std::int64_t plan_pairs = 0;  ///< of the whole plan
  int plan_shards = 0;
  /// Pairs that cannot be, since a sequence ends too early (SourceSummary), and their frames.
  std::int64_t unpaired = 0;
  std::int64_t unpaired_frames = 0;
  bool is_labelled = true;         ///< a source has labels, which may be empty
  bool has_flow = false;           ///< a source has flow
  std::vector<std::string> notes;  ///< on the inputs as they are: the plan's, the part's shards'
  std::int64_t quarantined_elsewhere = 0;  ///< in other parts, when it started
  bool too_many_faults = false;  ///< the manifest's limits for quarantined samples are passed

  /// The part is.
  bool complete() const { return shards_done == shards_planned && lost.empty(); }
  std::int64_t quarantined_in_plan() const {
    return static_cast<std::int64_t>(quarantined.size()) + quarantined_elsewhere;
  }
};

/// Counts a committed shard: its pairs, what is quarantined of them, its bytes. `volume_bytes` is
/// the size of its volumes uncompressed.
void add_shard(const CommitRecord& record, std::int64_t volume_bytes, ConversionReport& report);

/// A few lines for a person; quarantined samples are listed up to a number, then counted, and the
/// last line says what to do about them.
std::string to_text(const ConversionReport& report);

/// One line of JSON.
std::string to_json(const ConversionReport& report);

}  // namespace eventgan
