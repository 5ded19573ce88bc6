#include "pipeline/planning/draft_manifest.h"

#include <fmt/core.h>
#include <fmt/format.h>
#include <utf8.h>

#include <algorithm>
#include <array>
#include <map>
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
#include "pipeline/planning/spread.h"
#include "stages/frames/dataset.h"
#include "stages/frames/decoding/frame_decoder.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// What manifests/examples say for a dataset, and why.
struct Habits {
  std::string_view name;  ///< where the folder's own does not serve
  PairSide side;
  std::vector<int> gaps;  ///< those of them that have paired frames
  std::string_view size_comment;
  std::string_view size;
};

Habits habits_of(DatasetKind dataset) {
  constexpr std::string_view kKittiComment =
      "The size that the generator's authors trained with; boxes are scaled with the images.";
  constexpr std::string_view kKittiSize = R"( "width": 861, "height": 260, "fit": "stretch" )";
  constexpr std::string_view kMpiiComment =
      "Images come in many shapes; letterboxing keeps each one's shape and adds borders.";
  constexpr std::string_view kMpiiSize = R"( "width": 640, "height": 480, "fit": "letterbox" )";
  switch (dataset) {
    case DatasetKind::kKittiObject:
      return {"kitti-events", PairSide::kBefore, {1, 2}, kKittiComment, kKittiSize};
    case DatasetKind::kKittiTracking:
      return {"kitti-tracking-events", PairSide::kBefore, {1, 2}, kKittiComment, kKittiSize};
    case DatasetKind::kKittiRaw:
      return {"kitti-raw-events", PairSide::kBefore, {1, 2}, kKittiComment, kKittiSize};
    case DatasetKind::kMpii:
      return {"mpii-events", PairSide::kAround, {2, 4}, kMpiiComment, kMpiiSize};
    case DatasetKind::kMpiiList:
      return {"mpii-list-events", PairSide::kAround, {2, 4}, kMpiiComment, kMpiiSize};
    case DatasetKind::kHuman36m:
      return {
          "h36m-events",
          PairSide::kAfter,
          {1, 2},
          "The size of a DAVIS346 camera; letterboxing keeps the images' shape and adds borders.",
          R"( "width": 346, "height": 260, "fit": "letterbox" )"};
    case DatasetKind::kFrames:
      return {"frames-events",
              PairSide::kBefore,
              {1},
              "No width and height: volumes are as large as the images.",
              ""};
    case DatasetKind::kRecording:
    case DatasetKind::kDhp19:
      break;  // find_source knows neither
  }
  throw std::logic_error("habits_of: not a kind of dataset");
}

std::string quoted(const std::string& text) {
  if (!utf8::is_valid(text)) {
    throw UsageError("expected a path in UTF-8, as manifests are, got another, in " + text);
  }
  return dump_json(nlohmann::json(text));
}

/// A name for the job, which is part of its files' names and its folder: that of the folder or
/// video that was shown, so that two of them do not come into each other's way.
std::string name_of(const FoundSource& found, const Habits& habits) {
  constexpr std::size_t kLongest = 50;
  constexpr std::string_view kAllowed =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-";
  const auto is_common = [](const fs::path& folder) {  // each dataset of its kind has it
    return std::ranges::any_of(
        std::array{"training", "testing", "image_2", "image_02", "images", "frames", "data"},
        [&](const char* name) { return folder.filename() == name; });
  };
  fs::path path = found.root;
  while (is_common(path)) path = path.parent_path();
  std::string name;
  const fs::path shown = fs::is_directory(found.root) ? path.filename() : path.stem();
  for (const char c : shown.string()) {
    const bool is_allowed = kAllowed.find(c) != kAllowed.npos;
    if (is_allowed || !name.ends_with('_')) name += is_allowed ? c : '_';
  }
  name.erase(0, name.find_first_not_of("._-"));
  return name.empty() ? std::string(habits.name) : name.substr(0, kLongest) + "-events";
}

/// What is counted before the manifest is written.
struct Survey {
  std::size_t labelled_frames = 0;
  std::size_t sequences = 0;
  std::size_t annotation_files = 0;
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
  counted.labelled_frames = dataset.labelled_frames().size();
  counted.sequences = sequences.size();
  counted.annotation_files = dataset.annotation_files().size();
  return counted;
}

