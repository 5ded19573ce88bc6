#pragma once

#include <cstdint>
#include <functional>
#include <iosfwd>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/frames.h"

namespace eventgan {

/// One pair with its place: everything a worker needs to make the sample, decided once and for all.
struct PlannedSample {
  std::string sample_id;
  std::string sequence;
  std::string label_key;
  FramePair pair;
  /// Not empty if planning already found that the sample cannot be made (a missing frame in a
  /// sequence): it keeps its slot and is quarantined with this reason.
  std::string fault;
};

/// One output file: samples of one source and one image size, in slot order.
struct PlannedShard {
  std::string name;  ///< NAME-SPLIT-00012-of-01024.h5
  int source = 0;    ///< index into the manifest's sources
  ImageSize volume_size;
  std::vector<PlannedSample> samples;
  /// No image of its samples could be read when it was planned: volume_size is a guess. The shard
  /// takes the size that the images have once they were mended (see complete_plan), and the file
  /// itself says which.
  bool size_unknown = false;
};

/// What planning found out about one source.
struct SourceSummary {
  std::int64_t labelled_frames = 0;
  std::map<int, std::int64_t> pairs_by_gap;
  /// Labelled frames (with choose = all: frame and gap) without a paired frame, because their
  /// sequence does not reach that far, or not within pairs.max_gap_s: not an error, but never
  /// silent.
  std::int64_t unpaired = 0;
  std::vector<std::string> unpaired_ids;  ///< in the order of the source
  std::int64_t faults = 0;                ///< planned samples with a fault
  std::vector<std::string> notes;         ///< Dataset::notes(), and what planning found out besides
};

/// The notes of all sources, in their order; and what of a file is not known, if there is any.
std::vector<std::string> notes_of(const std::vector<SourceSummary>& sources,
                                  const std::set<std::string>& unknown = {});

/// For a person, at the end of a report: how many notes there are, those of what is left out (at
/// most 50), and the first few of the others, a line each. Empty if there are none.
std::string notes_text(const std::vector<std::string>& notes);

/// The frozen plan: which pair becomes which slot of which shard, and the
/// fingerprint of everything that changes bytes. The same manifest and inputs give the same plan on
/// every machine with one kind of processor and one set of libraries.
struct Plan {
  std::string name;
  std::string manifest_text;  ///< of the run that froze the plan, byte for byte; is in every shard
  std::map<std::string, std::string> fingerprint;  ///< field → value; compared field by field
  std::vector<SourceSummary> sources;
  std::vector<PlannedShard> shards;
  std::set<std::string> unknown = {};  ///< as PlanOutline's

  std::int64_t sample_count() const;
};

/// Canonical JSON: format and version, then sorted keys, no spaces but a line a sample, newline at
/// the end. Its SHA-256 is
/// the plan's hash. Goes to `sink` in pieces of about 64 KiB, since a plan of a million pairs is
/// hundreds of megabytes long. Throws std::runtime_error for names that are not UTF-8, after some
/// pieces perhaps; passes on what `sink` throws.
void write_plan(const Plan& plan, const std::function<void(std::string_view)>& sink);
std::string to_json(const Plan& plan);

/// Reads what write_plan has written, line by line, so that no more than a line is in memory
/// beside the plan. Any other layout is damage, even of the same JSON. Throws std::runtime_error
/// for the first line that is damaged, with all of its faults: "NAME:LINE: $.key: expected X, got
/// Y"; UnreadableVersion for a plan of another major version (format_version.h).
Plan read_plan(std::istream& stream, const std::string& name);
Plan parse_plan(std::string_view text, const std::string& name);

/// Lines "FIELD: expected X, got Y" for each fingerprint field that differs; empty if none does.
std::vector<std::string> fingerprint_differences(const std::map<std::string, std::string>& frozen,
                                                 const std::map<std::string, std::string>& now);

/// A planned shard without its samples.
struct ShardOutline {
  std::string name;
  int source = 0;  ///< index into the manifest's sources
  ImageSize volume_size;
  int samples = 0;
  bool size_unknown = false;  ///< see PlannedShard
  bool operator==(const ShardOutline&) const = default;
};

/// A plan without its samples: all that `status` and `finalize` need, small for any number of
/// pairs.
struct PlanOutline {
  std::string name;
  std::string manifest_text;
  std::map<std::string, std::string> fingerprint;
  std::vector<SourceSummary> sources;
  std::vector<ShardOutline> shards;
  /// Places in the file that this program does not know, of a later minor version; not written.
  std::set<std::string> unknown = {};

  std::int64_t sample_count() const;
};

ShardOutline outline_of(const PlannedShard& shard);
std::vector<ShardOutline> outlines_of(const std::vector<const PlannedShard*>& shards);
PlanOutline outline_of(const Plan& plan);

/// Reads plan.json and skips its samples, which have lines of their own: a million pairs take
/// about as long as reading the file. Throws std::runtime_error as parse_plan does; faults inside a
/// sample's line are not seen.
PlanOutline read_plan_outline(std::istream& stream, const std::string& name);

}  // namespace eventgan
