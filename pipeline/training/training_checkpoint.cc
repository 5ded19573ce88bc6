#include "pipeline/training/training_checkpoint.h"

#include <ATen/Parallel.h>
#include <torch/version.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <set>
#include <span>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "manifests/documents/manifest_fields.h"
#include "manifests/documents/plan.h"
#include "manifests/files/atomic_file.h"
#include "manifests/files/sha256.h"
#include "manifests/values/faults.h"
#include "manifests/values/words.h"
#include "pipeline/planning/fingerprint.h"
#include "pipeline/training/sample_source.h"
#include "stages/base/processor/processor.h"
#include "stages/generator/safetensors.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// Of the file with the events and of what is read beside it; of a folder, which has images, of all
/// files in it and below.
std::string recording_hash(const fs::path& path, const RecordingSpec& spec) {
  const fs::path events = event_file(fs::absolute(path).lexically_normal(), spec.options);
  std::set<fs::path> files;
  if (fs::is_directory(path)) {
    for (const auto& entry : fs::recursive_directory_iterator(path)) {
      if (entry.is_regular_file()) files.insert(entry.path());
    }
  } else {
    const auto beside = event_companions(events, spec.format, spec.options);
    if (beside.empty()) return sha256_of_file(events);
    files.insert(beside.begin(), beside.end());
    files.insert(events);
  }
  std::string listing;
  for (const fs::path& file : files) {
    listing +=
        file.lexically_relative(events.parent_path()).string() + '\t' + sha256_of_file(file) + '\n';
  }
  return sha256_hex(listing);
}

/// Of those of the textures that lie in the folder or below.
std::string textures_hash(const fs::path& folder, const std::vector<fs::path>& textures) {
  std::string listing;
  for (const fs::path& file : textures) {
    const fs::path below = file.lexically_relative(folder);
    if (below.empty() || *below.begin() == "..") continue;
    listing += below.string() + '\t' + sha256_of_file(file) + '\n';
  }
  return sha256_hex(listing);
}

}  // namespace

std::map<std::string, std::string> training_settings(
    const TrainingManifest& manifest, std::span<const TrainingRecording> recordings) {
  std::map<std::string, std::string> settings;
  for (const auto& [field, value] : manifest_fields(manifest.text)) {
    if (!field.starts_with("$.output.")) settings["manifest " + field] = value;
  }
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    settings["recording " + std::to_string(i)] =
        recording_hash(recordings[i].file, manifest.recordings.at(i));
  }
  const std::vector<fs::path> folders = texture_folders(manifest);
  std::vector<fs::path> textures = texture_files(folders);
  // Those of a folder in another are there twice.
  textures.erase(std::unique(textures.begin(), textures.end()), textures.end());
  for (std::size_t i = 0; i < folders.size(); ++i) {
    settings["textures " + std::to_string(i)] = textures_hash(folders[i], textures);
  }
  if (manifest.teacher) {
    settings["teacher"] = sha256_of_file(resolve(manifest, *manifest.teacher));
  }
  return settings;
}

std::map<std::string, std::string> training_environment(const std::string& device) {
  return {{"threads", std::to_string(at::get_num_threads())},
          {"device", device},
          {"cpu", instruction_sets()},
          {"libtorch", TORCH_VERSION},
          {"program", program_version()}};
}

void check_same_training(const std::map<std::string, std::string>& before,
                         const std::map<std::string, std::string>& now) {
  const auto told = [](std::map<std::string, std::string> settings) {
    std::erase_if(settings, [](const auto& setting) {
      const std::string& field = setting.first;
      return field != "manifest $.name" &&
             !(field.starts_with("manifest $.recordings[") && field.ends_with("].path"));
    });
    return settings;
  };
  const auto differences = fingerprint_differences(told(before), told(now));
  if (differences.empty()) return;
  std::string message =
      "expected the output folder of this training, got that of another training (choose another "
      "output folder, or remove that one yourself):";
  for (const std::string& difference : differences) message += "\n  " + difference;
  throw UsageError(message);
}

void check_resumable(std::map<std::string, std::string> before,
                     std::map<std::string, std::string> now, const TrainingPosition& position,
                     const TrainingManifest& manifest) {
  for (const auto& [word, phase] : kPhaseWords) {
    const std::int64_t steps = steps_of(manifest.steps, phase);
    const LossWeights& losses = manifest.losses;
    const bool fades = manifest.network.sensor && has_loss(losses, LossKind::kDirect);
    const bool falls =
        manifest.optimizer.final_rate_fraction != 1 ||
        (phase == TrainingPhase::kGenerator && (manifest.network.output_slope != 0 || fades));
    const bool in_progress = phase == position.phase && steps >= position.step && !falls;
    if (phase > position.phase || in_progress) {
      const std::string field = "manifest $.steps." + std::string(word);
      before.erase(field);
      now.erase(field);
    }
  }
  check_same_training(before, now);
  const auto differences = fingerprint_differences(before, now);
  if (differences.empty()) return;
  std::string message =
      "the training in the output folder was started with other settings (--overwrite starts "
      "again):";
  for (const std::string& difference : differences) message += "\n  " + difference;
  throw UsageError(message);
}

