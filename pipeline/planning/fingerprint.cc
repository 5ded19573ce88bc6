#include "pipeline/planning/fingerprint.h"

#include <fmt/format.h>
#include <link.h>
#include <png.h>
#include <zlib.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <set>
#include <sstream>
#include <string_view>

#include "manifests/documents/manifest_fields.h"
#include "manifests/files/sha256.h"
#include "stages/base/hdf5/hdf5.h"
#include "stages/base/processor/processor.h"
#include "stages/base/videos/video_file.h"
#include "stages/frames/decoding/cut_out.h"
#include "stages/frames/decoding/moving_still.h"
#include "stages/generator/wanted_tiles.h"

namespace eventgan {
namespace {

/// SHA-256 of a listing "PATH\tSTATE\n", sorted, each path once. A million pairs name two million
/// frames: neither copies of their paths nor the listing are in memory.
template <class State>
std::string listing_hash(std::vector<std::string_view> paths,
                         const std::function<void()>& before_file, const State& state) {
  std::ranges::sort(paths);
  Sha256 hash;
  std::string line;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    before_file();
    if (i > 0 && paths[i] == paths[i - 1]) continue;
    line.assign(paths[i]).append("\t").append(state(std::string(paths[i]))).append("\n");
    hash.update(line);
  }
  return hash.hex();
}

std::string annotations_hash(const JobManifest& manifest, const std::vector<std::string>& files,
                             const std::function<void()>& before_file) {
  return listing_hash({files.begin(), files.end()}, before_file, [&](const std::string& path) {
    const auto file = resolve(manifest, path);
    std::error_code unknown;
    if (!std::filesystem::exists(file, unknown) && !unknown) return std::string("absent");
    try {
      return sha256_of_file(file);
    } catch (const std::runtime_error&) {  // its samples are quarantined, with the reason
      return std::string("unreadable");
    }
  });
}

/// What the inputs decide in a plan beside the frames: of each sample its id, times, size and
/// fault, and of each source what was counted. With it, no change of the inputs gives another plan
/// and the same fingerprint: there would be nothing then that `retry` could record.
std::string decisions_hash(const JobManifest& manifest, const Plan& plan) {
  Sha256 hash;
  std::ostringstream line;
  const auto take_line = [&] {
    hash.update(line.str() + "\n");
    line.str("");
  };
  line << std::hexfloat;
  for (const PlannedShard& shard : plan.shards) {
    const bool is_native = !manifest.image.size;  // else the size is the manifest's
    for (const PlannedSample& sample : shard.samples) {
      line << shard.source << '\t' << sample.sample_id << '\t' << sample.pair.previous.time_s
           << '\t' << sample.pair.next.time_s << '\t' << sample.fault;
      if (is_native) line << '\t' << shard.volume_size.height << '\t' << shard.volume_size.width;
      if (shard.size_unknown) line << "\tunknown";
      take_line();
    }
  }
  for (const SourceSummary& source : plan.sources) {
    line << source.labelled_frames << '\t' << source.unpaired;
    for (const std::string& id : source.unpaired_ids) line << '\t' << id;
    take_line();
  }
  return hash.hex();
}

std::string frames_hash(const JobManifest& manifest, const Plan& plan,
                        const std::function<void()>& before_file) {
  std::vector<std::string_view> paths;
  for (const PlannedShard& shard : plan.shards) {
    for (const PlannedSample& sample : shard.samples) {
      paths.push_back(sample.pair.previous.path);
      paths.push_back(sample.pair.next.path);
    }
  }
  const std::string hash =
      listing_hash(std::move(paths), before_file, [&](const std::string& path) {
        std::error_code absent;
        const auto size = std::filesystem::file_size(resolve(manifest, path), absent);
        return absent ? "absent" : std::to_string(size);
      });
  return sha256_hex(hash + "\n" + decisions_hash(manifest, plan));
}

bool any_video(const std::vector<PlannedShard>& shards) {
  return std::ranges::any_of(shards, [](const PlannedShard& shard) {
    return std::ranges::any_of(shard.samples, [](const PlannedSample& sample) {
      const bool is_window = sample.pair.gap_frames == 0;  // of events: a recording's frames
      return !is_window && sample.pair.previous.video_frame >= 0;
    });
  });
}

/// Whether an image's orientation counts: of one's own images. A source whose frames are of videos
/// has none; those that its labels name and that are not there tell nothing.
bool turns_images(const JobManifest& manifest, const Plan& plan) {
  std::set<int> own, of_videos;
  for (const PlannedShard& shard : plan.shards) {
    const SourceSpec& source = manifest.sources[static_cast<std::size_t>(shard.source)];
    if (!is_own(source.dataset) || shard.samples.empty()) continue;
    own.insert(shard.source);
    const bool is_of_videos = std::ranges::any_of(shard.samples, [](const PlannedSample& sample) {
      return sample.pair.next.video_frame >= 0 && sample.pair.previous.video_frame >= 0;
    });
    if (is_of_videos) of_videos.insert(shard.source);
  }
  return own.size() > of_videos.size();
}

/// The file of a library that is loaded in this process; empty: it is none, or a part of the
/// program.
std::filesystem::path library_file(const std::string& name) {
  struct Search {
    std::string start;
    std::filesystem::path found;
  } search{name + ".so", {}};
  dl_iterate_phdr(
      [](dl_phdr_info* library, std::size_t, void* data) {
        auto& [start, found] = *static_cast<Search*>(data);
        const std::filesystem::path file = library->dlpi_name;
        if (!file.filename().string().starts_with(start)) return 0;
        found = file;
        return 1;
      },
      &search);
  return search.found;
}

/// "libjpeg.so.62 0123456789abcdef": a library that cannot be asked for its version: the file's
/// name and the first digits of its SHA-256, which are the same wherever the same package is
/// installed. `name` alone if it has no file.
std::string loaded_library(const std::string& name) {
  const std::filesystem::path file = library_file(name);
  if (file.empty()) return name;
  return file.filename().string() + " " + sha256_of_file(file).substr(0, 16);
}

/// Of all that makes or reads bytes, as it runs, which need not be what was compiled against.
std::string libraries(bool with_videos) {
  std::string text = "HDF5 " + hdf5_version() + ", zlib " + zlibVersion() + ", OpenCV " +
                     cv::getVersionString() + ", libpng " + png_get_libpng_ver(nullptr) + ", " +
                     loaded_library("libjpeg") + ", " + loaded_library("libdeflate") + ", " +
                     loaded_library("libisal") + ", " + loaded_library("libwebp") + ", " +
                     loaded_library("libtiff");
  if (with_videos) text += ", " + video_libraries();
  return text;
}

}  // namespace

