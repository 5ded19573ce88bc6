#include "pipeline/planning/fingerprint.h"

#include <hdf5.h>
#include <link.h>
#include <png.h>
#include <zlib.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <string_view>

#include "manifests/manifest_fields.h"
#include "stages/files/sha256.h"

namespace eventgan {
namespace {

/// SHA-256 of a listing "PATH\tSTATE\n", sorted, each path once. A million pairs name two million
/// frames: neither copies of their paths nor the listing stand in memory.
template <class State>
std::string listing_hash(std::vector<std::string_view> paths, const State& state) {
  std::ranges::sort(paths);
  Sha256 hash;
  std::string line;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    if (i > 0 && paths[i] == paths[i - 1]) continue;
    line.assign(paths[i]).append("\t").append(state(std::string(paths[i]))).append("\n");
    hash.update(line);
  }
  return hash.hex();
}

std::string annotations_hash(const JobManifest& manifest, const std::vector<std::string>& files,
                             const std::function<void()>& before_file) {
  return listing_hash({files.begin(), files.end()}, [&](const std::string& path) {
    before_file();
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

std::string frames_hash(const JobManifest& manifest, const std::vector<PlannedShard>& shards,
                        const std::function<void()>& before_file) {
  std::vector<std::string_view> paths;
  for (const PlannedShard& shard : shards) {
    for (const PlannedSample& sample : shard.samples) {
      paths.push_back(sample.pair.previous.path);
      paths.push_back(sample.pair.next.path);
    }
  }
  const std::string hash = listing_hash(std::move(paths), [&](const std::string& path) {
    before_file();
    std::error_code absent;
    const auto size = std::filesystem::file_size(resolve(manifest, path), absent);
    return absent ? "absent" : std::to_string(size);
  });
  // A picture that is mended within its size changes where its sample belongs.
  std::string unknown;
  for (const PlannedShard& shard : shards) {
    if (!shard.size_unknown) continue;
    for (const PlannedSample& sample : shard.samples) unknown += sample.sample_id + "\n";
  }
  return unknown.empty() ? hash : sha256_hex(hash + "\n" + unknown);
}

bool any_video(const std::vector<PlannedShard>& shards) {
  return std::ranges::any_of(shards, [](const PlannedShard& shard) {
    return std::ranges::any_of(shard.samples, [](const PlannedSample& sample) {
      return sample.pair.previous.video_frame >= 0;
    });
  });
}

/// "libjpeg.so.62 0123456789abcdef": a library that cannot be asked for its version, as it is
/// loaded in this process: the file's name and the first digits of its SHA-256, which are the same
/// wherever the same package is installed. `name` alone if it is not loaded: then it is a part of
/// the program.
std::string loaded_library(const std::string& name) {
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
  if (search.found.empty()) return name;
  return search.found.filename().string() + " " + sha256_of_file(search.found).substr(0, 16);
}

/// Of all that makes or reads bytes, as it runs, which need not be what was compiled against.
std::string libraries(bool with_videos) {
  unsigned major = 0, minor = 0, release = 0;
  H5get_libversion(&major, &minor, &release);
  std::string text = "HDF5 " + std::to_string(major) + "." + std::to_string(minor) + "." +
                     std::to_string(release) + ", zlib " + zlibVersion() + ", OpenCV " +
                     cv::getVersionString() + ", libpng " + png_get_libpng_ver(nullptr) + ", " +
                     loaded_library("libjpeg") + ", " + loaded_library("libdeflate");
  // The one of FFmpeg's libraries that decodes; all come from one source.
  if (with_videos) text += ", " + loaded_library("libavcodec");
  return text;
}

}  // namespace

std::string preprocessing_json(const ImageSpec& image) {
  nlohmann::json json = {{"fit", to_string(image.fit)},
                         {"grey", to_string(image.grey)},
                         {"blur", image.blur},
                         {"preset", image.preset}};
  return json.dump();
}

std::string instruction_sets() {
  std::string sets = "x86-64";
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx2")) sets += " avx2";
  if (__builtin_cpu_supports("fma")) sets += " fma";
  if (__builtin_cpu_supports("avx512f")) sets += " avx512f";
  if (__builtin_cpu_supports("avx512vnni")) sets += " avx512vnni";
  if (__builtin_cpu_supports("avx512bf16")) sets += " avx512bf16";
#else
  sets = "other";
#endif
  return sets;
}

std::string program_version() { return std::string("eventgan ") + EVENTGAN_VERSION; }

std::map<std::string, std::string> make_fingerprint(
    const JobManifest& manifest, const std::vector<PlannedShard>& shards,
    const std::vector<std::string>& annotation_files, const std::string& weights_hash,
    const std::string& engine, const std::function<void()>& before_file) {
  std::map<std::string, std::string> fingerprint = {
      {"annotations", annotations_hash(manifest, annotation_files, before_file)},
      {"frames", frames_hash(manifest, shards, before_file)},
      {"weights", weights_hash},
      {"engine", engine},
      {"preprocessing", preprocessing_json(manifest.image)},
      {"cpu", instruction_sets()},
      {"libraries", libraries(any_video(shards))},
      {"program", program_version()}};
  for (const auto& [path, value] : manifest_fields(manifest.text))
    fingerprint["manifest " + path] = value;
  return fingerprint;
}

}  // namespace eventgan
