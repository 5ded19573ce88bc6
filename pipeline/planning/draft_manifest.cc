#include "pipeline/planning/draft_manifest.h"

#include <fmt/core.h>
#include <fmt/format.h>
#include <utf8.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <set>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "manifests/documents/detail/json_text.h"
#include "manifests/documents/job_manifest.h"
#include "manifests/values/faults.h"
#include "manifests/values/job.h"
#include "manifests/values/text.h"
#include "pipeline/planning/make_plan.h"
#include "pipeline/planning/outline_masks.h"
#include "pipeline/planning/spread.h"
#include "stages/frames/dataset.h"
#include "stages/frames/dataset_kinds.h"
#include "stages/frames/decoding/frame_decoder.h"
#include "stages/generator/onednn/onednn_generator.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// A sensor that the events of a recording fit on.
struct SensorGuess {
  ImageSize size;
  int x = 0, y = 0;  ///< the largest of an event
};

/// What is known of a source when its part of the manifest is written.
struct SourceDraft {
  explicit SourceDraft(const FoundSource& source)
      : found(source), habits(dataset_reader(source.dataset).habits) {
    std::ranges::copy_if(habits.gaps, std::back_inserter(gaps), [](int gap) { return gap > 0; });
  }

  bool has_range() const { return range.has_value(); }

  FoundSource found;
  const DraftHabits& habits;
  std::vector<int> gaps = {};
  std::string preset = {};  ///< of its dataset; empty of events
  std::vector<std::string> findings = {};
  bool is_stills = false;
  bool has_sizes = false;                 ///< the images that were looked at have several sizes
  bool has_frames = false;                ///< recording
  bool are_windows = false;               ///< recordings, each a labelled window of its own
  bool needs_sensor = false;              ///< recording whose files do not tell the sensor's size
  std::optional<SensorGuess> guess = {};  ///< then: what the events show, if any was seen
  bool has_samples = false;
  std::optional<ValueRange> range = {};  ///< of images of 16 bits that use little of them
};

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

/// What is counted before the manifest is written.
struct Survey {
  std::int64_t labelled_frames = 0;
  std::int64_t sequences = 0;
  std::int64_t annotation_files = 0;
  std::map<int, std::int64_t> pairs_by_gap;  ///< every gap that `side` allows
  std::int64_t missing = 0;                  ///< pairs at fault, as far as names tell
};

Survey survey(const Dataset& dataset, SourceSpec spec) {
  Survey counted;
  spec.pairs.choose = PairChoice::kAll;
  spec.pairs.gaps =
      spec.pairs.side == PairSide::kAround ? std::vector{2, 4, 6} : std::vector{1, 2, 3, 4, 5, 6};
  for (const int gap : spec.pairs.gaps) counted.pairs_by_gap[gap] = 0;
  std::set<std::string_view> sequences;
  for (const LabelledFrame& frame : dataset.labelled_frames()) {
    if (!frame.sequence.empty()) sequences.insert(frame.sequence);
    for (const PlannedSample& sample : choose_pairs(dataset, frame, spec, 0).samples) {
      ++(sample.fault.empty() ? counted.pairs_by_gap[sample.pair.gap_frames] : counted.missing);
    }
  }
  counted.labelled_frames = std::ssize(dataset.labelled_frames());
  counted.sequences = std::ssize(sequences);
  counted.annotation_files = std::ssize(dataset.annotation_files());
  return counted;
}

std::vector<int> gaps_to_take(const Survey& survey, const std::vector<int>& habits) {
  std::vector<int> usual, any;
  for (const auto& [gap, count] : survey.pairs_by_gap) {
    if (count == 0) continue;
    any.push_back(gap);
    if (std::ranges::find(habits, gap) != habits.end()) usual.push_back(gap);
  }
  return !usual.empty() ? usual : !any.empty() ? any : habits;
}

std::string where_text(PairSide side) {
  switch (side) {
    case PairSide::kBefore:
      return "before them";
    case PairSide::kAfter:
      return "after them";
    case PairSide::kAround:
      return "around them";
  }
  throw std::logic_error("where_text: not a side");
}

using Image = cv::Mat_<float>;

/// Grey, small, without what varies slowly: light and darkness are alike in many scenes.
Image details_of(const ColourFrame& frame) {
  const cv::Mat colour(frame.size.height, frame.size.width, CV_8UC3,
                       const_cast<std::uint8_t*>(frame.bgr.data()));
  cv::Mat grey, blurred;
  cv::cvtColor(colour, grey, cv::COLOR_BGR2GRAY);
  cv::resize(grey, grey, {96, 72}, 0, 0, cv::INTER_AREA);
  grey.convertTo(grey, CV_32F);
  cv::GaussianBlur(grey, blurred, {}, /*sigmaX=*/6);
  return grey - blurred;
}

