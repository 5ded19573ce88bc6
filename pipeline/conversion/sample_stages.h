#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "manifests/documents/plan.h"
#include "manifests/values/input_counts.h"
#include "manifests/values/job.h"
#include "manifests/values/pair_key.h"
#include "manifests/values/shard.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/decoding/pair_reader.h"
#include "stages/generator/generator.h"
#include "stages/shards/codec/volume_codec.h"

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
  /// Position among all samples of this run, without gaps: the sequencer's key.
  std::size_t number = 0;
  const PlannedShard* shard = nullptr;
  int slot = 0;
  ShardSample sample;         ///< read: everything but statistics
  PreparedPair prepared;      ///< read → generate; of events without `input`
  OutlineCounts outlines;     ///< read → write
  bool same_image = false;    ///< generate → write: both frames are one image
  std::vector<Event> events;  ///< read → generate: of datasets of events, in pixels of the content
  /// With `events`: times of the window's first and last event, whether a crop has left them or
  /// not.
  std::array<double, 2> event_times_s{};
  std::vector<float> volume;     ///< generate → finish: [2 bins, H, W] of the content
  GenerationNotes notes;         ///< generate → write
  std::vector<std::byte> chunk;  ///< finish → write
  StageSeconds seconds{};
  std::int64_t traced_ns = 0;  ///< end of the last stage, by the trace; 0: none, or no trace

  const PlannedSample& planned() const { return shard->samples[static_cast<std::size_t>(slot)]; }
  bool failed() const { return !sample.valid; }
  InputCounts input_counts() const;  ///< of a finished one
  void fail(std::string reason);
};

/// The work on one sample, stage by stage, as plain functions without a graph. Each adds its busy
/// time to the message and turns what goes wrong with the sample into its fault. What goes wrong
/// with the run (memory is short, the generator fails) is thrown as std::runtime_error that names
/// the sample and its frames. Thread safety: all may run in parallel on different messages.
class SampleStages {
 public:
  /// All references must outlive the stages; `datasets` has one entry for each source of the
  /// manifest; `in_flight` is the number of samples that may be under way at once (see PairReader).
  SampleStages(const JobManifest& manifest, const std::vector<std::unique_ptr<Dataset>>& datasets,
               const Generator& generator, int in_flight);

  /// Decodes and prepares the frames, or reads and places the events; reads the annotation, maps
  /// its labels. Has the images of the shard's next `in_flight` samples loaded meanwhile.
  void read(SampleMessage& message) const;

  /// Runs the generator on the prepared frames; or makes the events' volume.
  void generate(SampleMessage& message) const;

  /// Adds noise if asked, checks the volume and takes its statistics, normalises if asked, encodes
  /// it into the volume's frame.
  void finish(SampleMessage& message) const;

 private:
  void read_frames(SampleMessage& message, const std::vector<Box>& boxes) const;
  void read_events(SampleMessage& message, const Dataset& dataset) const;
  /// Keeps where the source lies in the volume; fails if that is not what was planned.
  void take_placement(SampleMessage& message) const;
  void read_labels(SampleMessage& message, const Dataset& dataset,
                   Outcome<Annotation> annotation) const;
  /// Of views into the manifest and the message.
  PairKey key_of(const SampleMessage& message) const;
  /// A volume that went through `finish`, as large as that, to be overwritten; else a new one. A
  /// new vector is set to zero first, which of a large volume costs as much as a stage of ours.
  std::vector<float> take_volume(std::size_t value_count) const;

  const JobManifest& manifest_;
  const std::vector<std::unique_ptr<Dataset>>& datasets_;
  const Generator& generator_;
  std::vector<std::string> source_keys_;  ///< source_key of each source
  std::size_t in_flight_;
  PairReader reader_;
  VolumeCodec codec_;
  mutable std::mutex spare_volumes_mutex_;
  /// No more than take_volume has made, whoever made the volumes that come to `finish`.
  mutable std::vector<std::vector<float>> spare_volumes_;
  mutable std::size_t volumes_made_ = 0;
};

}  // namespace eventgan
