#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "manifests/values/labels.h"

namespace eventgan {

/// Labels of a recording of events, by their times in seconds on its clock.
struct RecordingLabels {
  /// What is at one time. Its boxes' class_id is an index into `class_names` here.
  std::map<double, Annotation> annotations;
  std::vector<std::string> class_names;  ///< as they first occur
  std::vector<std::string> joint_names;
};

/// Reads labels of a recording; manifests/guides/real_events.md has both forms.
///
/// NAME.csv: a header line with time_s, left, top, right, bottom, class and perhaps category, in
/// any order, then a line a box; a line with a time alone is a time without boxes. The original
/// annotation of a time is its lines. NAME.json: boxes and persons; the original is the entry.
///
/// Category: easy is difficulty 0; hard is 2, which the scores count as hard, as 1 would be;
/// dont_care is to be ignored; none is difficulty -1, not known.
///
/// Names of classes and joints have no control characters, a joint's is there once; places lie
/// within 1e6 px, as everywhere (map_labels).
///
/// Throws InputError, with every fault of the file: "expected X, got Y, in FILE (line 3)".
RecordingLabels read_recording_labels(const std::filesystem::path& file);

}  // namespace eventgan