/// How much two frames show the same things: the median, over the tiles of the first that show
/// anything, of the best correlation with a place in the second up to 8 of 96 pixels away. None if
/// no tile does.
///
/// Measured on the first 60 neighbours of each: medians of 23 real sequences, of cameras at rest,
/// in hands, in cars and in the air, 10 to 50 frames a second, 0.85 to 1.00 (single pairs 0.45 and
/// more); medians of 6 sets of unrelated images, KITTI object's streets among them, 0.21 to 0.24
/// (single pairs 0.13 to 0.48).
std::optional<double> likeness(const ColourFrame& first, const ColourFrame& second) {
  constexpr int kTile = 24, kReach = 8;
  constexpr double kFlat = 2;  // standard deviation, grey levels
  const Image a = details_of(first), b = details_of(second);
  const cv::Rect all(0, 0, b.cols, b.rows);
  std::vector<double> best;
  for (int y = 0; y < a.rows; y += kTile) {
    for (int x = 0; x < a.cols; x += kTile) {
      const cv::Mat tile = a(cv::Rect(x, y, kTile, kTile));
      cv::Scalar mean, deviation;
      cv::meanStdDev(tile, mean, deviation);
      if (deviation[0] < kFlat) continue;
      const int side = kTile + 2 * kReach;
      cv::Mat correlation;
      cv::matchTemplate(b(cv::Rect(x - kReach, y - kReach, side, side) & all), tile, correlation,
                        cv::TM_CCOEFF_NORMED);
      cv::minMaxLoc(correlation, nullptr, &best.emplace_back());
    }
  }
  if (best.empty()) return std::nullopt;
  const auto middle = best.begin() + std::ssize(best) / 2;
  std::ranges::nth_element(best, middle);
  return *middle;
}

/// Looks at the sizes of some images; a line if a sequence has several.
void compare_sizes(const Dataset& dataset, const fs::path& folder, SourceDraft& draft) {
  constexpr std::size_t kMost = 200;
  const auto& frames = dataset.labelled_frames();
  std::map<std::string_view, std::pair<ImageSize, std::string_view>> first;  // of a sequence
  for (const std::size_t i : spread(kMost, frames.size())) {
    const std::string& path = frames[i].frame.path;
    const Outcome<ImageSize> probed = probe_image_size(folder / path, ImageOrientation::kUpright);
    if (is_fault(probed)) continue;
    const auto size = *probed;
    const auto known = first.try_emplace(frames[i].sequence, size, path).first;
    draft.has_sizes |= first.begin()->second.first != size;
    if (draft.is_stills || known->second.first == size) continue;
    draft.is_stills = true;
    draft.findings.push_back(
        fmt::format("images of several sizes in one folder, {} in {} and {} in {}",
                    to_string(known->second.first), known->second.second, to_string(size), path));
  }
}

/// A line if images that are taken as neighbours have nothing to do with each other, as far as some
/// tell.
void compare_neighbours(const Dataset& dataset, const fs::path& folder, SourceDraft& draft) {
  constexpr std::size_t kPairs = 8, kTries = 64;
  constexpr double kUnrelated = 0.5;  // see likeness
  const FrameDecoder decoder(folder);
  const auto& frames = dataset.labelled_frames();
  std::size_t pairs = 0, unrelated = 0;
  std::string example;
  std::vector<std::size_t> places = spread(kTries, frames.size());
  for (std::size_t turn = 0; turn < kPairs && pairs < kPairs; ++turn) {
    for (std::size_t i = turn; i < places.size() && pairs < kPairs; i += kPairs) {
      const FrameRef& frame = frames[places[i]].frame;
      const PairedFrame next = dataset.paired_frame(frames[places[i]], 1);
      if (next.state != PairedFrame::State::kPresent) continue;
      const auto a = decoder.decode(frame, 1, ImageOrientation::kUpright, draft.range);
      const auto b = decoder.decode(next.frame, 1, ImageOrientation::kUpright, draft.range);
      if (is_fault(a) || is_fault(b)) continue;
      const auto alike = likeness(*a, *b);
      if (!alike) continue;
      ++pairs;
      if (*alike >= kUnrelated) continue;
      if (unrelated++ == 0) example = frame.path + " and " + next.frame.path;
    }
  }
  if (2 * unrelated <= pairs) return;
  draft.is_stills = true;
  draft.findings.push_back(
      fmt::format("{} of {} compared pairs of neighbouring images do not show the same scene, "
                  "first {}",
                  unrelated, pairs, example));
}

