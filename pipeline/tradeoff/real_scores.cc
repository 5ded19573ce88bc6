#include "pipeline/tradeoff/real_scores.h"

#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "pipeline/generators/load_generator.h"
#include "pipeline/planning/spread.h"
#include "pipeline/runtime/threads.h"
#include "pipeline/tradeoff/loss.h"
#include "stages/base/files/sha256.h"
#include "stages/events/volume_statistics.h"
#include "stages/frames/decoding/prepared_frame.h"
#include "stages/generator/wanted_tiles.h"
#include "stages/shards/codec/quantization.h"
#include "stages/shards/codec/volume_codec.h"

namespace eventgan {

RealPart part_of(const Recording& recording, int most, int bins, int threads) {
  RealPart part{recording, {}, {}};
  const std::vector<FrameInterval> all = choose_intervals(recording, 0, std::nullopt, {1});
  for (const std::size_t place : spread(static_cast<std::size_t>(most), all.size())) {
    part.intervals.push_back(all[place]);
  }
  std::vector<std::string> hashes(part.intervals.size());
  for_each_index(hashes.size(), threads, [&](std::size_t i) {
    const RealInterval real = read_interval(recording, part.intervals[i], bins);
    Sha256 hash;
    hash.update(std::as_bytes(std::span(real.frames.previous.pixels)));
    hash.update(std::as_bytes(std::span(real.frames.next.pixels)));
    hash.update(std::as_bytes(std::span(real.volume)));
    hashes[i] = hash.hex();
  });
  const ImageSize size = recording.size();
  part.content =
      sha256_hex(fmt::format("{}x{} {}", size.width, size.height, fmt::join(hashes, " ")));
  return part;
}

namespace {

/// A frame at another size of its sides.
GreyImage resized(const GreyImage& image, ImageSize size) {
  if (image.size == size) return image;
  std::vector<std::uint8_t> bgr;
  for (const std::uint8_t value : image.pixels) bgr.insert(bgr.end(), 3, value);
  ImageSpec spec;
  spec.size = size;
  return {size, prepare_frame({image.size, bgr.data()}, spec).grey};
}

}  // namespace

std::vector<RealismScores> real_scores(const RealPart& part, const JobManifest& job, double size,
                                       std::span<const StoredType> dtypes, int threads,
                                       const std::function<void()>& each) {
  const LoadedGenerator loaded = load_generator(job);
  const ImageSize whole = part.recording.size();
  ImageSpec smaller;
  smaller.size = {static_cast<int>(std::lround(whole.height * size)),
                  static_cast<int>(std::lround(whole.width * size))};
  const Placement from = place(whole, smaller);
  const Placement to = place(whole, {});
  const VolumeShape shape{job.volume.bins, whole};
  const VolumeShape own_shape{job.volume.bins, *smaller.size};
  std::vector<std::vector<RealismScores>> scores(dtypes.size(),
                                                 std::vector<RealismScores>(part.intervals.size()));
  for_each_index(part.intervals.size(), threads, [&](std::size_t i) {
    const RealInterval real = read_interval(part.recording, part.intervals[i], shape.bins);
    IntervalFrames frames = real.frames;
    frames.previous = resized(frames.previous, own_shape.size);
    frames.next = resized(frames.next, own_shape.size);
    std::vector<float> generated(own_shape.value_count());
    const std::vector<float> input = network_input(frames);
    const ScopeSpec& scope = job.generator.scope;
    if (scope.scope == Scope::kWhole) {
      loaded.generator->generate({input, own_shape.size}, generated);
    } else {  // a recording has no labels
      loaded.generator->generate_tiles(
          {input, own_shape.size}, wanted_tiles(scope, input, own_shape.size, 0, 0, {}), generated);
    }
    for (std::size_t k = 0; k < dtypes.size(); ++k) {
      const EncodedVolume stored = VolumeCodec(dtypes[k], 0).encode(generated);
      const auto bytes = decode_chunk(stored.chunk, dtypes[k], 0,
                                      own_shape.value_count() * stored_size(dtypes[k]));
      std::vector<float> volume = dequantize(bytes.value(), dtypes[k], stored.scale);
      if (!has_weights(job.generator.kind)) volume = normalized(std::move(volume));
      volume = on_grid(std::move(volume), shape.channels(), from, to);
      scores[k][i] =
          realism_scores(volume, real.volume, shape, real.frames.previous, real.frames.next);
    }
    each();
  });
  std::vector<RealismScores> means;
  for (const std::vector<RealismScores>& of_dtype : scores) means.push_back(mean_scores(of_dtype));
  return means;
}

}  // namespace eventgan
