#include "pipeline/command_line/given_job.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <map>
#include <stdexcept>
#include <system_error>
#include <utility>
#include <vector>

#include "manifests/documents/job_manifest.h"
#include "manifests/files/atomic_file.h"
#include "manifests/values/faults.h"
#include "manifests/values/text_lines.h"
#include "pipeline/command_line/standard_streams.h"
#include "pipeline/command_line/usage.h"
#include "stages/frames/sources/find_source.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// Where labels came to the folder since, its images may be found in another place below it.
bool is_of(const JobManifest& manifest, const FoundSource& found, const fs::path& given) {
  return std::ranges::all_of(manifest.sources, [&](const SourceSpec& source) {
    const fs::path root = resolve(manifest, source.root).lexically_normal();
    const fs::path below = root.lexically_relative(fs::absolute(given).lexically_normal());
    const bool is_within = !below.empty() && *below.begin() != "..";
    std::error_code unknown;
    return source.dataset == found.dataset &&
           (is_within || root == found.root || fs::equivalent(root, found.root, unknown));
  });
}

JobManifest read_kept(const fs::path& file, const FoundSource& found, const fs::path& given) {
  JobManifest manifest = read_job_manifest(file);
  if (!is_of(manifest, found, given)) {
    throw UsageError(fmt::format(
        "expected the manifest for {} ({}), got that of another job, in {} (--output names another "
        "folder; eventgan convert {} goes on with that job)",
        found.root.string(), to_string(found.dataset), file.string(), shell_word(file.string())));
  }
  return manifest;
}

/// What an earlier run has kept, an option of this run does not change.
void require_kept(const DraftWishes& wishes, const JobManifest& manifest, const fs::path& file) {
  const auto refuse = [&](const char* option) {
    throw UsageError(fmt::format(
        "{}: expected what was given when the job began, got another, in {} (--output names "
        "another folder)",
        option, file.string()));
  };
  const auto has_rests = [&](const SourceSpec& source) {
    const auto& stills = source.pairs.stills;
    return stills && stills->objects && stills->rests == rests_of(*wishes.camera);
  };
  if (wishes.camera && std::ranges::none_of(manifest.sources, has_rests)) refuse("--camera");
  if (wishes.camera == CameraMotion::kMoves && manifest.generator.weights != "shipped:16") {
    refuse("--camera");  // the folders' names alone made it so: other weights are written then
  }
  const auto has_classes = [&](const SourceSpec& source) {
    return source.classes == wishes.classes;
  };
  if (!wishes.classes.empty() && !std::ranges::all_of(manifest.sources, has_classes)) {
    refuse("--classes");
  }
  const auto has_own_labels = [](const SourceSpec& source) { return source.labels.has_value(); };
  if (wishes.no_labels && std::ranges::any_of(manifest.sources, has_own_labels)) {
    refuse(kNoLabelsOption);
  }
}

/// A labelled set that becomes samples without a box is worse than none.
void require_labels_read(const std::vector<FoundSource>& sources) {
  for (const FoundSource& source : sources) {
    if (source.unread.empty()) continue;
    throw InputError(fmt::format(
        "expected labels that can be read, or none, got: {} ({} goes on without labels)",
        fmt::join(source.unread, "; "), kNoLabelsOption));
  }
}

/// WIDTHxHEIGHT
ImageSize parse_sensor(const std::string& text) {
  constexpr int kMostSide = 8192;  // as the manifest's `sensor`
  ImageSize size;
  const char* const end = text.data() + text.size();
  const auto width = std::from_chars(text.data(), end, size.width);
  const bool goes_on = width.ec == std::errc() && width.ptr != end && *width.ptr == 'x';
  const auto height = std::from_chars(goes_on ? width.ptr + 1 : end, end, size.height);
  const auto is_side = [](int side) { return side >= 1 && side <= kMostSide; };
  if (height.ec == std::errc() && height.ptr == end && is_side(size.width) &&
      is_side(size.height)) {
    return size;
  }
  throw UsageError(
      fmt::format("--sensor: expected WIDTHxHEIGHT of 1 to {} pixels, got {}", kMostSide, text));
}

const std::map<std::string, CameraMotion> kCameras{{"rests", CameraMotion::kRests},
                                                   {"moves", CameraMotion::kMoves},
                                                   {"both", CameraMotion::kBoth}};

}  // namespace

std::string GivenWishes::text() const {
  std::string text;
  for (const auto& [word, camera] : kCameras) {
    if (draft.camera == camera) text += " --camera " + word;
  }
  if (!draft.classes.empty())
    text += " --classes " + shell_word(fmt::format("{}", fmt::join(draft.classes, ",")));
  if (draft.no_labels) text += std::string(" ") + kNoLabelsOption;
  if (sensor) text += " --sensor " + *sensor;
  return text;
}