std::vector<int> gaps_to_take(const Survey& survey, const Habits& habits) {
  std::vector<int> usual, any;
  for (const auto& [gap, count] : survey.pairs_by_gap) {
    if (count == 0) continue;
    any.push_back(gap);
    if (std::ranges::find(habits.gaps, gap) != habits.gaps.end()) usual.push_back(gap);
  }
  return !usual.empty() ? usual : !any.empty() ? any : habits.gaps;
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

std::vector<std::string> findings_of(const FoundSource& found, const Survey& survey,
                                     PairSide side) {
  std::vector<std::string> lines;
  lines.push_back(fmt::format("{}: {} labelled frames", found.title, survey.labelled_frames));
  if (survey.sequences > 0) lines.back() += fmt::format(" of {} sequences", survey.sequences);
  lines.back() += fmt::format(", {} annotation files", survey.annotation_files);
  lines.push_back(fmt::format("labelled frames with a pair of frames {}, by gap: {}",
                              where_text(side), counts_text(survey.pairs_by_gap, "gap ")));
  if (survey.missing > 0) {
    lines.push_back(fmt::format("pairs with a missing or invalid frame: {}", survey.missing));
  }
  lines.insert(lines.end(), found.remarks.begin(), found.remarks.end());
  return lines;
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

/// A line if images that are taken as one sequence have several sizes, as far as some tell.
void compare_sizes(const Dataset& dataset, const fs::path& folder,
                   std::vector<std::string>& warnings) {
  constexpr std::size_t kMost = 200;
  const auto& frames = dataset.labelled_frames();
  std::map<std::string_view, std::pair<ImageSize, std::string_view>> first;  // of a sequence
  for (const std::size_t i : spread(kMost, frames.size())) {
    const std::string& path = frames[i].frame.path;
    const Outcome<ImageSize> probed = probe_image_size(folder / path);
    if (is_fault(probed)) continue;
    const auto size = std::get<ImageSize>(probed);
    const auto [known, is_new] = first.try_emplace(frames[i].sequence, size, path);
    if (is_new || known->second.first == size) continue;
    warnings.push_back(fmt::format(
        "warning: images of several sizes in one folder, {} in {} and {} in {}: is it a "
        "sequence? Two frames of different sizes make no pair",
        to_string(known->second.first), known->second.second, to_string(size), path));
    return;
  }
}

/// A line if images that are taken as neighbours have nothing to do with each other, as far as some
/// tell.
void compare_neighbours(const Dataset& dataset, const fs::path& folder,
                        std::vector<std::string>& warnings) {
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
      const auto a = decoder.decode(frame), b = decoder.decode(next.frame);
      if (is_fault(a) || is_fault(b)) continue;
      const auto alike = likeness(std::get<ColourFrame>(a), std::get<ColourFrame>(b));
      if (!alike) continue;
      ++pairs;
      if (*alike >= kUnrelated) continue;
      if (unrelated++ == 0) example = frame.path + " and " + next.frame.path;
    }
  }
  if (2 * unrelated <= pairs) return;
  warnings.push_back(
      fmt::format("warning: {} of {} compared pairs of neighbouring images do not show the same "
                  "scene, first {}: is it a sequence? Events between unrelated images mean nothing",
                  unrelated, pairs, example));
}

class Draft {
 public:
  Draft(const FoundSource& found, const fs::path& folder, bool relative)
      : found_(found),
        habits_(habits_of(found.dataset)),
        name_(name_of(found, habits_)),
        folder_(folder),
        relative_(relative) {}

  std::string text(const std::vector<std::string>& findings, const std::vector<int>& gaps) const {
    std::string text;
    for (const std::string& line : findings) text += "// " + escape_controls(line) + "\n";
    text +=
        fmt::format(R"({{
  "format": "eventgan-manifest",
  "version": 1,
  "name": "{}",  // shards are named {}-SPLIT-NUMBER-of-COUNT.h5
  "seed": 7,  // decides which gap each labelled frame gets

  "sources": [
    {{
      "dataset": "{}",
{}      // One pair per labelled frame, its gap drawn from these; "choose": "all" makes one per gap.
      "pairs": {{ "gaps": [{}], "side": "{}", "choose": "one" }}
    }}
  ],

  // {}
  "image": {{{}}},
  // Volumes are made by the generator that comes with the program, unless another is named:
  // "generator": {{ "weights": "my.safetensors" }},
  "output": {{ "directory": "out/{}" }}
}}
)",
                    name_, name_, to_string(found_.dataset), source_keys(), fmt::join(gaps, ", "),
                    to_string(habits_.side), habits_.size_comment, habits_.size, name_);
    return text;
  }

  const Habits& habits() const { return habits_; }

 private:
  std::string source_keys() const {
    std::string keys = key("root", found_.root);
    if (!found_.layout.empty()) {
      keys += fmt::format("      \"layout\": \"{}\",\n", found_.layout);
    }
    if (found_.layout == "official") {
      keys += "      \"every\": 5,  // of 50 frames a second: a gap of 1 is a tenth of a second\n";
    }
    if (found_.raw_root) keys += key("raw_root", *found_.raw_root);
    if (found_.devkit) keys += key("devkit", *found_.devkit);
    if (found_.annotations) keys += key("annotations", *found_.annotations);
    if (found_.sequences) keys += key("sequences", *found_.sequences);
    return keys;
  }

  std::string key(std::string_view name, const fs::path& path) const {
    const fs::path written = relative_ ? path.lexically_proximate(folder_) : path;
    return fmt::format("      \"{}\": {},\n", name, quoted(written.generic_string()));
  }

  const FoundSource& found_;
  Habits habits_;
  std::string name_;
  fs::path folder_;
  bool relative_;
};

}  // namespace

ManifestDraft draft_manifest(const FoundSource& found, const fs::path& folder, bool relative) {
  const Draft draft(found, folder, relative);
  const Habits& habits = draft.habits();
  const auto read = [&](const std::string& text) {
    return parse_job_manifest(text, folder, "the manifest for " + found.root.string());
  };
  const JobManifest first = read(draft.text({}, habits.gaps));
  const auto dataset = open_dataset(first.sources.front(), folder);
  const Survey counted = survey(*dataset, first.sources.front());

  ManifestDraft made;
  made.findings = findings_of(found, counted, habits.side);
  const auto& frames = dataset->labelled_frames();
  const bool is_video = !frames.empty() && frames.front().frame.video_frame >= 0;
  if (found.dataset == DatasetKind::kFrames && !is_video) {
    compare_sizes(*dataset, folder, made.findings);
    compare_neighbours(*dataset, folder, made.findings);
  }
  made.notes = dataset->notes();
  made.has_pairs =
      std::ranges::any_of(counted.pairs_by_gap, [](const auto& gap) { return gap.second > 0; });
  made.text = draft.text(made.findings, gaps_to_take(counted, habits));
  read(made.text);
  return made;
}

}  // namespace eventgan
