#include "pipeline/folder/preview_shard.h"

#include <algorithm>
#include <charconv>
#include <set>
#include <utility>

#include "manifests/documents/job_manifest.h"
#include "manifests/values/faults.h"
#include "manifests/values/placement.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/folder/shard_guard.h"
#include "stages/events/pictures/preview_picture.h"
#include "stages/frames/decoding/frame_decoder.h"
#include "stages/frames/decoding/prepared_frame.h"
#include "stages/shards/shard_reader.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// The placement a sample was made with; `image` is the shard's manifest's.
Placement placement_of(const ShardSample& sample, const ImageSpec& image) {
  return place(sample.source_size, image);
}

std::string picture_name(const fs::path& shard, int slot) {
  std::string number = std::to_string(slot);
  number.insert(0, 4 - std::min<std::size_t>(number.size(), 4), '0');
  return shard.stem().string() + "_" + number + ".png";
}

/// The colour frame laid into the volume; empty, with a warning, if it cannot be had.
std::vector<std::uint8_t> frame_picture(const FrameDecoder& decoder, const FrameRef& frame,
                                        const ShardSample& sample, const ImageSpec& image,
                                        std::vector<std::string>& warnings) {
  if (!sample.valid) return {};
  const Outcome<ColourFrame> decoded = decoder.decode(frame, sample.pair.video_stride());
  if (is_fault(decoded)) {
    warnings.push_back(std::get<SampleFault>(decoded).reason + " (" + sample.sample_id + ")");
    return {};
  }
  const ColourFrame& colour = std::get<ColourFrame>(decoded);
  const Placement placement = placement_of(sample, image);
  if (colour.size != placement.source) {
    warnings.push_back("expected the frame's size of when it was converted, got another, in " +
                       frame.path + " (" + sample.sample_id + ")");
    return {};
  }
  return place_colour(colour, placement);
}

PreviewContent content_of(const ShardReader& reader, int slot, const FrameDecoder& decoder,
                          const ImageSpec& image, std::vector<std::string>& warnings) {
  const ShardHeader& header = reader.header();
  renew_time_limit();
  ShardSample sample = reader.sample(slot);
  PreviewContent content;
  content.shape = header.volume;
  content.volume = reader.volume(slot);
  lift_time_limit();
  content.previous_bgr = frame_picture(decoder, sample.pair.previous, sample, image, warnings);
  content.next_bgr = frame_picture(decoder, sample.pair.next, sample, image, warnings);
  content.title = header.dataset + " " + sample.sample_id + ", gap " +
                  std::to_string(sample.pair.gap_frames) + (sample.valid ? "" : ", QUARANTINED");
  content.annotation = std::move(sample.annotation);
  content.labels = std::move(sample.labels);
  content.schema = header.label_schema;
  return content;
}

[[noreturn]] void refuse_slots(const std::string& text, int sample_count) {
  throw UsageError("--samples: expected slots 0.." + std::to_string(sample_count - 1) +
                   " such as 0,3-5, got \"" + text + "\"");
}

}  // namespace

std::vector<fs::path> preview_shard(const fs::path& shard, const PreviewOptions& options,
                                    std::vector<std::string>& warnings) {
  const ShardReader reader(shard);
  const ShardHeader& header = reader.header();
  const fs::path folder = fs::absolute(shard).parent_path();
  const fs::path frames = !options.frames.empty()
                              ? fs::absolute(options.frames)
                              : recorded_manifest_folder(folder).value_or(folder);
  const JobManifest manifest = parse_job_manifest(header.manifest_text, frames, shard.string());
  const FrameDecoder decoder(frames);
  const std::vector<int> slots = options.samples.empty()
                                     ? spread_slots(options.count, header.sample_count)
                                     : parse_slots(options.samples, header.sample_count);
  fs::create_directories(options.out);
  std::vector<fs::path> pictures;
  for (const int slot : slots) {
    pictures.push_back(options.out / picture_name(shard, slot));
    write_preview_png(content_of(reader, slot, decoder, manifest.image, warnings),
                      pictures.back().string());
  }
  return pictures;
}

std::vector<int> parse_slots(const std::string& text, int sample_count) {
  std::set<int> slots;
  const char* at = text.data();
  const char* const end = at + text.size();
  const auto number = [&] {
    int value = -1;
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc() || value < 0 || value >= sample_count)
      refuse_slots(text, sample_count);
    at = next;
    return value;
  };
  while (true) {
    const int first = number();
    int last = first;
    if (at != end && *at == '-') {
      ++at;
      last = number();
    }
    if (last < first) refuse_slots(text, sample_count);
    for (int slot = first; slot <= last; ++slot) slots.insert(slot);
    if (at == end) break;
    if (*at++ != ',') refuse_slots(text, sample_count);
  }
  return {slots.begin(), slots.end()};
}

std::vector<int> spread_slots(int count, int sample_count) {
  std::vector<int> slots;
  const int taken = std::min(count, sample_count);
  for (int i = 0; i < taken; ++i) {
    slots.push_back(static_cast<int>(static_cast<long long>(i) * sample_count / taken));
  }
  return slots;
}

}  // namespace eventgan
