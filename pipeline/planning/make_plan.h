#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/documents/plan.h"
#include "manifests/values/frames.h"
#include "manifests/values/job.h"
#include "pipeline/runtime/progress.h"
#include "pipeline/runtime/trace.h"
#include "stages/frames/dataset/dataset.h"

namespace eventgan {

/// What becomes of one labelled frame.
struct PairChoiceResult {
  std::vector<PlannedSample> samples;
  /// Gaps whose paired frame lies beyond the sequence's ends or pairs.max_gap_s.
  std::vector<int> unpaired;
};

/// Chooses the frame pairs of a labelled frame.
///
/// choose = one: one of the gaps whose frames exist, drawn by (seed, dataset, source, sample id),
/// so that no other sample or order of files changes the draw; `key` is the source's (source_key).
/// choose = all: each gap; the gap and
/// side are added to the sample id as "ID@before2". A gap that meets a missing frame in the
/// sequence becomes a sample with a fault that names the missing file (choose = one: only if no gap
/// can be had). All pairs of a frame that is itself at fault (LabelledFrame::fault) have that
/// fault.
///
/// A gap of which one frame is missing and the other beyond the sequence's ends is none: it could
/// not be mended.
///
/// Of stills: the labelled frame twice, with a motion drawn likewise; the time of the moved frame
/// is not known.
///
/// Of a dataset of events: its one window, of gap 0.
PairChoiceResult choose_pairs(const Dataset& dataset, const LabelledFrame& frame,
                              const SourceSpec& source, std::uint64_t seed,
                              std::string_view key = {});

/// Gives a sample that was planned earlier what its labelled frame says today: the label's key, the
/// frames' times, and the fault of the frame, if it has one. Its frames stay.
void renew_sample(const Dataset& dataset, const LabelledFrame& frame, const SourceSpec& source,
                  PlannedSample& sample);

/// Lays samples into shards of at most `samples_per_shard`, as they come: a sample is never copied,
/// since a job has millions. A shard holds one source and one size, samples keep their order, sizes
/// come in the order of their first sample. Shards are numbered within their split, over all
/// sources.
///
/// A sample of unknown size will be quarantined; once its image is mended it may have any size,
/// and the number of shards cannot change then. So it gets a shard of its own, after the others of
/// its source, marked size_unknown; only samples that follow each other share one if they are of
/// one file (a video), or of one sequence and labels name them that has no such frames
/// (FrameRef::index -1): of these there may be as many as labels, and once they are there all most
/// likely have one size. It is a guess until then: the one that most samples of the source have
/// (the first of several; where none is known: 1x1).
class ShardLayout {
 public:
  ShardLayout(std::string name, int samples_per_shard);

  /// Samples are of this source until the next one begins.
  void begin_source(int source, const std::string& split);

  /// `volume_size` is {0, 0} if the image could not be read.
  void add(PlannedSample sample, ImageSize volume_size);

  /// The layout is empty afterwards.
  std::vector<PlannedShard> finish();

 private:
  /// The source's samples of one size.
  struct Group {
    ImageSize size;
    std::vector<PlannedShard> shards;
    std::size_t samples = 0;
  };

  Group& group(ImageSize size);
  void append(Group& group, PlannedSample sample);
  void append_unknown(PlannedSample sample);
  ImageSize most_common_size() const;
  void end_source();

  std::string name_;
  std::size_t samples_per_shard_;
  int source_ = 0;
  std::string split_;
  std::vector<Group> groups_;                               // in the order of their first sample
  std::map<std::pair<int, int>, std::size_t> group_index_;  // by height and width
  std::vector<PlannedShard> unknown_;                       // their volume_size is not set yet
  std::vector<PlannedShard> shards_;                        // of the sources that have ended
  std::vector<std::string> splits_;                         // of each of these
};

/// A plan, and the opened datasets it was made from (their annotations are read while converting).
struct PlannedJob {
  Plan plan;
  /// Of each source, how many labelled frames have no paired frame at a gap.
  std::vector<std::map<int, std::int64_t>> unpaired_by_gap;
  std::vector<std::unique_ptr<Dataset>> datasets;  ///< one for each source of the manifest
  std::vector<std::string> warnings;               ///< Dataset::warnings() of all sources
};

struct PlanningOptions {
  /// A million frames on a network file system take minutes to look at: this is asked for each, and
  /// if it says yes, Stopped is thrown. None: nobody asks.
  std::function<bool()> stop = {};
  TraceRecorder* trace = nullptr;  ///< gets what takes time; null: nobody asks
  ShowPhase show_phase = {};       ///< told of the sources, frames and files that are looked at
  /// For a trial: no more pairs than this, >= 1, the first of each source, which share it evenly.
  /// Frames behind them are not looked at.
  std::optional<std::int64_t> limit = std::nullopt;
};

/// Opens every source and decides everything that is random or depends on what is on disk. Freezes
/// and writes nothing. Throws InputError if a source is missing or yields fewer pairs than its
/// min_pairs (and than its share of the limit).
PlannedJob make_plan(const JobManifest& manifest, const std::string& weights_hash,
                     const std::string& engine, const PlanningOptions& options = {});

/// The limit of the plan that has this fingerprint; none: the whole job.
std::optional<std::int64_t> limit_of(const std::map<std::string, std::string>& fingerprint);

/// Gives every sample of a frozen plan what its labelled frame says today (renew_sample): times and
/// faults may have been mended, and the key of a label may be its row in an annotation file, where
/// rows move. A sample whose frame is not labelled any more gets a fault, since another's label may
/// are in its row. `datasets`: one for each source, opened now; null where a source is not there,
/// whose samples stay as they are.
void renew_samples(const JobManifest& manifest,
                   const std::vector<std::unique_ptr<Dataset>>& datasets, Plan& plan);

/// Puts into a frozen plan what could not be known when it was frozen, as far as the inputs tell
/// now: samples that were planned with a fault (a missing frame in their sequence) become what they
/// would be planned as today, by source and id; all others are renewed (renew_samples); shards of
/// unknown size get that of their first image that can be read. What is unknown still stays as it
/// is, and so do all slots. `datasets` as above, none null.
void complete_plan(const JobManifest& manifest,
                   const std::vector<std::unique_ptr<Dataset>>& datasets, Plan& plan);

}  // namespace eventgan