void add_draft_options(CLI::App& command, DraftWishes& wishes) {
  take_one_of(
      command.add_option("--camera", wishes.camera,
                         "Of photographs with boxes: the camera whose events are wanted "
                         "rests, moves, or does both; default: moves for driving scenes, as "
                         "their folders are called, else rests"),
      kCameras);
  command
      .add_option("--classes", wishes.classes,
                  "Take only the boxes of these classes; others are left out and counted")
      ->delimiter(',')
      ->option_text("A,B,...");
  command.add_flag(kNoLabelsOption, wishes.no_labels, kNoLabelsText);
}

void add_wishes_options(CLI::App& command, GivenWishes& wishes) {
  add_draft_options(command, wishes.draft);
  command
      .add_option(
          "--sensor", wishes.sensor,
          "The size of the sensor in pixels, such as 1280x720, of a recording that is given "
          "without a manifest and whose file does not tell it")
      ->option_text("WIDTHxHEIGHT");
}

GivenJob read_given_job(const fs::path& given, const std::optional<fs::path>& output,
                        const GivenWishes& wishes) {
  GivenJob job;
  if (!may_be_source(given)) {
    if (const std::string fault = fault_of_file(given); !fault.empty()) throw UsageError(fault);
    if (const std::string text = wishes.text(); !text.empty()) {
      throw UsageError(fmt::format(
          "{}: expected a folder, video or recording, got a manifest, whose keys count, in {}",
          text.substr(1), given.string()));
    }
    job.manifest = read_job_manifest(given);
    job.output =
        output.value_or(resolve(job.manifest, job.manifest.output.directory).lexically_normal());
    if (!job.output.has_filename()) job.output = job.output.parent_path();  // "out/"
    return job;
  }
  std::vector<FoundSource> sources = find_sources(given);
  if (wishes.draft.no_labels) go_without_labels(sources);
  FoundSource& found = sources.front();
  if (wishes.sensor) {
    found.sensor = parse_sensor(*wishes.sensor);
    if (found.dataset != DatasetKind::kRecording) {
      throw UsageError(fmt::format("--sensor: expected a recording, got {}, in {}",
                                   to_string(found.dataset), found.root.string()));
    }
  }
  job.output = output.value_or(fs::path("out") / draft_name(sources));
  const fs::path file = job.output / "manifest.json";
  // In this order: another worker may keep the manifest and freeze the plan meanwhile.
  const bool has_plan = fs::exists(fs::symlink_status(job.output / "plan.json"));
  if (fs::exists(fs::symlink_status(file))) {
    job.manifest = read_kept(file, found, given);
    require_kept(wishes.draft, job.manifest, file);
    const auto& kept = job.manifest.sources.front().recording.sensor;
    if (found.sensor && kept != found.sensor) {
      throw UsageError(fmt::format("--sensor: expected {}, as when the job began, got {}, in {}",
                                   kept ? to_string(*kept) : "none", to_string(*found.sensor),
                                   file.string()));
    }
    job.findings = {"manifest: " + file.string() + ", kept as it was when the job began"};
    if (found.labels && !job.manifest.sources.front().labels) {
      job.findings.push_back("warning: that manifest does not name the labels in " +
                             found.labels->path.string());
    }
    return job;
  }
  if (has_plan) {
    throw UsageError(
        "expected a new output folder, or one with the manifest.json of this job, got that of a "
        "job whose manifest is elsewhere, in " +
        job.output.string() + " (--output names another folder)");
  }
  require_labels_read(sources);
  const fs::path folder = fs::absolute(file).parent_path();
  ManifestDraft draft = draft_manifest(sources, {folder, /*is_relative=*/false, "."}, wishes.draft);
  if (!draft.has_samples) {
    const char* const wanted = draft.needs_sensor
                                   ? "--sensor WIDTHxHEIGHT, the size that no file gives"
                               : has_events(found.dataset) ? "a recording with windows of events"
                                                           : "labelled frames that make pairs";
    throw InputError(fmt::format(
        "expected {}, got none, in {} ({}; eventgan init writes a manifest to complete)", wanted,
        found.root.string(), fmt::join(draft.findings, "; ")));
  }
  job.manifest = parse_job_manifest(draft.text, folder, file.string());
  job.findings = std::move(draft.findings);
  job.unwritten = file;
  return job;
}

fs::path job_folder(const GivenJob& job, const std::optional<fs::path>& output,
                    std::optional<std::int64_t> limit) {
  fs::path folder = job.output;  // which is `output`, if there is one
  if (limit && !output) folder += fmt::format("-trial-{}", *limit);
  return folder;
}

void keep_manifest(const GivenJob& job) {
  if (!job.unwritten) return;
  const fs::path& file = *job.unwritten;
  std::error_code error;
  fs::create_directories(file.parent_path(), error);
  if (error) {
    throw std::runtime_error("cannot create " + file.parent_path().string() + ": " +
                             error.message());
  }
  const bool is_new =
      create_file_atomically(file, [&](const TextSink& sink) { sink(job.manifest.text); });
  if (!is_new && read_job_manifest(file).text != job.manifest.text) {
    throw UsageError("expected no manifest yet, got one that another run has kept meanwhile, in " +
                     file.string() + ": run again");
  }
  tell("manifest: " + file.string());
}

}  // namespace eventgan
