#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/frames.h"
#include "manifests/values/labels.h"
#include "stages/frames/own_labels/yolo_text.h"

namespace eventgan {

/// Labels of a recording of events, by their times in seconds on its clock.
struct RecordingLabels {
  /// What is at one time. Its boxes' class_id is an index into `class_names` here.
  std::map<double, Annotation> annotations;
  std::vector<std::string> class_names;  ///< as they first occur
  std::vector<std::string> joint_names;
};

/// Reads labels of a recording; manifests/guides/real_events.md has the forms.
///
/// NAME.csv: a header line with time_s, left, top, right, bottom, class and perhaps category, in
/// any order, then a line a box; a line with a time alone is a time without boxes. The original
/// annotation of a time is its lines. NAME.json: boxes, perhaps with tracks, and
/// persons; the original is the entry.
///
/// NAME.npy: Prophesee's boxes, a structured array with t (or ts, µs), x, y (the top left corner),
/// w, h, class_id, and perhaps track_id; DSEC-Det's tracks are the same. A class is called as
/// label_map_dictionary.json beside it, or of the export that it lies in, has it ({"0": "car"});
/// where there is no such file, "class 0". The original of a time is its rows, a line of JSON each,
/// with all of their fields.
///
/// Category: easy is difficulty 0; hard is 2, which the scores count as hard, as 1 would be;
/// dont_care is to be ignored; none is difficulty -1, not known.
///
/// Names of classes and joints have no control characters, a joint's is there once; places lie
/// within 1e6 px, as everywhere (map_labels).
///
/// Throws InputError, with every fault of the file: "expected X, got Y, in FILE (line 3)".
RecordingLabels read_recording_labels(const std::filesystem::path& file);

/// What is read beside such a file and decides what its labels mean, whether it is there or not.
std::vector<std::filesystem::path> recording_label_companions(const std::filesystem::path& file);

/// Labels of a recording that is one window, which have no time: NAME.txt beside a table NAME.npy,
/// .npz or .csv, as PEDRo has them.
bool is_window_label_file(const std::filesystem::path& file);

/// Whether it is YOLO's text, by its first line, in which one column may be a mistake; none if it
/// is blank, a window without objects or anything, or cannot be read.
std::optional<bool> is_window_label_text(const std::filesystem::path& file);

/// Reads such texts; looks once into each folder. Their classes are named by data.yaml, classes.txt
/// or the like beside the file or in the folder above it, else by their numbers.
class WindowLabels {
 public:
  /// Boxes as shares of a sensor of that size, at that time. Throws InputError: "expected X, got Y,
  /// in FILE:3".
  RecordingLabels read(const std::filesystem::path& file, ImageSize sensor, double time_s);

  /// Which file names the classes.
  std::vector<std::filesystem::path> companions(const std::filesystem::path& file);

 private:
  struct Names {
    std::filesystem::path file;  ///< absolute; empty: none
    std::optional<YoloSchema> classes;
  };
  Names& names_of(const std::filesystem::path& file);

  std::map<std::filesystem::path, Names> names_;  ///< by the texts' folder
};

/// Whether a NAME.csv is one of labels: its first line has one of their columns, or there is none.
bool is_label_table(const std::filesystem::path& file);

}  // namespace eventgan
