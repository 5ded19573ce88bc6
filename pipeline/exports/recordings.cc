#include "pipeline/exports/detail/recordings.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <utility>

#include "manifests/documents/json_text.h"
#include "manifests/files/sha256.h"
#include "manifests/values/faults.h"
#include "manifests/values/job.h"
#include "manifests/values/recently_used.h"
#include "manifests/values/text.h"
#include "pipeline/runtime/threads.h"
#include "stages/base/archives/numpy_arrays.h"

namespace eventgan {
namespace {

constexpr double kMicroseconds = 1e6;                                            // in a second
constexpr std::int64_t kLongest_us = std::numeric_limits<std::uint32_t>::max();  // DSEC's times
constexpr double kLast = 1e12;  ///< of a clock, seconds or frames

/// A sample before it has found its recording.
struct LaidSample {
  SampleWindow window;
  VolumeShape shape;
  double label_position = 1;
  bool is_timed = false;  ///< by its frames' times, not their numbers
  /// The pair's begin and end: seconds, or the frames' numbers.
  std::array<double, 2> between{};
  double frame = 1;  ///< from one frame to the next, in these numbers
};

/// The sequence that the sample is of; none if it is of none. Stills in one folder are of none
/// either, and are laid out as one that has the dataset's name.
std::optional<std::string> sequence_of(const OutgoingSample& sample) {
  if (!sample.labels.sequence.empty()) return sample.labels.sequence;
  const DatasetRow* const dataset = find_dataset(sample.source.dataset);
  if (dataset != nullptr && dataset->is_own) return sample.source.dataset;
  return std::nullopt;
}

/// The sample on its sequence's clock: by the times of its frames, or else by their numbers. None
/// if neither tells when it is.
std::optional<LaidSample> on_clock(const OutgoingSample& sample) {
  const FramePair& pair = sample.labels.pair;
  if (!sequence_of(sample)) return std::nullopt;
  LaidSample laid{.window = {.shard = &sample.shard, .slot = sample.slot},
                  .shape = sample.reader.header().volume,
                  .label_position = pair.label_position,
                  .is_timed = std::isfinite(pair.gap_s())};
  laid.between = laid.is_timed ? std::array{pair.previous.time_s, pair.next.time_s}
                               : std::array{static_cast<double>(pair.previous.index),
                                            static_cast<double>(pair.next.index)};
  if (!(laid.between[0] >= 0 && laid.between[1] <= kLast && laid.between[0] < laid.between[1])) {
    return std::nullopt;
  }
  laid.frame = (laid.between[1] - laid.between[0]) / std::max(pair.gap_frames, 1);
  return laid;
}

void set_label_time(SampleWindow& window, double label_position) {
  const auto length_us = static_cast<double>(window.end_us - window.begin_us);
  window.label_us = window.begin_us + std::llround(label_position * length_us);
}

/// Gives the samples of a sequence their windows.
void set_windows(std::vector<LaidSample>& samples, double frames_per_second) {
  double frame = std::numeric_limits<double>::infinity();
  for (const LaidSample& sample : samples) {
    if (!sample.is_timed) frame = std::min(frame, sample.frame);
  }
  for (LaidSample& sample : samples) {
    const double seconds = sample.is_timed ? 1 : 1 / (frame * frames_per_second);
    if (!(sample.between[1] * seconds <= kLast)) {
      throw UsageError(fmt::format(
          "expected a sequence that ends before {:g} s, got frame {:.0f} at {:g} a second, in {} "
          "(--frames-per-second)",
          kLast, sample.between[1], frames_per_second, sample.window.shard->outline.name));
    }
    const auto at_us = [&](double place) -> std::int64_t {
      return std::llround(place * seconds * kMicroseconds);
    };
    sample.window.begin_us = at_us(sample.between[0]);
    sample.window.end_us = std::clamp(at_us(sample.between[1]), sample.window.begin_us + 1,
                                      sample.window.begin_us + kLongest_us);
    set_label_time(sample.window, sample.label_position);
  }
}

/// The window of a sample by itself.
SampleWindow window_alone(const OutgoingSample& sample) {
  const double gap_us = std::round(known_gap_s(sample.labels.pair) * kMicroseconds);
  const double length_us = std::clamp(gap_us, 1.0, static_cast<double>(kLongest_us));
  return {.shard = &sample.shard,
          .slot = sample.slot,
          .begin_us = 0,
          .end_us = static_cast<std::int64_t>(length_us)};
}

/// The samples of one sequence as recordings, each in the one that ends last before it.
std::vector<OutgoingRecording> spread(std::vector<LaidSample> samples, const std::string& name,
                                      const ExportSource& source) {
  std::ranges::stable_sort(samples, {}, [](const LaidSample& sample) {
    return std::pair(sample.window.begin_us, sample.window.end_us);
  });
  std::vector<OutgoingRecording> recordings;
  for (const LaidSample& sample : samples) {
    const SampleWindow& window = sample.window;
    OutgoingRecording* best = nullptr;
    for (OutgoingRecording& recording : recordings) {
      const bool fits = recording.shape == sample.shape && recording.is_timed == sample.is_timed &&
                        recording.end_us() <= window.begin_us &&
                        recording.windows.back().label_us < window.label_us &&
                        window.end_us - recording.begin_us() <= kLongest_us;
      if (fits && (best == nullptr || recording.end_us() > best->end_us())) best = &recording;
    }
    if (best == nullptr) {
      const std::string number =
          recordings.empty() ? "" : fmt::format("~{}", recordings.size() + 1);
      best = &recordings.emplace_back(
          OutgoingRecording{name + number, &source, sample.shape, sample.is_timed, {}});
    }
    best->windows.push_back(window);
  }
  return recordings;
}

/// Hash of everything that the recordings are made from.
std::string hash_of(const RecordingGroup& group) {
  Sha256 hash;
  for (const OutgoingRecording& recording : group.recordings) {
    hash.update(recording.name + "\n");
    for (const SampleWindow& window : recording.windows) {
      hash.update(fmt::format("{} {} {} {} {} {}\n", window.shard->sha256, window.slot,
                              window.begin_us, window.end_us, window.label_us, window.is_labelled));
    }
  }
  return hash.hex();
}

/// The readers of the shards that were opened last. Thread safe.
class LastReaders {
 public:
  explicit LastReaders(const ExportInput& input) : input_(input) {}

