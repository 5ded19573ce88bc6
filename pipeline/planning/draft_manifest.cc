#include "pipeline/planning/draft_manifest.h"

#include <fmt/core.h>
#include <fmt/format.h>
#include <utf8.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "manifests/documents/job_manifest.h"
#include "manifests/documents/json_text.h"
#include "manifests/values/faults.h"
#include "manifests/values/job.h"
#include "pipeline/planning/outline_masks.h"
#include "pipeline/planning/source_draft.h"
#include "stages/frames/dataset/dataset_reader.h"
#include "stages/generator/onednn/onednn_generator.h"
#include "stages/generator/shipped_weights.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

std::string quoted(const std::string& text) {
  if (!utf8::is_valid(text)) {
    throw UsageError("expected a path in UTF-8, as manifests are, got another, in " + text);
  }
  return dump_json(nlohmann::json(text));
}

/// A job's name after a folder or a video, so that two of them do not come into each other's way;
/// empty if the path has no name that serves.
std::string name_after(fs::path path) {
  constexpr std::size_t kLongest = 50;
  constexpr std::string_view kAllowed =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-";
  const auto is_common = [](const fs::path& folder) {  // each dataset of its kind has it
    return std::ranges::any_of(std::array{"training", "testing", "image_2", "image_02", "images",
                                          "JPEGImages", "frames", "data"},
                               [&](const char* name) { return folder.filename() == name; });
  };
  const bool is_folder = fs::is_directory(path);
  while (is_common(path)) path = path.parent_path();
  std::string name;
  for (const char c : (is_folder ? path.filename() : path.stem()).string()) {
    const bool is_allowed = kAllowed.find(c) != kAllowed.npos;
    if (is_allowed || !name.ends_with('_')) name += is_allowed ? c : '_';
  }
  name.erase(0, name.find_first_not_of("._-"));
  return name.empty() ? "" : name.substr(0, kLongest) + "-events";
}

/// The set of driving scenes that the source is one of, as the folders around its images or the
/// file of its labels are called: with a word of these that is no part of a longer one. Empty: none
/// that is known.
std::string_view driving_set(const FoundSource& found) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 7> kSets{
      {{"bdd100k", "BDD100K"},
       {"camvid", "CamVid"},
       {"cityscapes", "Cityscapes"},
       {"leftImg8bit", "Cityscapes"},
       {"kitti", "KITTI"},
       {"nuimages", "nuImages"},
       {"CAM_FRONT", "nuImages"}}};
  if (found.dataset == DatasetKind::kKittiObject) return "KITTI";
  constexpr int kFoldersAround = 4;  // bdd100k/images/100k/train
  std::vector<std::string> names;
  if (found.labels) names.push_back(found.labels->path.filename().string());
  fs::path folder = found.root;
  for (int i = 0; i < kFoldersAround; ++i, folder = folder.parent_path()) {
    names.push_back(folder.filename().string());
  }
  const auto byte = [](char letter) { return static_cast<unsigned char>(letter); };
  const auto same_letter = [&](char a, char b) {
    return std::tolower(byte(a)) == std::tolower(byte(b));
  };
  for (const auto& [word, title] : kSets) {
    for (const std::string& name : names) {
      const auto at = std::search(name.begin(), name.end(), word.begin(), word.end(), same_letter);
      if (at == name.end()) continue;
      const auto end = at + std::ssize(word);
      const bool is_longer = (at != name.begin() && std::isalpha(byte(at[-1]))) ||
                             (end != name.end() && std::isalpha(byte(*end)));
      if (!is_longer) return title;
    }
  }
  return {};
}

/// Writes manifests.
class Draft {
 public:
  Draft(const DraftPlace& place, std::string name, const DraftWishes& wishes)
      : place_(place), name_(std::move(name)), wishes_(wishes) {}

  /// Photographs whose objects move on their own.
  static bool is_in_layers(const SourceDraft& source) {
    return source.is_stills &&
           (source.found.labels || source.found.dataset == DatasetKind::kKittiObject);
  }

