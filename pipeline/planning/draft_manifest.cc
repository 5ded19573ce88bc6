#include "pipeline/planning/draft_manifest.h"

#include <fmt/core.h>
#include <fmt/format.h>
#include <utf8.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>
#include <string_view>

#include "manifests/documents/job_manifest.h"
#include "manifests/documents/json_text_internal.h"
#include "manifests/values/faults.h"
#include "manifests/values/job.h"
#include "pipeline/planning/make_plan.h"
#include "stages/frames/dataset.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// What manifests/examples say for a dataset, and why.
struct Habits {
  std::string_view name;
  PairSide side;
  std::vector<int> gaps;  ///< those of them that have partners
  std::string_view size_comment;
  std::string_view size;
};

Habits habits_of(DatasetKind dataset) {
  constexpr std::string_view kKittiComment =
      "The size that the generator's authors trained with; boxes follow the pictures into it.";
  constexpr std::string_view kKittiSize = R"( "width": 861, "height": 260, "fit": "stretch" )";
  constexpr std::string_view kMpiiComment =
      "Pictures are of many shapes; letterboxed, each keeps its own, with borders.";
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
          "The size of a DAVIS346 camera; letterboxed, pictures keep their shape, with borders.",
          R"( "width": 346, "height": 260, "fit": "letterbox" )"};
    case DatasetKind::kFrames:
      return {"frames-events",
              PairSide::kBefore,
              {1},
              "No width and height: volumes are as large as the pictures.",
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

/// What is counted before the manifest is written.
struct Survey {
  std::size_t labelled_frames = 0;
  std::size_t sequences = 0;
  std::size_t annotation_files = 0;
  std::map<int, std::int64_t> pairs_by_gap;  ///< every gap that `side` allows
  std::int64_t holes = 0;                    ///< pairs at fault, as far as names tell
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
      ++(sample.fault.empty() ? counted.pairs_by_gap[sample.pair.gap_frames] : counted.holes);
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
      return "before it";
    case PairSide::kAfter:
      return "after it";
    case PairSide::kAround:
      return "around it";
  }
  throw std::logic_error("where_text: not a side");
}

std::vector<std::string> findings_of(const FoundSource& found, const Survey& survey,
                                     PairSide side) {
  std::vector<std::string> lines;
  lines.push_back(fmt::format("{}: {} labelled frames", found.title, survey.labelled_frames));
  if (survey.sequences > 0) lines.back() += fmt::format(" of {} sequences", survey.sequences);
  lines.back() += fmt::format(", {} annotation files", survey.annotation_files);
  std::string gaps;
  for (const auto& [gap, count] : survey.pairs_by_gap) {
    gaps += fmt::format("{}gap {}: {}", gaps.empty() ? "" : ", ", gap, count);
  }
  lines.push_back(
      fmt::format("labelled frames with a pair of frames {}, by gap: {}", where_text(side), gaps));
  if (survey.holes > 0) {
    lines.push_back(fmt::format("pairs of which a frame is missing or at fault: {}", survey.holes));
  }
  lines.insert(lines.end(), found.remarks.begin(), found.remarks.end());
  return lines;
}

class Draft {
 public:
  Draft(const FoundSource& found, const fs::path& folder, bool relative)
      : found_(found), habits_(habits_of(found.dataset)), folder_(folder), relative_(relative) {}

  std::string text(const std::vector<std::string>& findings, const std::vector<int>& gaps) const {
    std::string text;
    for (const std::string& line : findings) text += "// " + line + "\n";
    text += fmt::format(R"({{
  "format": "eventgan-manifest",
  "version": 1,
  "name": "{}",  // shards are named {}-SPLIT-NUMBER-of-COUNT.h5
  "seed": 7,  // decides which gap each labelled frame gets

  "sources": [
    {{
      "dataset": "{}",
{}      // One pair for a labelled frame, its gap drawn from these; "choose": "all" makes one for each.
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
                        habits_.name, habits_.name, to_string(found_.dataset), source_keys(),
                        fmt::join(gaps, ", "), to_string(habits_.side), habits_.size_comment,
                        habits_.size, habits_.name);
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
  made.notes = dataset->notes();
  made.has_pairs =
      std::ranges::any_of(counted.pairs_by_gap, [](const auto& gap) { return gap.second > 0; });
  made.text = draft.text(made.findings, gaps_to_take(counted, habits));
  read(made.text);
  return made;
}

}  // namespace eventgan