/// Decides whether each image makes a pair with itself. A video is a sequence, whatever it shows.
void consider_stills(const Dataset& dataset, const fs::path& folder, SourceDraft& draft) {
  const auto& frames = dataset.labelled_frames();
  const auto is_of_video = [](const LabelledFrame& frame) { return frame.frame.video_frame >= 0; };
  if (frames.empty() || std::ranges::any_of(frames, is_of_video)) return;
  if (is_own(draft.found.dataset)) {
    compare_sizes(dataset, folder, draft);
    compare_neighbours(dataset, folder, draft);
  }
  if (!draft.is_stills && draft.has_samples) return;
  if (!draft.is_stills) draft.findings.emplace_back("no frame has a paired frame");
  draft.is_stills = true;
  draft.findings.emplace_back(
      "no sequences: each image makes a pair with itself under a small motion (\"from\": "
      "\"stills\")");
  draft.has_samples =
      std::ranges::any_of(frames, [](const LabelledFrame& frame) { return frame.fault.empty(); });
}

/// What was counted, before what else was found.
std::vector<std::string> findings_of(const SourceDraft& draft, const Survey& survey) {
  const FoundSource& found = draft.found;
  const bool is_events = has_events(found.dataset);
  std::vector<std::string> lines;
  const bool is_labelled = !is_own(found.dataset) || found.labels;
  lines.push_back(std::string(found.title) + ": " +
                  count_text(survey.labelled_frames, is_events     ? "sample"
                                                     : is_labelled ? "labelled frame"
                                                                   : "frame"));
  if (survey.sequences > 0 && !draft.is_stills) {
    lines.back() += " of " + count_text(survey.sequences, is_events ? "recording" : "sequence");
  }
  lines.back() += is_labelled || survey.annotation_files > 0
                      ? ", " + count_text(survey.annotation_files, "annotation file",
                                          is_labelled ? "" : " passed through unread")
                      : ", NO LABELS";
  if (!is_events && !draft.is_stills) {
    lines.push_back(fmt::format("{}frames with a pair of frames {}, by gap: {}",
                                is_labelled ? "labelled " : "", where_text(draft.habits.side),
                                counts_text(survey.pairs_by_gap, "gap ")));
    if (survey.missing > 0) {
      lines.push_back(fmt::format("pairs with a missing or invalid frame: {}", survey.missing));
    }
  }
  if (found.labels) {
    lines.push_back(fmt::format("labels: {}, in {}",
                                row_of(kLabelFormats, found.labels->format).title,
                                found.labels->path.string()));
    if (found.labels->outlines) {
      lines.push_back("outlines: index masks, in " + found.labels->outlines->string());
    }
  }
  for (const std::string& unread : found.unread) lines.push_back("warning: " + unread);
  lines.insert(lines.end(), found.remarks.begin(), found.remarks.end());
  lines.insert(lines.end(), draft.findings.begin(), draft.findings.end());
  return lines;
}

/// Says so where no frame has a time, which the manifest can give.
void note_unknown_times(const Dataset& dataset, SourceDraft& draft) {
  if (!takes(dataset_row(draft.found.dataset), "frames_per_second")) return;
  const auto has_time = [](const LabelledFrame& frame) { return !std::isnan(frame.frame.time_s); };
  if (std::ranges::any_of(dataset.labelled_frames(), has_time)) return;
  draft.findings.emplace_back("no times, since images have none (set \"frames_per_second\")");
}

/// The smallest sensor of a camera on which the events lie, as far as some windows tell; none if
/// these have no event.
std::optional<SensorGuess> guess_sensor(const Dataset& recordings) {
  constexpr std::array kSensors{ImageSize{128, 128},  ImageSize{180, 240}, ImageSize{240, 304},
                                ImageSize{240, 320},  ImageSize{260, 346}, ImageSize{320, 320},
                                ImageSize{320, 480},  ImageSize{480, 640}, ImageSize{640, 768},
                                ImageSize{720, 1280}, ImageSize{800, 1280}};
  constexpr std::size_t kMostWindows = 64;
  const auto& windows = recordings.labelled_frames();
  SensorGuess guess;
  bool any = false;
  for (const std::size_t i : spread(kMostWindows, windows.size())) {
    if (!windows[i].fault.empty()) continue;
    const Outcome<EventWindow> window = recordings.events(windows[i].label_key);
    if (is_fault(window)) continue;
    any = any || !window->events.empty();
    for (const Event& event : window->events) {
      guess.x = std::max(guess.x, event.x);
      guess.y = std::max(guess.y, event.y);
    }
  }
  if (!any) return std::nullopt;
  const auto known = std::ranges::find_if(
      kSensors, [&](ImageSize size) { return guess.x < size.width && guess.y < size.height; });
  guess.size = known == kSensors.end() ? ImageSize{guess.y + 1, guess.x + 1} : *known;
  return guess;
}