  std::string text(const std::vector<SourceDraft>& sources) const {
    const bool is_events = has_events(sources.front().found.dataset);
    std::vector<std::string> written;
    const bool is_reduced = has_davis_size(sources);
    for (const SourceDraft& source : sources) written.push_back(source_text(source, is_reduced));
    return fmt::format(R"({{
  "format": "eventgan-manifest",
  "version": 1,
  "name": "{}",  // shards are named {}-SPLIT-NUMBER-of-COUNT.h5
  "seed": 7,  // decides what is drawn, such as each labelled frame's gap

  "sources": [
{}
  ],

{}{}  "output": {{ "directory": {} }}
}}
)",
                       name_, name_, fmt::join(written, ",\n"), image_text(sources),
                       is_events ? std::string(kEvents) : generator_text(sources),
                       quoted(place_.output));
  }

  /// Decides what `text` says of the network: what it found, a line each.
  std::vector<std::string> decide(const std::vector<SourceDraft>& sources) {
    std::vector<std::string> lines;
    if (has_events(sources.front().found.dataset)) return lines;
    has_int8_ = int8_pays(moves() ? kWideWeights : kNarrowWeights);
    if (!wishes_.camera) {
      for (const SourceDraft& source : sources) {
        const std::string why = camera_text(source);
        if (!why.empty() && std::ranges::find(lines, why) == lines.end()) lines.push_back(why);
      }
    }
    if (!is_network(sources)) return lines;
    if (const OnednnSupport int8 = onednn_support(Precision::kInt8); int8.able && !int8.native) {
      lines.push_back(
          fmt::format("\"precision\": \"{}\" is the better one here; this processor "
                      "({}) has no instructions for int8",
                      precision(), int8.instruction_set));
    }
    if (const SeenMotion seen = motion_of(sources); seen.pairs > 0) {
      lines.push_back((pays(seen) ? "\"scope\": \"motion\", since " : "all tiles are generated: ") +
                      motion_text(seen, " "));
    }
    return lines;
  }

 private:
  bool is_network(const std::vector<SourceDraft>& sources) const {
    return !has_events(sources.front().found.dataset) &&
           !std::ranges::all_of(sources, [&](const SourceDraft& source) {
             return is_in_layers(source) && camera_of(source) == CameraMotion::kRests;
           });
  }

  CameraMotion camera_of(const SourceDraft& source) const {
    return wishes_.camera.value_or(driving_set(source.found).empty() ? CameraMotion::kRests
                                                                     : CameraMotion::kMoves);
  }

  /// What is assumed of the camera before which photographs in layers are seen; of others nothing.
  std::string camera_text(const SourceDraft& source) const {
    if (!is_in_layers(source)) return "";
    const std::string_view drives = driving_set(source.found);
    return drives.empty() ? fmt::format(
                                "\"rests\": {}, for a camera that stays still; --camera "
                                "moves or both for another",
                                rests_of(CameraMotion::kRests))
                          : fmt::format(
                                "\"rests\": 0, since cameras of driving scenes ({}) move; "
                                "--camera rests or both for another",
                                drives);
  }

  /// Of the sources together, by their numbers of frames.
  static SeenMotion motion_of(const std::vector<SourceDraft>& sources) {
    SeenMotion seen;
    double frames = 0, moving = 0, work = 0;
    for (const SourceDraft& source : sources) {
      const auto count = static_cast<double>(source.labelled_frames);
      frames += count;
      moving += count * source.motion.tiles;
      work += count * source.motion.work;
      seen.pairs += source.motion.pairs;
      seen.resting += source.motion.resting;
    }
    if (frames > 0) {
      seen.tiles = moving / frames;
      seen.work = work / frames;
    }
    return seen;
  }

  /// Whether it is worth losing what is too faint to count as motion.
  static bool pays(const SeenMotion& seen) {
    constexpr double kMostWork = 0.9;
    return seen.pairs > 0 && seen.work <= kMostWork;
  }

  static std::string motion_text(const SeenMotion& seen, std::string_view between) {
    return fmt::format(
        "{:.0f} % of the tiles move and take {:.0f} % of the network's work{}(the image rests in "
        "{} of {} pairs)",
        100 * seen.tiles, 100 * seen.work, between, seen.resting, seen.pairs);
  }

  const char* precision() const { return has_int8_ ? "int8" : "auto"; }

  std::string generator_text(const std::vector<SourceDraft>& sources) const {
    const SeenMotion seen = motion_of(sources);
    const std::string scope = pays(seen) ? R"(, "scope": "motion")" : "";
    const std::string scope_comment = pays(seen)
                                          ? fmt::format(
                                                "  // Only what moves is generated (\"scope\"): {} "
                                                "(manifests/guides/speed.md).\n",
                                                motion_text(seen, "\n  // "))
                                          : "";
    if (moves()) {
      return fmt::format(
          R"(  // Before a moving camera detectors of persons learn most from the wide weights (manifests/guides/choose.md).
{}  "generator": {{ "weights": "shipped:16", "precision": "{}"{} }},
)",
          scope_comment, precision(), scope);
    }
    if (!is_network(sources)) {
      return fmt::format(
          R"(  // The motion of photographs is drawn, so a simulator can follow it: detectors of persons learn more
  // from its events than from the network's (manifests/guides/choose.md):
  // "generator": {{ "weights": "shipped:8", "precision": "{}" }},
  "generator": {{ "kind": "esim" }},
)",
          precision());
    }
    return fmt::format(
        R"(  // Detectors and pose networks learn as much from the narrow weights{} as from the wide ones in
  // float32, "shipped:16", which take several times as long (manifests/guides/choose.md).
  // Weights of your own: {{ "weights": "my.safetensors" }}.
{}  "generator": {{ "weights": "shipped:8", "precision": "{}"{} }},
  // Weights that know their sensor make the events of a camera, of one that ships or of your own, which
  // `eventgan fit --weights` finds in its recordings (manifests/guides/sensor.md):
  // "generator": {{ "weights": "shipped:sensor", "sensor": "davis346" }},
)",
        has_int8_ ? " in 8 bits" : "", scope_comment, precision(), scope);
  }
  static constexpr std::string_view kEvents =
      R"(  // Volumes are made of the camera's own events.
  "generator": { "kind": "events" },
  // To go with generated volumes, in both jobs:
  // "volume": { "normalize": "eta98" },
)";

  std::string source_text(const SourceDraft& source, bool is_reduced) const {
    std::string text;
    for (const std::string& line : source.findings) {
      text += "    // " + escape_controls(line) + "\n";
    }
    text += fmt::format("    {{\n      \"dataset\": \"{}\",\n", to_string(source.found.dataset));
    text += source_keys(source.found);
    text += has_events(source.found.dataset) ? window_text(source)
            : source.is_stills               ? stills_text(source, is_reduced)
                                             : pairs_text(source);
    return text + "    }";
  }

  std::string source_keys(const FoundSource& found) const {
    std::string keys = key("root", found.root);
    if (!found.split.empty()) keys += fmt::format("      \"split\": \"{}\",\n", found.split);
    if (!found.layout.empty()) {
      keys += fmt::format("      \"layout\": \"{}\",\n", found.layout);
    }
    keys += found.more_keys;
    if (found.raw_root) keys += key("raw_root", *found.raw_root);
    if (found.devkit) keys += key("devkit", *found.devkit);
    if (found.annotations) keys += key("annotations", *found.annotations);
    if (found.sequences) keys += key("sequences", *found.sequences);
    if (found.has_no_labels) keys += "      \"labels\": \"none\",\n";
    if (found.ids) keys += key("ids", *found.ids);
    if (found.labels) {
      keys += fmt::format("      \"labels\": {{ \"format\": \"{}\", \"path\": {} }},\n",
                          to_string(found.labels->format), written(found.labels->path));
      if (found.labels->outlines) keys += key("outlines", *found.labels->outlines);
    }
    if (found.sensor) {
      keys += fmt::format("      \"sensor\": {{ \"width\": {}, \"height\": {} }},\n",
                          found.sensor->width, found.sensor->height);
    }
    if (!wishes_.classes.empty()) {
      std::vector<std::string> classes;
      for (const std::string& name : wishes_.classes) classes.push_back(quoted(name));
      keys += fmt::format("      \"classes\": [{}],\n", fmt::join(classes, ", "));
    }
    if (found.columns != EventFields()) {
      const std::string& p = found.columns.p;
      keys += fmt::format("      \"columns\": {{ \"t\": {}{} }},\n", quoted(found.columns.t),
                          p == EventFields().p ? "" : ", \"p\": " + quoted(p));
    }
    return keys;
  }

  static std::string pairs_text(const SourceDraft& source) {
    return fmt::format(
        R"(      // One pair per labelled frame, its gap drawn from these; "choose": "all" makes one per gap.
      "pairs": {{ "gaps": [{}], "side": "{}", "choose": "one" }}
)",
        fmt::join(source.gaps, ", "), to_string(source.habits.side));
  }

  bool moves() const {
    return wishes_.camera.value_or(CameraMotion::kRests) != CameraMotion::kRests;
  }

  static bool has_many_shapes(const std::vector<SourceDraft>& sources) {
    return std::ranges::any_of(sources, [&](const SourceDraft& source) {
      return (source.is_stills && source.has_sizes) ||
             source.habits.size != sources.front().habits.size;
    });
  }

  static bool has_large_stills(const std::vector<SourceDraft>& sources) {
    constexpr int kLongestSensor = 1280;
    return std::ranges::any_of(sources, [](const SourceDraft& source) {
      return source.is_stills &&
             std::max(source.usual_size.width, source.usual_size.height) > kLongestSensor;
    });
  }

  /// Volumes have a DAVIS346's size.
  static bool has_davis_size(const std::vector<SourceDraft>& sources) {
    return has_many_shapes(sources) || has_large_stills(sources);
  }

  /// By how much more pixels an image moves than one of COCO or Pascal VOC, of some 500, for which
  /// the defaults are, so that its volume of a DAVIS346's size shows as much motion.
  static double motion_factor(ImageSize image) {
    constexpr double kWidth = 346, kHeight = 260, kShown = 0.65;  // px of a volume to one of 500
    constexpr double kMost = 12;                                  // 100 px is the manifest's bound
    return std::clamp(std::round(kShown * std::max(image.width / kWidth, image.height / kHeight)),
                      1.0, kMost);
  }

  std::string stills_text(const SourceDraft& source, bool is_reduced) const {
    StillsSpec spec;
    ObjectMotionSpec object;
    const double factor = is_reduced ? motion_factor(source.usual_size) : 1;
    for (double& most : spec.translation_px) most *= factor;
    for (double& most : object.translation_px) most *= factor;
    const std::string image = fmt::format(
        R"("translation_px": [{}, {}], "rotation_deg": {}, "scale": {}, "frames": {})",
        spec.translation_px[0], spec.translation_px[1], spec.rotation_deg, spec.scale, spec.frames);
    if (!is_in_layers(source)) {
      return fmt::format(
          R"(      // The motion of each image is drawn: what moves is everything, as before a moving camera.
      "pairs": {{
        "from": "stills",
        "motion": {{ {} }}
      }}
)",
          image);
    }
    const std::string_view drives = wishes_.camera ? "" : driving_set(source.found);
    return fmt::format(
        R"(      // The motion of each image is drawn{}
      // Each object moves on its own; one whose labels have no outline is cut out of its box.
      "pairs": {{
        "from": "stills",
        "motion": {{
          {},
          "rests": {},
          "objects": {{ "translation_px": [{}, {}], "rotation_deg": {}, "scale": {} }}
        }}
      }}
)",
        drives.empty()
            ? "; \"rests\" is the share before a camera at rest, 0 for a camera that moves."
            : fmt::format(", and none rests, since cameras of driving scenes ({}) move.", drives),
        image, rests_of(camera_of(source)), object.translation_px[0], object.translation_px[1],
        object.rotation_deg, object.scale);
  }

  static std::string window_text(const SourceDraft& source) {
    std::string text;
    if (source.needs_sensor) {
      const ImageSize size = source.guess ? source.guess->size : ImageSize{260, 346};
      text += fmt::format("      // \"sensor\": {{ \"width\": {}, \"height\": {} }},\n", size.width,
                          size.height);
    }
    text +=
        source.are_windows
            ? R"(      // Each file is a window. With it, only the last events of each are:
      // "window_s": 0.05,
)"
        : source.has_frames
            ? R"(      // Without it, a window is an interval between two frames:
      // "window_s": 0.05,
)"
            : R"(      "window_s": 0.05,  // there are no frames, between which a window could lie
)";
    return text + "      \"label_at\": \"end\"\n";
  }

  /// One size and one preset serve all sources.
  static std::string image_text(const std::vector<SourceDraft>& sources) {
    const SourceDraft& first = sources.front();
    const bool has_presets = std::ranges::any_of(
        sources, [&](const SourceDraft& source) { return source.preset != first.preset; });
    std::vector<std::string> keys;
    std::string_view comment = first.habits.size_comment;
    if (has_davis_size(sources)) {
      comment = has_many_shapes(sources)
                    ? "Images come in many shapes; a DAVIS346 camera's size, "
                      "with borders, keeps each one's."
                    : "Some images are larger than any event camera's; a DAVIS346 "
                      "camera's size, with borders, keeps their shape.";
      keys.emplace_back(kDavisSize);
    } else if (!first.habits.size.empty()) {
      keys.emplace_back(first.habits.size);
    }
    if (std::ranges::all_of(sources, [](const SourceDraft& source) {
          return source.range.has_value();
        })) {  // else it would cut others
      ValueRange range = *first.range;
      for (const SourceDraft& source : sources) {
        range = {std::min(range.low, source.range->low), std::max(range.high, source.range->high)};
      }
      keys.push_back(fmt::format("\"range\": [{}, {}]", range.low, range.high));
    }
    std::string text = fmt::format("  // {}\n", comment);
    if (has_presets) {
      text += fmt::format("  // The sources' own presets differ; this is that of {}.\n",
                          to_string(first.found.dataset));
      keys.push_back(fmt::format("\"preset\": \"{}\"", first.preset));
    }
    return text + (keys.empty() ? "  \"image\": {},\n"
                                : fmt::format("  \"image\": {{ {} }},\n", fmt::join(keys, ", ")));
  }

  std::string key(std::string_view name, const fs::path& path) const {
    return fmt::format("      \"{}\": {},\n", name, written(path));
  }

  std::string written(const fs::path& path) const {
    return quoted(
        (place_.is_relative ? path.lexically_proximate(place_.folder) : path).generic_string());
  }

  static constexpr int kWideWeights = 16;

  DraftPlace place_;
  std::string name_;
  DraftWishes wishes_;
  bool has_int8_ = false;
};

