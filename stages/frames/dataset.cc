#include "stages/frames/dataset.h"

#include <cmath>
#include <stdexcept>

#include "manifests/documents/detail/json_text.h"
#include "manifests/values/faults.h"
#include "stages/frames/events/dhp19_dataset.h"
#include "stages/frames/events/recording_dataset.h"
#include "stages/frames/human36m/human36m_dataset.h"
#include "stages/frames/kitti/kitti_object_dataset.h"
#include "stages/frames/kitti/kitti_raw_dataset.h"
#include "stages/frames/kitti/kitti_tracking_dataset.h"
#include "stages/frames/mpii/mpii_dataset.h"
#include "stages/frames/mpii/mpii_list_dataset.h"
#include "stages/frames/sequences/frames_dataset.h"

namespace eventgan {

void EventWindow::tell_times(FramePair& pair) const {
  if (!std::isnan(pair.previous.time_s) || events.empty()) return;
  pair.previous.time_s = events.front().t_s;
  pair.next.time_s = events.back().t_s;
}

ImageSize Dataset::sensor_size(const std::string& label_key) const {
  throw std::logic_error("expected a dataset of events, got one of frames (" + label_key + ")");
}

Outcome<EventWindow> Dataset::events(const std::string& label_key) const {
  throw std::logic_error("expected a dataset of events, got one of frames (" + label_key + ")");
}

namespace {

std::unique_ptr<Dataset> open_unchecked(const SourceSpec& spec, const std::filesystem::path& base) {
  switch (spec.dataset) {
    case DatasetKind::kKittiObject:
      return open_kitti_object_dataset(spec, base);
    case DatasetKind::kKittiTracking:
      return open_kitti_tracking_dataset(spec, base);
    case DatasetKind::kKittiRaw:
      return open_kitti_raw_dataset(spec, base);
    case DatasetKind::kMpii:
      return open_mpii_dataset(spec, base);
    case DatasetKind::kMpiiList:
      return open_mpii_list_dataset(spec, base);
    case DatasetKind::kHuman36m:
      return open_human36m_dataset(spec, base);
    case DatasetKind::kFrames:
      return open_frames_dataset(spec, base);
    case DatasetKind::kRecording:
      return open_recording_dataset(spec, base);
    case DatasetKind::kDhp19:
      return open_dhp19_dataset(spec, base);
  }
  throw std::logic_error("open_dataset: not a kind of dataset");
}

}  // namespace

std::unique_ptr<Dataset> open_dataset(const SourceSpec& spec, const std::filesystem::path& base) {
  std::unique_ptr<Dataset> dataset = open_unchecked(spec, base);
  for (const LabelledFrame& frame : dataset->labelled_frames()) {
    for (const std::string* name : {&frame.sample_id, &frame.sequence, &frame.frame.path}) {
      if (name->find('\0') == std::string::npos) continue;
      throw InputError("expected names of frames without NUL, got \"" + escape_controls(*name) +
                       "\", in " + escape_controls(dataset->label_place(frame.label_key)));
    }
  }
  return dataset;
}

namespace {

/// SUBJECT, separator, ACTION, last separator, CAMERA.
FrameOrigin human36m_origin(const std::string& sequence) {
  const bool fetched = sequence.find('/') != std::string::npos;
  const std::size_t first = sequence.find(fetched ? '/' : '_');
  const std::size_t last = sequence.rfind(fetched ? '/' : '.');
  if (first == std::string::npos || last == std::string::npos || first >= last) return {};
  return {.subject = sequence.substr(0, first),
          .action = sequence.substr(first + 1, last - first - 1),
          .camera = sequence.substr(last + 1)};
}

}  // namespace

FrameOrigin frame_origin(DatasetKind dataset, const std::string& sequence) {
  switch (dataset) {
    case DatasetKind::kHuman36m:
    case DatasetKind::kDhp19:
      return human36m_origin(sequence);
    case DatasetKind::kKittiRaw:
    case DatasetKind::kKittiObject:
    case DatasetKind::kKittiTracking:
      return {.drive = sequence};
    case DatasetKind::kMpii:
    case DatasetKind::kMpiiList:
    case DatasetKind::kFrames:
    case DatasetKind::kRecording:
      break;
  }
  return {};
}

}  // namespace eventgan