/// Opens the source; one that only lacks the size of its sensor with the largest one, so that it
/// can be looked at.
std::unique_ptr<Dataset> open_source(SourceSpec spec, const fs::path& folder,
                                     SourceDraft& draft) try {
  return open_dataset(spec, folder);
} catch (const InputError&) {
  if (!has_events(spec.dataset) || spec.recording.sensor) throw;
  constexpr int kLargest = 8192;
  spec.recording.sensor = ImageSize{kLargest, kLargest};
  try {
    auto dataset = open_dataset(spec, folder);
    draft.needs_sensor = true;
    draft.guess = guess_sensor(*dataset);
    draft.findings.emplace_back("no size of the sensor in the files: set \"sensor\"");
    if (const auto& guess = draft.guess) {
      draft.findings.back() +=
          fmt::format(" (the events reach x = {}, y = {}, as those of a camera of {})", guess->x,
                      guess->y, to_string(guess->size));
    }
    return dataset;
  } catch (const InputError&) {  // it lacks something else
  }
  throw;
}

/// Whether each of the recordings is a window by itself, as tables with YOLO's texts are.
bool each_is_a_window(SourceSpec spec, const fs::path& folder, const Dataset& recordings,
                      SourceDraft draft) try {
  const auto is_text = [](const std::string& file) { return file.ends_with(".txt"); };
  if (std::ranges::none_of(recordings.annotation_files(), is_text)) return false;
  spec.window.duration_s.reset();
  open_source(std::move(spec), folder, draft);
  return true;
} catch (const InputError&) {  // one is not
  return false;
}

/// Whether each recording has frames: then an interval between two of them is a window.
bool all_have_frames(const Dataset& recordings) {
  std::map<std::string_view, bool> has_frames;
  for (const LabelledFrame& sample : recordings.labelled_frames()) {
    has_frames[sample.sequence] |= sample.frame.index >= 0;
  }
  return std::ranges::all_of(has_frames, [](const auto& recording) { return recording.second; });
}

/// Writes manifests.
class Draft {
 public:
  Draft(const DraftPlace& place, std::string name) : place_(place), name_(std::move(name)) {}

