#include "pipeline/library/pair_engine.h"

#include <fmt/core.h>

#include <algorithm>
#include <limits>
#include <new>
#include <stdexcept>
#include <vector>

#include "manifests/documents/job_manifest.h"
#include "manifests/files/sha256.h"
#include "manifests/values/faults.h"
#include "pipeline/runtime/memory.h"
#include "stages/events/volume_statistics.h"
#include "stages/generator/onednn/buffers.h"
#include "stages/labels/label_mapping.h"

namespace eventgan {
namespace {

/// Lays values [channel, y, x] of the pair's content into the whole volume, zeros around them.
void lay_into(std::span<const float> content, const PreparedPair& pair, std::span<float> volume) {
  const ImageSize whole = pair.placement.volume;
  std::ranges::fill(volume, 0.0f);
  const auto width = static_cast<std::size_t>(pair.content.width);
  const std::size_t channels = volume.size() / whole.pixel_count();
  for (std::size_t channel = 0; channel < channels; ++channel) {
    for (int y = 0; y < pair.content.height; ++y) {
      const std::size_t row =
          channel * static_cast<std::size_t>(pair.content.height) + static_cast<std::size_t>(y);
      const std::size_t place = (channel * static_cast<std::size_t>(whole.height) +
                                 static_cast<std::size_t>(pair.content_y + y)) *
                                    static_cast<std::size_t>(whole.width) +
                                static_cast<std::size_t>(pair.content_x);
      std::ranges::copy(content.subspan(row * width, width), volume.data() + place);
    }
  }
}

/// What stands for a sample's id, since arrays have none: the images' content.
std::string content_name(const PreparedFrame& previous, const PreparedFrame& following) {
  Sha256 hash;
  for (const PreparedFrame* frame : {&previous, &following}) {
    hash.update(std::as_bytes(std::span(frame->grey)));
  }
  return hash.hex();
}

}  // namespace

PairEngine::PairEngine(const std::string& manifest)
    : job_(parse_pair_manifest(manifest, {}, "eventgan.Generator")),
      loaded_(load_generator(job_)),
      memory_bytes_(memory_limit_bytes()) {}

VolumeShape PairEngine::shape(ImageSize source, std::size_t count, int threads) const {
  const VolumeShape shape{generator().bins(), placement(source).volume};
  const double bytes =
      static_cast<double>(shape.value_count()) * sizeof(float) *
          (static_cast<double>(count) + threads) +
      static_cast<double>(generator().working_bytes(shape.size)) * static_cast<double>(threads);
  if (bytes > static_cast<double>(memory_bytes_)) throw std::bad_alloc();
  // Asked for and given back untouched: what is not there (ulimit -v) is an error here, and the end
  // of the process inside oneDNN, which does not look.
  constexpr double kAThread = 16 << 20;  // its stack, and what oneDNN takes for itself
  const PageBuffer trial(static_cast<std::size_t>(bytes + kAThread * (threads + 1)));
  return shape;
}

bool PairEngine::draws() const {
  const GeneratorSpec& spec = job_.generator;
  return spec.noise || spec.threshold || !has_weights(spec.kind) ||
         (spec.sample && generator().thresholds());
}

/// Without labels a scope of labels would give a volume that looks as if nothing had moved.
void PairEngine::require_labels(const KnownLabels* labels) const {
  const Scope scope = job_.generator.scope.scope;
  if (scope != Scope::kLabels && scope != Scope::kLabelsOnly) return;
  if (labels && (labels->has_boxes || labels->has_joints)) return;
  throw UsageError("expected boxes or joints, which Generator.sample takes, since scope is \"" +
                   std::string(to_string(scope)) + "\", got none");
}

MadeVolume PairEngine::make(const ImagePairs& pairs, std::size_t index, const KnownLabels* labels,
                            int gap, std::uint64_t draw, std::span<float> volume) const {
  require_labels(labels);
  const PreparedFrame previous = pairs.previous.prepared(index, job_.image);
  const PreparedFrame following = pairs.following.prepared(index, job_.image);
  const std::string name = draws() ? content_name(previous, following) : "";
  const PairKey key{job_.seed, to_string(DatasetKind::kFrames), name, {}, draw};
  const PreparedPair pair = prepare_pair(previous, following);
  MadeVolume made;
  made.placement = pair.placement;
  if (labels) {
    Outcome<VolumeLabels> mapped = map_labels(labels->annotation, pair.placement, "the labels");
    if (is_fault(mapped)) throw UsageError(mapped.fault().reason);
    made.labels = std::move(*mapped);
  }
  std::vector<float> content;
  std::span<float> values = volume;
  const VolumeShape content_shape{generator().bins(), pair.content};
  if (pair.content != pair.placement.volume) {
    content.resize(content_shape.value_count());
    values = content;
  }
  made.part = generate_volume(generator(), job_.generator, key, pair, made.labels, values);
  const bool has_noise = add_pair_noise(
      job_.generator, key, std::numeric_limits<double>::quiet_NaN(), content_shape, values);
  // A fifth of the time of a network of width 8 in bfloat16: only where they are wanted.
  bool is_sound = made.part.notes.sound;
  if (labels || job_.volume.normalize != Normalization::kNone) {
    const auto statistics =
        finish_volume(generator(), made.part.notes, gap, job_.volume.normalize, pair, values);
    is_sound = statistics.has_value();
    made.statistics = statistics.value_or(VolumeStatistics{});
    if (has_noise) made.statistics.flags |= kFlagNoise;
  } else if (!is_sound) {
    is_sound = scan_values(values).sound;
  }
  if (!is_sound) {
    throw std::runtime_error("expected finite values >= 0, got " +
                             fmt::format("{}", values[first_unsound_value(values)]) +
                             " in the generated volume");
  }
  if (values.data() != volume.data()) lay_into(values, pair, volume);
  return made;
}

}  // namespace eventgan
