#include "manifests/job_manifest.h"

#include <cstdint>
#include <limits>
#include <stdexcept>

#include "manifests/generator_spec_internal.h"
#include "manifests/image_spec_internal.h"
#include "manifests/job_words_internal.h"
#include "manifests/manifest_text_internal.h"
#include "manifests/parse_manifest_internal.h"
#include "manifests/source_spec_internal.h"
#include "manifests/strict_json/strict_json_internal.h"

namespace eventgan {
namespace {

constexpr std::string_view kFormat = "eventgan-manifest";
constexpr int kVersion = 1;

VolumeSpec read_volume(const StrictValue& value) {
  VolumeSpec spec;
  StrictObject object = value.object();
  if (const auto bins = object.find("bins")) spec.bins = bins->integer(1, 64);
  if (const auto normalize = object.find("normalize")) {
    spec.normalize = normalize->choice(kNormalizationWords);
  }
  object.finish();
  return spec;
}

OutputSpec read_output(const StrictValue& value) {
  OutputSpec spec;
  StrictObject object = value.object();
  spec.directory = read_path(object.at("directory"));
  if (const auto count = object.find("samples_per_shard")) {
    spec.samples_per_shard = count->integer(1, 65536);
  }
  if (const auto dtype = object.find("dtype")) spec.dtype = dtype->choice(kStoredTypeWords);
  if (const auto level = object.find("deflate_level")) spec.deflate_level = level->integer(0, 9);
  object.finish();
  return spec;
}

ErrorSpec read_errors(const StrictValue& value) {
  ErrorSpec spec;
  StrictObject object = value.object();
  if (const auto policy = object.find("policy")) spec.policy = policy->choice(kPolicyWords);
  if (const auto count = object.find("max_count")) {
    spec.max_count = count->integer<std::int64_t>(0, 1'000'000'000);
  }
  if (const auto fraction = object.find("max_fraction")) {
    spec.max_fraction = fraction->number(0, 1);
  }
  object.finish();
  return spec;
}

/// A volume is one chunk of its shard, and HDF5's chunks stay below 4 GiB.
void check_chunk(const JobManifest& manifest, const StrictValue& image) {
  if (!manifest.image.size) return;
  const ImageSize size = *manifest.image.size;
  const std::uint64_t bytes = std::uint64_t{2} * manifest.volume.bins * size.pixel_count() *
                              stored_size(manifest.output.dtype);
  if (bytes <= std::numeric_limits<std::uint32_t>::max()) return;
  image.fault("volumes below 4 GiB (2 x bins x height x width x bytes of dtype)",
              std::to_string(bytes) + " bytes");
}

JobManifest read_document(const StrictValue& document) {
  JobManifest manifest;
  StrictObject object = document.object();
  if (!object.has_format(kFormat, kVersion)) return manifest;
  manifest.name = read_name(object.at("name"));
  if (const auto seed = object.find("seed")) manifest.seed = read_seed(*seed);
  for (const StrictValue& source : object.at("sources").elements(1)) {
    manifest.sources.push_back(read_source(source));
  }
  const StrictValue image = object.at("image");
  manifest.image = read_image(image);
  if (const auto generator = object.find("generator")) {
    manifest.generator = read_generator(*generator);
  }
  if (const auto volume = object.find("volume")) manifest.volume = read_volume(*volume);
  manifest.output = read_output(object.at("output"));
  if (const auto errors = object.find("errors")) manifest.errors = read_errors(*errors);
  object.finish();
  check_chunk(manifest, image);
  return manifest;
}

}  // namespace

std::size_t stored_size(StoredType type) {
  switch (type) {
    case StoredType::kFloat32:
      return 4;
    case StoredType::kFloat16:
      return 2;
    case StoredType::kUint8:
      return 1;
  }
  throw std::logic_error("unknown stored type");
}

JobManifest parse_job_manifest(std::string_view text, const std::filesystem::path& directory,
                               const std::string& name) {
  return parse_manifest<JobManifest>(text, directory, name, read_document);
}

JobManifest read_job_manifest(const std::filesystem::path& file) {
  return parse_job_manifest(read_manifest_text(file), manifest_folder(file), file.string());
}

}  // namespace eventgan
