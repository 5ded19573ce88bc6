#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "stages/frames/events/recording_dataset.h"
#include "tests/stages/frames/frames_fixture.h"
#include "tests/stages/recordings/small_recording.h"

namespace eventgan {

inline constexpr char kLabelHeader[] = "time_s,left,top,right,bottom,class,category\n";

/// The small recording: frames at 1, 1.5 and 2 s; events at 0.5, 1, 1.25, 1.25, 1.75, 2 and 2.5 s.
class RecordingDatasetTest : public FolderTest {
 protected:
  RecordingDatasetTest() {
    spec_.dataset = DatasetKind::kRecording;
    spec_.root = "drive.h5";
    drive("drive.h5");
  }

  std::unique_ptr<Dataset> open() const { return open_recording_dataset(spec_, folder_.path()); }
  void drive(const std::string& name) const {
    testing::write_hdf5(at(name), testing::small_mvsec());
  }
  void label(const std::string& rows) const { write("drive.csv", kLabelHeader + rows); }
  void refused(const std::string& why) const { EXPECT_THROWS(open(), InputError, why); }

  /// Begin and end of a sample's window.
  static std::array<double, 2> window(const Dataset& dataset, std::size_t sample) {
    const LabelledFrame& frame = dataset.labelled_frames().at(sample);
    return {dataset.paired_frame(frame, -1).frame.time_s,
            dataset.paired_frame(frame, 1).frame.time_s};
  }
  static std::vector<Event> events(const Dataset& dataset, std::size_t sample) {
    const auto outcome = dataset.events(dataset.labelled_frames().at(sample).label_key);
    EXPECT_EQ(fault_of(outcome), "no fault");
    return outcome->events;
  }

  SourceSpec spec_;
  const std::vector<Event> all_ = testing::small_events();
};

}  // namespace eventgan
