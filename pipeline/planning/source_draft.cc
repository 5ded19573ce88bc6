#include "pipeline/planning/source_draft.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <set>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "manifests/values/faults.h"
#include "manifests/values/text.h"
#include "pipeline/planning/make_plan.h"
#include "pipeline/planning/spread.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/decoding/frame_decoder.h"
#include "stages/frames/decoding/pair_reader.h"
#include "stages/frames/sources/class_numbers.h"
#include "stages/frames/sources/dataset_kinds.h"
#include "stages/frames/sources/open_dataset.h"
#include "stages/generator/onednn/onednn_generator.h"
#include "stages/generator/shipped_weights.h"
#include "stages/generator/wanted_tiles.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

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

/// Looks at the sizes of some images: the middle one, and a line if a sequence has several.
void compare_sizes(const Dataset& dataset, const fs::path& folder, SourceDraft& draft) {
  constexpr std::size_t kMost = 200;
  const auto& frames = dataset.labelled_frames();
  std::map<std::string_view, std::pair<ImageSize, std::string_view>> first;  // of a sequence
  std::vector<ImageSize> sizes;
  for (const std::size_t i : spread(kMost, frames.size())) {
    const std::string& path = frames[i].frame.path;
    const Outcome<ImageSize> probed = probe_image_size(folder / path, ImageOrientation::kUpright);
    if (is_fault(probed)) continue;
    const auto size = *probed;
    sizes.push_back(size);
    const auto known = first.try_emplace(frames[i].sequence, size, path).first;
    draft.has_sizes |= first.begin()->second.first != size;
    if (draft.is_stills || known->second.first == size) continue;
    draft.is_stills = true;
    draft.findings.push_back(
        fmt::format("images of several sizes in one folder, {} in {} and {} in {}",
                    to_string(known->second.first), known->second.second, to_string(size), path));
  }
  if (sizes.empty()) return;
  const auto middle = sizes.begin() + std::ssize(sizes) / 2;
  std::ranges::nth_element(sizes, middle, {}, &ImageSize::pixel_count);
  draft.usual_size = *middle;
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

/// Looks at what moves in some pairs; those of videos are near the start, since nothing else is
/// there without all before it.
void look_at_motion(const Dataset& dataset, SourceSpec spec, ImageSpec image,
                    const fs::path& folder, SourceDraft& draft) {
  constexpr std::size_t kPairs = 20, kTurns = 4;
  constexpr std::int64_t kVideoFrames = 100;
  spec.pairs.gaps = draft.gaps;
  image.range = draft.range;
  const ScopeSpec scope{.scope = Scope::kMotion};
  const PairReader reader(folder, image, 1);
  std::vector<const LabelledFrame*> frames;
  for (const LabelledFrame& frame : dataset.labelled_frames()) {
    if (frame.frame.video_frame < kVideoFrames) frames.push_back(&frame);
  }
  SeenMotion seen;
  double moving = 0, work = 0;
  const Precision precision = int8_pays(kNarrowWeights) ? Precision::kInt8 : Precision::kFloat32;
  const std::vector<std::size_t> places = spread(kPairs * kTurns, frames.size());
  for (std::size_t turn = 0; turn < kTurns; ++turn) {
    for (std::size_t i = turn; i < places.size() && seen.pairs < int{kPairs}; i += kTurns) {
      for (const PlannedSample& sample :
           choose_pairs(dataset, *frames[places[i]], spec, 0).samples) {
        if (!sample.fault.empty()) continue;
        const auto pair = reader.read(sample.pair, orientation_of(spec.dataset));
        if (is_fault(pair)) continue;
        const TileMask tiles =
            wanted_tiles(scope, pair->input, pair->content, pair->content_y, pair->content_x, {});
        const double share = static_cast<double>(std::ranges::count(tiles.wanted, 1)) /
                             static_cast<double>(tiles.wanted.size());
        moving += share;
        work += tiles_work(tiles, kNarrowWeights, precision);
        ++seen.pairs;
        seen.resting += share <= 0.5 ? 1 : 0;
      }
    }
  }
  if (seen.pairs == 0) return;
  seen.tiles = moving / seen.pairs;
  seen.work = work / seen.pairs;
  draft.motion = seen;
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

}  // namespace

SourceDraft::SourceDraft(const FoundSource& source)
    : found(source), habits(dataset_reader(source.dataset).habits) {
  std::ranges::copy_if(habits.gaps, std::back_inserter(gaps), [](int gap) { return gap > 0; });
}

void look_at_source(const SourceSpec& spec, const ImageSpec& image, const fs::path& folder,
                    SourceDraft& draft) {
  std::vector<std::unique_ptr<Dataset>> datasets;
  datasets.push_back(open_source(spec, folder, draft));
  number_classes({spec}, datasets);
  const auto& dataset = datasets.front();
  const Survey counted = survey(*dataset, spec);
  draft.labelled_frames = counted.labelled_frames;
  if (has_events(spec.dataset)) {
    draft.has_frames = all_have_frames(*dataset);
    draft.are_windows = !draft.has_frames && each_is_a_window(spec, folder, *dataset, draft);
    draft.has_samples = counted.labelled_frames > 0 && !draft.needs_sensor;
  } else {
    draft.gaps = gaps_to_take(counted, draft.gaps);
    draft.range = narrow_value_range(dataset->labelled_frames(), folder);
    if (draft.range) {
      draft.findings.push_back(
          fmt::format("images of 16 bits use less than a quarter of their values: those from {} "
                      "to {} are spread (\"range\")",
                      draft.range->low, draft.range->high));
    }
    draft.has_samples =
        std::ranges::any_of(counted.pairs_by_gap, [](const auto& gap) { return gap.second > 0; });
    consider_stills(*dataset, folder, draft);
    if (!draft.is_stills) {
      note_unknown_times(*dataset, draft);
      look_at_motion(*dataset, spec, image, folder, draft);
    }
  }
  draft.findings = findings_of(draft, counted);
  draft.notes = dataset->notes();
}

bool int8_pays(int base_width) {
  constexpr double kLeastSpeedup = 1.3;
  return int8_speedup(read_shipped_weights(base_width)) >= kLeastSpeedup;
}

}  // namespace eventgan