void require_one_job(const std::vector<FoundSource>& sources) {
  for (std::size_t i = 1; i < sources.size(); ++i) {
    const FoundSource &first = sources.front(), &now = sources[i];
    if (has_events(first.dataset) != has_events(now.dataset)) {
      throw UsageError(fmt::format(
          "expected frames alone or recordings of events alone, got {} ({}) and {} ({}): a job has "
          "either generated events or real ones",
          first.root.string(), to_string(first.dataset), now.root.string(),
          to_string(now.dataset)));
    }
    for (std::size_t before = 0; before < i; ++before) {
      std::error_code unknown;
      const FoundSource& other = sources[before];
      if (other.root != now.root && !fs::equivalent(other.root, now.root, unknown)) continue;
      if (other.ids && now.ids && *other.ids != *now.ids) continue;
      if (other.labels && now.labels && other.labels->path != now.labels->path) continue;
      throw UsageError("expected each folder or video once, got it twice: " + now.root.string());
    }
  }
}

}  // namespace

std::string draft_name(const std::vector<FoundSource>& sources) {
  const fs::path& first = sources.front().root;
  const fs::path above = first.parent_path();
  std::string name;
  if (sources.size() > 1 && std::ranges::all_of(sources, [&](const FoundSource& source) {
        return source.root.parent_path() == above;
      })) {
    name = name_after(above);
  }
  if (name.empty()) name = name_after(first);
  return name.empty() ? std::string(to_string(sources.front().dataset)) + "-events" : name;
}