std::string preprocessing_json(const ImageSpec& image) {
  nlohmann::json json = {{"fit", to_string(image.fit)},
                         {"grey", to_string(image.grey)},
                         {"blur", image.blur},
                         {"preset", image.preset}};
  if (image.range) json["range"] = {image.range->low, image.range->high};
  return json.dump();
}

std::string program_version() { return std::string("eventgan ") + EVENTGAN_VERSION; }

std::string version_text() {
  std::vector<std::string> engines;
  for (const char* name : {"libtorch_cpu", "libtorch_cuda", "libdnnl", "libtbb"}) {
    std::filesystem::path file = library_file(name);
    if (file.empty()) continue;
    std::error_code unknown;  // the name that has the whole version is behind a link
    if (const auto whole = std::filesystem::canonical(file, unknown); !unknown) file = whole;
    engines.push_back(file.filename().string());
  }
  return fmt::format("{}\nlibraries: {}\nengines: {}\nprocessor: {}", program_version(),
                     libraries(/*with_videos=*/false), fmt::join(engines, ", "),
                     instruction_sets());
}

std::map<std::string, std::string> make_fingerprint(
    const JobManifest& manifest, const Plan& plan, const std::vector<std::string>& annotation_files,
    const std::string& weights_hash, const std::string& engine,
    const std::function<void()>& before_file) {
  std::map<std::string, std::string> fingerprint = {
      {"annotations", annotations_hash(manifest, annotation_files, before_file)},
      {"frames", frames_hash(manifest, plan, before_file)},
      {"weights", weights_hash},
      {"engine", engine},
      {"preprocessing", preprocessing_json(manifest.image)},
      {"cpu", instruction_sets()},
      {"libraries", libraries(any_video(plan.shards))},
      {"program", program_version()}};
  if (turns_images(manifest, plan)) {
    fingerprint["orientation"] = "upright, by " + loaded_library("libexif");
  }
  const auto has_stills = [](const SourceSpec& source) { return source.pairs.stills.has_value(); };
  if (std::ranges::any_of(manifest.sources, has_stills)) fingerprint["stills"] = kStillSampling;
  const auto moves_objects = [](const SourceSpec& source) {
    return source.pairs.stills && source.pairs.stills->objects;
  };
  if (std::ranges::any_of(manifest.sources, moves_objects)) {
    fingerprint["cut_out"] = kCutOutMethod;
  }
  const Scope scope = manifest.generator.scope.scope;
  if (scope == Scope::kMotion || scope == Scope::kLabels) fingerprint["motion"] = kMotionRule;
  for (const auto& [path, value] : manifest_fields(manifest.text))
    fingerprint["manifest " + path] = value;
  return fingerprint;
}

}  // namespace eventgan