namespace {

constexpr char kLatest[] = "latest.safetensors";
constexpr char kPrevious[] = "previous.safetensors";
constexpr char kDamaged[] = "damaged.safetensors";
constexpr char kDigest[] = "content_sha256";
constexpr char kFormat[] = "eventgan-training";
constexpr char kVersion[] = "1";
constexpr std::string_view kSettingPrefix = "setting ";
constexpr std::string_view kEnvironmentPrefix = "environment ";

void check_finite(const StateDict& state) {
  for (const auto& [name, tensor] : state) {
    const bool finite = std::all_of(tensor.values.begin(), tensor.values.end(),
                                    [](float value) { return std::isfinite(value); });
    if (!finite) throw std::runtime_error("expected finite numbers, got others, in tensor " + name);
  }
}

/// SHA-256 of tensors and metadata, the digest itself apart: a flipped bit in a number is a number
/// too, and nothing else would tell it from the right one.
std::string digest(const SafetensorsFile& file) {
  std::string listing;
  for (const auto& [key, value] : file.metadata) {
    if (key != kDigest) listing += key + '\0' + value + '\0';
  }
  for (const auto& [name, tensor] : file.tensors) {
    listing += name + '\0';
    for (const std::int64_t side : tensor.shape) listing += std::to_string(side) + ' ';
    listing += sha256_hex(std::as_bytes(std::span(tensor.values))) + '\0';
  }
  return sha256_hex(listing);
}

const std::string& text_at(const SafetensorsFile& file, const std::string& key) {
  const auto found = file.metadata.find(key);
  if (found == file.metadata.end()) {
    throw std::runtime_error("expected metadata \"" + key + "\", got none");
  }
  return found->second;
}

template <class Number>
Number number_at(const SafetensorsFile& file, const std::string& key) {
  const std::string& text = text_at(file, key);
  Number number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || end != text.data() + text.size() || !(number >= 0)) {
    throw std::runtime_error("expected a number at metadata \"" + key + "\", got \"" + text + "\"");
  }
  return number;
}

TrainingPhase phase_at(const SafetensorsFile& file, const std::string& key) {
  if (const auto phase = value_of_word(kPhaseWords, text_at(file, key))) return *phase;
  throw std::runtime_error("expected a training phase, got \"" + text_at(file, key) + "\"");
}

std::map<std::string, std::string> with_prefix(const SafetensorsFile& file,
                                               std::string_view prefix) {
  std::map<std::string, std::string> fields;
  for (const auto& [key, value] : file.metadata) {
    if (key.starts_with(prefix)) fields[key.substr(prefix.size())] = value;
  }
  return fields;
}

TrainingCheckpoint read(const fs::path& path) {
  SafetensorsFile file = read_safetensors(path);
  if (text_at(file, "format") != kFormat || text_at(file, "format_version") != kVersion) {
    throw std::runtime_error("expected a training checkpoint of version 1, got another file, in " +
                             path.string());
  }
  if (text_at(file, kDigest) != digest(file)) {
    throw std::runtime_error("expected content of SHA-256 " + text_at(file, kDigest) + ", got " +
                             digest(file) + ", in " + path.string());
  }
  TrainingCheckpoint checkpoint;
  checkpoint.position = {phase_at(file, "phase"), number_at<std::int64_t>(file, "step")};
  checkpoint.seconds = number_at<double>(file, "seconds");
  checkpoint.settings = with_prefix(file, kSettingPrefix);
  checkpoint.environment = with_prefix(file, kEnvironmentPrefix);
  checkpoint.state = std::move(file.tensors);
  check_finite(checkpoint.state);
  return checkpoint;
}

}  // namespace

void save_checkpoint(const fs::path& folder, TrainingCheckpoint checkpoint) {
  const fs::path latest = folder / kLatest;
  try {
    check_finite(checkpoint.state);
    SafetensorsFile file;
    file.metadata = {{"format", kFormat},
                     {"format_version", kVersion},
                     {"phase", std::string(to_string(checkpoint.position.phase))},
                     {"step", std::to_string(checkpoint.position.step)},
                     {"seconds", std::to_string(checkpoint.seconds)}};
    for (const auto& [key, value] : checkpoint.settings) {
      file.metadata[std::string(kSettingPrefix) + key] = value;
    }
    for (const auto& [key, value] : checkpoint.environment) {
      file.metadata[std::string(kEnvironmentPrefix) + key] = value;
    }
    file.tensors = std::move(checkpoint.state);
    file.metadata[kDigest] = digest(file);
    const fs::path next = folder / "next.safetensors";
    write_file_atomically(next, serialize_safetensors(file));
    // Between the two renames only the previous one is there, and it is whole.
    if (fs::exists(latest)) fs::rename(latest, folder / kPrevious);
    publish(next, latest);
  } catch (const std::exception&) {
    std::throw_with_nested(std::runtime_error("cannot save the checkpoint " + latest.string()));
  }
}

std::optional<TrainingCheckpoint> load_checkpoint(
    const fs::path& folder, const std::function<void(const std::string&)>& warn) {
  const fs::path latest = folder / kLatest;
  const fs::path previous = folder / kPrevious;
  if (fs::exists(latest)) {
    try {
      return read(latest);
    } catch (const std::runtime_error& error) {
      if (!fs::exists(previous)) {
        std::throw_with_nested(std::runtime_error(
            "expected a whole checkpoint, got a damaged one and no earlier one, in " +
            latest.string() + " (--overwrite starts again)"));
      }
      const fs::path damaged = folder / kDamaged;
      warn("the checkpoint " + latest.string() + " cannot be read (" + error.what() +
           "); it was renamed to " + damaged.string() +
           ", and training resumes from the one before");
      // Else the next save would put it in the good one's place.
      fs::rename(latest, damaged);
    }
  } else if (!fs::exists(previous)) {
    return std::nullopt;
  }
  try {
    return read(previous);
  } catch (const std::runtime_error&) {
    std::throw_with_nested(std::runtime_error("expected a whole checkpoint, got damaged ones, in " +
                                              folder.string() + " (--overwrite starts again)"));
  }
}

fs::path last_checkpoint(const fs::path& folder) {
  for (const char* name : {kLatest, kPrevious}) {
    if (fs::exists(folder / name)) return folder / name;
  }
  return {};
}

}  // namespace eventgan