  std::string text(const std::vector<SourceDraft>& sources) const {
    const bool is_events = has_events(sources.front().found.dataset);
    std::vector<std::string> written;
    for (const SourceDraft& source : sources) written.push_back(source_text(source));
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

 private:
  /// Photographs whose objects move on their own.
  static bool is_in_layers(const SourceDraft& source) {
    return source.is_stills && source.found.labels;
  }

  static std::string generator_text(const std::vector<SourceDraft>& sources) {
    const bool has_int8 = onednn_support(Precision::kInt8).able;
    if (std::ranges::all_of(sources, is_in_layers)) {
      return fmt::format(
          R"(  // The motion of photographs is drawn, so a simulator can follow it: detectors of persons learn more
  // from its events than from the network's, which take less time (manifests/guides/choose.md):
  // "generator": {{ "weights": "shipped:8", "precision": "{}" }},
  "generator": {{ "kind": "esim" }},
)",
          has_int8 ? "int8" : "auto");
    }
    return fmt::format(
        R"(  // Detectors and pose networks learn as much from the narrow weights{} as from the wide ones in
  // float32, "shipped:16", which take four times as long (manifests/guides/choose.md).
  // Weights of your own: {{ "weights": "my.safetensors" }}.
  "generator": {{ "weights": "shipped:8", "precision": "{}" }},
  // Weights that know their sensor make the events of a camera, of one that ships or of your own, which
  // `eventgan fit --weights` finds in its recordings (manifests/guides/sensor.md):
  // "generator": {{ "weights": "shipped:sensor", "sensor": "davis346" }},
)",
        has_int8 ? " in 8 bits" : "", has_int8 ? "int8" : "auto");
  }
  static constexpr std::string_view kEvents =
      R"(  // Volumes are made of the camera's own events.
  "generator": { "kind": "events" },
  // To go with generated volumes, in both jobs:
  // "volume": { "normalize": "eta98" },
)";

  std::string source_text(const SourceDraft& source) const {
    std::string text;
    for (const std::string& line : source.findings) {
      text += "    // " + escape_controls(line) + "\n";
    }
    text += fmt::format("    {{\n      \"dataset\": \"{}\",\n", to_string(source.found.dataset));
    text += source_keys(source.found);
    text += has_events(source.found.dataset) ? window_text(source)
            : source.is_stills               ? stills_text(source)
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
    if (found.labels) {
      keys += fmt::format("      \"labels\": {{ \"format\": \"{}\", \"path\": {} }},\n",
                          to_string(found.labels->format), written(found.labels->path));
      if (found.labels->outlines) keys += key("outlines", *found.labels->outlines);
    }
    if (found.sensor) {
      keys += fmt::format("      \"sensor\": {{ \"width\": {}, \"height\": {} }},\n",
                          found.sensor->width, found.sensor->height);
    }
    if (found.columns != EventFields()) {
      keys += fmt::format("      \"columns\": {{ \"t\": {} }},\n", quoted(found.columns.t));
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

  static std::string stills_text(const SourceDraft& source) {
    const StillsSpec spec;
    const ObjectMotionSpec object;
    const std::string image = fmt::format(
        R"("translation_px": [{}, {}], "rotation_deg": {}, "scale": {}, "frames": {})",
        spec.translation_px[0], spec.translation_px[1], spec.rotation_deg, spec.scale, spec.frames);
    if (!source.found.labels && source.found.dataset != DatasetKind::kKittiObject) {
      return fmt::format(
          R"(      // The motion of each image is drawn: what moves is everything, as before a moving camera.
      "pairs": {{
        "from": "stills",
        "motion": {{ {} }}
      }}
)",
          image);
    }
    const bool drives = source.found.dataset == DatasetKind::kKittiObject;
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
        drives ? ", and none rests, since the camera drives."
               : ", and half of them rest; for a camera that moves set \"rests\" to 0.",
        image, drives ? "0" : "0.5", object.translation_px[0], object.translation_px[1],
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
    const bool is_mixed = std::ranges::any_of(sources, [&](const SourceDraft& source) {
      return (source.is_stills && source.has_sizes) || source.habits.size != first.habits.size;
    });
    const bool has_presets = std::ranges::any_of(
        sources, [&](const SourceDraft& source) { return source.preset != first.preset; });
    std::vector<std::string> keys;
    std::string_view comment = first.habits.size_comment;
    if (is_mixed) {
      comment =
          "Images come in many shapes; a DAVIS346 camera's size, with borders, keeps each one's.";
      keys.emplace_back(kDavisSize);
    } else if (!first.habits.size.empty()) {
      keys.emplace_back(first.habits.size);
    }
    if (std::ranges::all_of(sources, &SourceDraft::has_range)) {  // else it would cut others
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

  DraftPlace place_;
  std::string name_;
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
      if (sources[before].root != now.root &&
          !fs::equivalent(sources[before].root, now.root, unknown))
        continue;
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

ManifestDraft draft_manifest(const std::vector<FoundSource>& sources, const DraftPlace& place) {
  require_one_job(sources);
  const Draft draft(place, draft_name(sources));
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
    const SourceSpec& spec = alone.sources.front();
    source.preset = alone.image.preset;
    const auto dataset = open_source(spec, place.folder, source);
    const Survey counted = survey(*dataset, spec);
    if (has_events(found.dataset)) {
      source.has_frames = all_have_frames(*dataset);
      source.are_windows =
          !source.has_frames && each_is_a_window(spec, place.folder, *dataset, source);
      source.has_samples = counted.labelled_frames > 0 && !source.needs_sensor;
    } else {
      source.gaps = gaps_to_take(counted, source.gaps);
      source.range = narrow_value_range(dataset->labelled_frames(), place.folder);
      if (source.range) {
        source.findings.push_back(
            fmt::format("images of 16 bits use less than a quarter of their values: those from {} "
                        "to {} are spread (\"range\")",
                        source.range->low, source.range->high));
      }
      source.has_samples =
          std::ranges::any_of(counted.pairs_by_gap, [](const auto& gap) { return gap.second > 0; });
      consider_stills(*dataset, place.folder, source);
      if (!source.is_stills) note_unknown_times(*dataset, source);
    }
    source.findings = findings_of(source, counted);
    if (sources.size() > 1) source.findings.insert(source.findings.begin(), found.root.string());
    made.has_samples &= source.has_samples;
    std::ranges::copy(source.findings, std::back_inserter(made.findings));
    std::ranges::move(dataset->notes(), std::back_inserter(made.notes));
    drafts.push_back(std::move(source));
  }
  made.text = draft.text(drafts);
  parse_job_manifest(made.text, place.folder, "the manifest for " + sources.front().root.string());
  return made;
}

}  // namespace eventgan