  std::shared_ptr<const ShardReader> of(const ExportShard& shard) {
    return readers_.get(&shard,
                        [&] { return std::make_shared<const ShardReader>(input_.open(shard)); });
  }

 private:
  const ExportInput& input_;
  RecentlyUsed<const ExportShard*, std::shared_ptr<const ShardReader>> readers_{8};
};

}  // namespace

RecordingsExporter::RecordingsExporter(const ExportInput& input, const ExportOptions& options)
    : options_(options), events_(input, options) {
  if (std::ranges::any_of(input.sources(), &ExportSource::has_boxes)) {
    numbers_ = std::make_unique<ClassNumbers>(input, options, 0);
  } else if (options.classes) {
    throw UsageError("--classes: expected a source with boxes, got none");
  }
}

std::string RecordingsExporter::settings() const {
  return fmt::format("classes {}\n{}frames_per_second {:g}\nseed {}\n",
                     numbers_ ? numbers_->text() : "none", events_.settings(),
                     options_.frames_per_second, options_.seed);
}

void RecordingsExporter::check(const ExportInput&, const std::function<void()>&) const {
  events_.open();
}

RecordedSample RecordingsExporter::recorded(const OutgoingSample& sample,
                                            const SampleWindow& window) const {
  RecordedSample result{sample.labels.sample_id, {}, {}, {}, {}, {}, {}};
  const std::int64_t length_us = window.end_us - window.begin_us;
  const double previous_s = sample.labels.pair.previous.time_s;
  const auto events = events_.of(sample, static_cast<double>(length_us) / kMicroseconds);
  result.events.reserve(events.size());
  for (const Event& event : events) {
    // A camera's at their own times; drawn ones at neither end of the window, since some readers
    // count the begin to it and others the end.
    const bool is_recorded = events_.are_recorded();
    const std::int64_t t_us = is_recorded ? std::llround((event.t_s + previous_s) * kMicroseconds) -
                                                std::llround(previous_s * kMicroseconds)
                                          : static_cast<std::int64_t>(event.t_s * kMicroseconds);
    const std::int64_t last_us = is_recorded ? length_us : length_us - 1;
    const std::int64_t first_us = is_recorded ? 0 : std::min<std::int64_t>(1, last_us);
    result.events.push_back({window.begin_us + std::clamp(t_us, first_us, last_us),
                             static_cast<std::uint16_t>(event.x),
                             static_cast<std::uint16_t>(event.y), event.positive});
  }
  if (sample.source.has_boxes()) {
    const auto take = [&](const ClassNumbers::Entry& entry, const VolumeBox& box) {
      const auto index = static_cast<std::size_t>(&box - sample.labels.labels.boxes.data());
      result.boxes.push_back({window.label_us, box.clipped, entry.number,
                              sample.labels.annotation.boxes.at(index).track_id});
    };
    for_each_box(sample, *numbers_, /*keep_ignored=*/false, take, [](const std::string&) {});
  }
  keep_more(sample, result);
  return result;
}

std::vector<RecordingGroup> RecordingsExporter::lay_recordings(
    const ExportWork& work, const std::vector<const ExportShard*>& shards) const {
  std::vector<RecordingGroup> groups;
  for (const std::string& split : work.input.splits()) {
    std::map<std::string, std::pair<const ExportSource*, std::vector<LaidSample>>> sequences;
    std::map<std::string, RecordingGroup> loose;
    work.walk(of_split(work.input, shards, split), [&](const OutgoingSample& sample) {
      if (auto laid = on_clock(sample)) {
        untimed_ += laid->is_timed ? 0 : 1;
        laid->window.is_labelled = is_labelled(sample);
        auto& [source, samples] =
            sequences[sample.source.name_prefix + export_name(*sequence_of(sample))];
        source = &sample.source;
        samples.push_back(*laid);
        return;
      }
      SampleWindow alone = window_alone(sample);
      set_label_time(alone, sample.labels.pair.label_position);
      alone.is_labelled = is_labelled(sample);
      loose[sample.shard.outline.name].recordings.push_back(
          {sample.name, &sample.source, sample.reader.header().volume, true, {alone}});
    });
    for (auto& [shard, group] : loose) {
      for (OutgoingRecording& recording : group.recordings) {
        // A sequence may be called as a sample of no known time.
        if (sequences.contains(recording.name)) recording.name += "~alone";
      }
      groups.push_back({shard, true, std::move(group.recordings)});
    }
    for (auto& [name, sequence] : sequences) {
      auto& [source, samples] = sequence;
      set_windows(samples, options_.frames_per_second);
      groups.push_back({split + "+" + name, false, spread(std::move(samples), name, *source)});
    }
  }
  return groups;
}

void RecordingsExporter::finish(const ExportWork& work,
                                const std::vector<const ExportShard*>& shards) const {
  LastReaders readers(work.input);
  left_out_.clear();
  untimed_ = 0;
  for (const RecordingGroup& group : lay_recordings(work, shards)) {
    ExportFolder::Step step(work.folder, group.step, hash_of(group));
    if (!step.is_done()) {
      // Samples alone are made side by side, those of one recording within it.
      const auto write = [&](const OutgoingRecording& recording) {
        const auto for_each = [&](const auto& take) {
          constexpr std::size_t kAtOnce = 16;
          const std::vector<SampleWindow>& windows = recording.windows;
          for (std::size_t first = 0; first < windows.size(); first += kAtOnce) {
            std::vector<RecordedSample> made(std::min(kAtOnce, windows.size() - first));
            for_each_index(made.size(), work.threads, [&](std::size_t i) {
              const SampleWindow& window = windows[first + i];
              const auto reader = readers.of(*window.shard);
              work.with_sample(
                  *window.shard, *reader, window.slot,
                  [&](const OutgoingSample& sample) { made[i] = recorded(sample, window); });
            });
            for (std::size_t i = 0; i < made.size(); ++i) take(windows[first + i], made[i]);
          }
        };
        write_recording(recording, for_each, step);
      };
      for_each_index(group.recordings.size(), group.is_loose ? work.threads : 1,
                     [&](std::size_t i) { write(group.recordings[i]); });
      step.finish();
    }
    for (const OutgoingRecording& recording : group.recordings) {
      account_recording(recording, left_out_);
      work.advance(std::ssize(recording.windows));
    }
  }
  const bool has_classes =
      std::ranges::find(options_.to->options, "--classes") != options_.to->options.end();
  if (has_classes && numbers_ && !numbers_->names().empty()) write_classes(work, shards);
}

void RecordingsExporter::write_classes(const ExportWork& work,
                                       const std::vector<const ExportShard*>& shards) const {
  ExportFolder::Step step(work.folder, "label_map", input_hash(shards));
  if (step.is_done()) return;
  nlohmann::ordered_json classes = nlohmann::ordered_json::object();
  for (const auto& [number, name] : numbers_->names()) classes[std::to_string(number)] = name;
  step.write("label_map_dictionary.json", dump_json(classes) + "\n");
  step.finish();
}

void RecordingsExporter::account(const OutgoingSample& sample, LeftOut& left_out) const {
  if (!sample.source.has_boxes()) return;
  for_each_box(
      sample, *numbers_, /*keep_ignored=*/false, [](const auto&, const auto&) {},
      [&](const std::string& why) { ++left_out[why]; });
}

void RecordingsExporter::account_recording(const OutgoingRecording& recording,
                                           LeftOut& left_out) const {
  if (recording.is_labelled()) return;
  left_out["samples of recordings without boxes (in raw alone)"] += std::ssize(recording.windows);
}

LeftOut RecordingsExporter::whole_samples_left_out() const { return left_out_; }

std::vector<std::string> RecordingsExporter::notes() const {
  if (untimed_ == 0) return {};
  return {
      fmt::format("{} are of images without times: their clock counts {:g} {} a second "
                  "(--frames-per-second)",
                  count_text(untimed_, "sample"), options_.frames_per_second,
                  options_.frames_per_second == 1 ? "frame" : "frames")};
}

void require_sides(const ExportInput& input, const std::function<void()>& check_stop, int most,
                   std::string_view word) {
  for (const ExportShard& shard : input.shards()) {
    check_stop();
    const ImageSize size = input.open(shard).header().volume.size;
    if (std::max(size.width, size.height) <= most) continue;
    throw UsageError(fmt::format(
        "expected volumes of at most {} pixels a side for --to {}, got {} (--to dsec has them)",
        most, word, to_string(size)));
  }
}

void number_tracks(std::vector<RecordedBox>& boxes, const OutgoingRecording& recording) {
  constexpr std::int64_t kMost = std::numeric_limits<std::uint32_t>::max();
  std::int64_t last = -1;
  for (const RecordedBox& box : boxes) last = std::max(last, box.track_id);
  for (RecordedBox& box : boxes) {
    if (box.track_id < 0 && last <= kMost) box.track_id = ++last;
  }
  if (last > kMost) {
    throw std::runtime_error(fmt::format("expected track numbers of at most {}, got {}, in {}",
                                         kMost, last, recording.name));
  }
}

std::string prophesee_boxes(const std::vector<RecordedBox>& boxes, bool is_padded) {
  const std::string fields =
      "[('t', '<i8'), ('x', '<f4'), ('y', '<f4'), ('w', '<f4'), ('h', '<f4'), ('class_id', '<u4'), "
      "('track_id', '<u4'), ('class_confidence', '<f4')" +
      std::string(is_padded ? ", ('', '|V4')]" : "]");
  std::string rows;
  for (const RecordedBox& box : boxes) {
    put(rows, box.t_us);
    put(rows, static_cast<float>(box.box.left));
    put(rows, static_cast<float>(box.box.top));
    put(rows, static_cast<float>(box.box.right - box.box.left));
    put(rows, static_cast<float>(box.box.bottom - box.box.top));
    put(rows, static_cast<std::uint32_t>(box.class_number));
    put(rows, static_cast<std::uint32_t>(box.track_id));
    put(rows, 1.0f);
    if (is_padded) put(rows, std::uint32_t{0});
  }
  return npy_records(fields, is_padded ? 40 : 36, rows);
}

std::string name_before_bbox(const OutgoingRecording& recording) {
  std::string name = recording.name;
  for (auto at = name.find("bbox"); at != name.npos; at = name.find("bbox", at)) {
    name.replace(at, 1, "%62");
  }
  return name;
}

std::string window_line(const SampleWindow& window, const RecordedSample& sample,
                        std::int64_t clock_us) {
  return fmt::format("{} {} {} {} {}\n", window.begin_us - clock_us, window.end_us - clock_us,
                     window.label_us - clock_us, sample.events.size(),
                     escape_controls(sample.sample_id));
}

}  // namespace eventgan