double rests_of(CameraMotion camera) {
  switch (camera) {
    case CameraMotion::kRests:
      return 0.5;
    case CameraMotion::kMoves:
      return 0;
    case CameraMotion::kBoth:
      return 0.25;
  }
  return 0;
}

ManifestDraft draft_manifest(const std::vector<FoundSource>& sources, const DraftPlace& place,
                             const DraftWishes& wishes) {
  require_one_job(sources);
  Draft draft(place, draft_name(sources), wishes);
  std::vector<SourceDraft> drafts;
  ManifestDraft made;
  made.has_samples = true;
  for (const FoundSource& found : sources) {
    SourceDraft source(found);
    const auto read_draft = [&] {
      return parse_job_manifest(draft.text({source}), place.folder,
                                "the manifest for " + found.root.string());
    };
    JobManifest alone = read_draft();
    if (alone.sources.front().outlines) {
      const std::string fault = masks_fault(alone.sources.front(), place.folder);
      if (!fault.empty()) {
        source.found.remarks.push_back("masks left out, since they do not fit the boxes: " + fault);
        source.found.labels->outlines.reset();
        alone = read_draft();
      }
    }
    source.preset = alone.image.preset;
    look_at_source(alone.sources.front(), alone.image, place.folder, source);
    if (found.ids) {
      source.findings.push_back("of these only what is listed in " + found.ids->string());
      if (!source.is_stills) {
        source.findings.emplace_back(
            "warning: a list takes labelled frames alone: the other frame of a pair may be of "
            "another split (\"from\": \"stills\" pairs each frame with itself)");
      }
    }
    if (sources.size() > 1) source.findings.insert(source.findings.begin(), found.root.string());
    made.has_samples &= source.has_samples;
    made.needs_sensor |= source.needs_sensor;
    std::ranges::copy(source.findings, std::back_inserter(made.findings));
    std::ranges::move(source.notes, std::back_inserter(made.notes));
    drafts.push_back(std::move(source));
  }
  if (wishes.camera && std::ranges::none_of(drafts, Draft::is_in_layers)) {
    const FoundSource& first = drafts.front().found;
    throw UsageError(fmt::format("--camera: expected photographs with labels, got {}, in {}",
                                 first.title, first.root.string()));
  }
  std::ranges::move(draft.decide(drafts), std::back_inserter(made.findings));
  made.text = draft.text(drafts);
  parse_job_manifest(made.text, place.folder, "the manifest for " + sources.front().root.string());
  return made;
}

}  // namespace eventgan
