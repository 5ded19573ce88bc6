#include "pipeline/training/samples/crop_reader.h"

#include <algorithm>

#include "stages/events/event_volume.h"
#include "stages/events/normalization.h"

namespace eventgan {
namespace {

constexpr std::size_t kFrameBytes = std::size_t{128} << 20;
constexpr std::size_t kEventBytes = std::size_t{512} << 20;

void append_cut(const GreyImage& frame, const CropBox& box, std::vector<float>& values) {
  for (int y = 0; y < box.size.height; ++y) {
    const auto row = static_cast<std::size_t>(box.top + y) * frame.size.width;
    for (int x = 0; x < box.size.width; ++x) {
      const float u = frame.pixels[row + box.left + x];
      values.push_back((u / 255.0f - 0.5f) * 2.0f);
    }
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

CropBox centre_crop(ImageSize picture, ImageSize size) {
  const ImageSize cut{std::min(picture.height, size.height), std::min(picture.width, size.width)};
  return {(picture.height - cut.height) / 2, (picture.width - cut.width) / 2, cut};
}

CropReader::CropReader(std::vector<TrainingRecording> recordings, int bins)
    : recordings_(std::move(recordings)),
      bins_(bins),
      frames_(kFrameBytes, [](const GreyImage& frame) { return frame.pixels.size(); }),
      intervals_(kEventBytes,
                 [](const std::vector<Event>& events) { return events.size() * sizeof(Event); }) {}

std::shared_ptr<const GreyImage> CropReader::frame(std::size_t recording,
                                                   std::int64_t index) const {
  return frames_.get({recording, index},
                     [&] { return recordings_[recording].recording->frame(index); });
}

std::shared_ptr<const std::vector<Event>> CropReader::interval(std::size_t recording,
                                                               std::int64_t index) const {
  return intervals_.get({recording, index}, [&] {
    return recordings_[recording].recording->events_between(index, index + 1);
  });
}

std::size_t CropReader::event_count(std::size_t recording, std::int64_t frame) const {
  return interval(recording, frame)->size();
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
  sample.volume = normalized(event_volume(events, sample.shape));

  sample.origin = recordings_[recording].recording->name() + " frames " +
                  std::to_string(first_frame) + "-" + std::to_string(last_frame) + " crop " +
                  std::to_string(box.left) + "," + std::to_string(box.top);
  return sample;
}

}  // namespace eventgan
