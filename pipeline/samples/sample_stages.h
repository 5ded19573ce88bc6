#pragma once

#include <memory>
#include <vector>

#include "manifests/job_manifest.h"
#include "pipeline/samples/sample_message.h"
#include "stages/frames/dataset.h"
#include "stages/frames/decoding/pair_reader.h"
#include "stages/generator/generator.h"
#include "stages/shards/codec/volume_codec.h"

namespace eventgan {

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

  /// Decodes and prepares the frames, reads the annotation, maps its labels.
  void read(SampleMessage& message) const;

  /// Runs the generator on the prepared frames.
  void generate(SampleMessage& message) const;

  /// Checks the volume and takes its statistics, normalises if asked, encodes it into the volume's
  /// frame.
  void finish(SampleMessage& message) const;

 private:
  void read_labels(SampleMessage& message, const Dataset& dataset) const;

  const JobManifest& manifest_;
  const std::vector<std::unique_ptr<Dataset>>& datasets_;
  const Generator& generator_;
  PairReader reader_;
  VolumeCodec codec_;
};

}  // namespace eventgan
