#include "pipeline/planning/fingerprint.h"

#include <hdf5.h>
#include <jconfig.h>
#include <libdeflate.h>
#include <png.h>

#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <set>

#include "manifests/manifest_fields.h"
#include "stages/files/sha256.h"

namespace eventgan {
namespace {

std::string annotations_hash(const JobManifest& manifest, const std::vector<std::string>& files) {
  std::string listing;
  for (const std::string& path : std::set<std::string>(files.begin(), files.end())) {
    const auto file = resolve(manifest, path);
    const bool there = std::filesystem::is_regular_file(file);
    listing += path + '\t' + (there ? sha256_of_file(file) : "absent") + '\n';
  }
  return sha256_hex(listing);
}

std::string frames_hash(const JobManifest& manifest, const std::vector<PlannedShard>& shards) {
  std::set<std::string> paths;
  for (const PlannedShard& shard : shards) {
    for (const PlannedSample& sample : shard.samples) {
      paths.insert(sample.pair.previous.path);
      paths.insert(sample.pair.next.path);
    }
  }
  std::string listing;
  for (const std::string& path : paths) {
    std::error_code absent;
    const auto size = std::filesystem::file_size(resolve(manifest, path), absent);
    listing += path + '\t' + (absent ? "absent" : std::to_string(size)) + '\n';
  }
  return sha256_hex(listing);
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
    const std::string& engine) {
  unsigned major = 0, minor = 0, release = 0;
  H5get_libversion(&major, &minor, &release);
  std::map<std::string, std::string> fingerprint = {
      {"annotations", annotations_hash(manifest, annotation_files)},
      {"frames", frames_hash(manifest, shards)},
      {"weights", weights_hash},
      {"engine", engine},
      {"preprocessing", preprocessing_json(manifest.image)},
      {"cpu", instruction_sets()},
      {"libraries", "HDF5 " + std::to_string(major) + "." + std::to_string(minor) + "." +
                        std::to_string(release) + ", OpenCV " + cv::getVersionString() +
                        ", libjpeg-turbo " + std::to_string(LIBJPEG_TURBO_VERSION_NUMBER) +
                        ", libpng " + png_get_libpng_ver(nullptr) + ", libdeflate " +
                        LIBDEFLATE_VERSION_STRING},
      {"program", program_version()}};
  for (const auto& [path, value] : manifest_fields(manifest.text))
    fingerprint["manifest " + path] = value;
  return fingerprint;
}

}  // namespace eventgan
