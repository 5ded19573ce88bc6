#include "pipeline/training/training_recording.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>

#include "manifests/values/faults.h"
#include "stages/events/event_volume.h"
#include "stages/events/volume_statistics.h"
#include "stages/frames/decoding/prepared_frame.h"
#include "stages/recordings/readers/recording.h"

namespace eventgan {
namespace {

/// What is wrong with the recording; empty if nothing is.
std::string fault_of(const RecordingSpec& spec, const TrainingRecording& opened, ImageSize smallest,
                     int smallest_gap) {
  const Recording& recording = *opened.recording;
  const ImageSize size = recording.size();
  const std::string where = ", in " + opened.file.string();
  if (recording.frame_count() == 0)
    return "expected a recording with frames, got one without" + where;
  if (size.height < smallest.height || size.width < smallest.width) {
    return "expected images of at least " + to_string(smallest) + " (crop), got " +
           to_string(size) + where;
  }
  if (spec.last_frame && *spec.last_frame >= recording.frame_count()) {
    return "expected last_frame below the number of frames, " +
           std::to_string(recording.frame_count()) + ", got " + std::to_string(*spec.last_frame) +
           where;
  }
  if (opened.last_frame - opened.first_frame < smallest_gap) {
    return "expected two frames " + std::to_string(smallest_gap) +
           " apart (the smallest of gaps), got frames " + std::to_string(opened.first_frame) +
           " to " + std::to_string(opened.last_frame) + where;
  }
  return "";
}

}  // namespace

std::vector<TrainingRecording> open_training_recordings(std::span<const RecordingSpec> specs,
                                                        const std::filesystem::path& directory,
                                                        ImageSize smallest, int smallest_gap) {
  std::vector<TrainingRecording> recordings;
  std::vector<std::string> faults;
  for (const RecordingSpec& spec : specs) {
    TrainingRecording opened;
    opened.file = directory / spec.path;
    opened.recording = open_recording(opened.file, spec.format, spec.options);
    opened.weight = spec.weight;
    opened.first_frame = spec.first_frame;
    opened.threshold = spec.threshold;
    opened.last_frame = spec.last_frame.value_or(opened.recording->frame_count() - 1);
    const std::string fault = fault_of(spec, opened, smallest, smallest_gap);
    if (!fault.empty()) faults.push_back(fault);
    recordings.push_back(std::move(opened));
  }
  if (!faults.empty()) throw UsageError(fmt::format("{}", fmt::join(faults, "\n  ")));
  return recordings;
}

namespace {

constexpr std::int64_t kFrameBytes = std::int64_t{128} << 20;
constexpr std::int64_t kEventBytes = std::int64_t{512} << 20;

void append_cut(const GreyImage& frame, const CropBox& box, std::vector<float>& values) {
  const auto width = static_cast<std::size_t>(box.size.width);
  for (int y = 0; y < box.size.height; ++y) {
    const auto row = static_cast<std::size_t>(box.top + y) * frame.size.width;
    values.resize(values.size() + width);
    to_input(std::span(frame.pixels).subspan(row + box.left, width), std::span(values).last(width));
  }
}

void append_cut(const std::vector<Event>& events, const CropBox& box, std::vector<Event>& cut) {
  for (Event event : events) {
    event.x -= box.left;
    event.y -= box.top;
    const bool inside =
        event.x >= 0 && event.x < box.size.width && event.y >= 0 && event.y < box.size.height;
    if (inside) cut.push_back(event);
  }
}

}  // namespace

CropBox centre_crop(ImageSize image, ImageSize size) {
  const ImageSize cut{std::min(image.height, size.height), std::min(image.width, size.width)};
  return {(image.height - cut.height) / 2, (image.width - cut.width) / 2, cut};
}

CropReader::CropReader(std::vector<TrainingRecording> recordings, int bins)
    : recordings_(std::move(recordings)),
      bins_(bins),
      frames_(kFrameBytes, [](const auto& frame) { return std::ssize(frame->pixels); }),
      intervals_(kEventBytes, [](const auto& events) {
        return std::ssize(*events) * std::int64_t{sizeof(Event)};
      }) {}

std::shared_ptr<const GreyImage> CropReader::frame(std::size_t recording,
                                                   std::int64_t index) const {
  return frames_.get({recording, index}, [&] {
    return std::make_shared<const GreyImage>(recordings_[recording].recording->frame(index));
  });
}

std::shared_ptr<const std::vector<Event>> CropReader::interval(std::size_t recording,
                                                               std::int64_t index) const {
  return intervals_.get({recording, index}, [&] {
    return std::make_shared<const std::vector<Event>>(
        recordings_[recording].recording->events_between(index, index + 1));
  });
}

std::size_t CropReader::event_count(std::size_t recording, std::int64_t frame) const {
  return interval(recording, frame)->size();
}

std::optional<Event> CropReader::event(std::size_t recording, std::int64_t first_frame,
                                       std::int64_t last_frame, double place) const {
  std::size_t count = 0;
  for (std::int64_t i = first_frame; i < last_frame; ++i) count += event_count(recording, i);
  auto left = static_cast<std::size_t>(place * static_cast<double>(count));
  for (std::int64_t i = first_frame; i < last_frame; ++i) {
    const auto events = interval(recording, i);
    if (left < events->size()) return (*events)[left];
    left -= events->size();
  }
  return std::nullopt;
}

TrainingSample CropReader::read(std::size_t recording, std::int64_t first_frame,
                                std::int64_t last_frame, const CropBox& box) const {
  TrainingSample sample;
  sample.shape = {bins_, box.size};
  sample.frames.reserve(2 * box.size.pixel_count());
  append_cut(*frame(recording, first_frame), box, sample.frames);
  append_cut(*frame(recording, last_frame), box, sample.frames);
  sample.network_frames = sample.frames;

  std::vector<Event> events;
  for (std::int64_t i = first_frame; i < last_frame; ++i) {
    append_cut(*interval(recording, i), box, events);
  }
  const TrainingRecording& source = recordings_[recording];
  if (source.threshold && !events.empty()) {
    // A clock that is not the frames' may put an event just outside of their times.
    const auto [first, last] = std::ranges::minmax(events, {}, &Event::t_s);
    sample.volume =
        event_volume(events, sample.shape,
                     std::array{std::min(source.recording->frame_time_s(first_frame), first.t_s),
                                std::max(source.recording->frame_time_s(last_frame), last.t_s)});
  } else {
    sample.volume = normalized(event_volume(events, sample.shape));
  }
  sample.threshold = source.threshold;

  sample.origin = source.recording->name() + " frames " + std::to_string(first_frame) + "-" +
                  std::to_string(last_frame) + " crop " + std::to_string(box.left) + "," +
                  std::to_string(box.top);
  return sample;
}

}  // namespace eventgan
