#pragma once

#include <filesystem>

#include "stages/recordings/readers/detail/stored_recording.h"

namespace eventgan {

/// The events of a bag of ROS 1, format 2.0 (wiki.ros.org/Bags/Format/2.0), and its frames. A topic
/// of events has messages laid out as dvs_msgs/EventArray, or as event_camera_msgs/EventPacket with
/// the encoding evt3 or mono; of several, in the order of their names, `stream` is the number of
/// the one that is read. Frames are the sensor_msgs/Image (mono8, bgr8, rgb8) of a topic in the
/// same namespace that have the sensor's size.
///
/// Times are ROS's, in whole microseconds: the stamps of the events of EventArray; of EventPacket,
/// whose events count on the camera's clock, the first event is at its message's stamp, and the
/// others follow on that clock. Events beside the sensor are left out and counted in notes.
///
/// All chunks with such messages are read once on opening, of a bag without an index twice. Of a
/// chunk, where it lies stays in memory, and the events as long as recent_events() keeps them. A
/// chunk that is cut off or damaged is left out and counted in notes; windows that reach from the
/// events before it to those after it are refused. Throws InputError "expected X, got Y, in PATH
/// (byte 4567)".
StoredParts open_rosbag(const std::filesystem::path& path, const RecordingOptions& options = {});

}  // namespace eventgan
