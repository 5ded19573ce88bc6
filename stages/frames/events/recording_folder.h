#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "manifests/values/job.h"
#include "manifests/values/recording_formats.h"

namespace eventgan {

/// A recording of a source, as it was found: nothing of it has been read but how it begins.
struct FoundFile {
  std::string path;        ///< as FrameRef::path is written
  RecordingFormat format;  ///< as it was recognised
  std::string label_file;  ///< written as `path`; empty: none
  std::filesystem::path label_file_on_disk;

  void set_labels(std::string written, std::filesystem::path on_disk) {
    label_file = std::move(written);
    label_file_on_disk = std::move(on_disk);
  }
};

/// The recordings of a source and their labels (open_recording_dataset says which).
struct RecordingFolder {
  std::map<std::string, FoundFile>
      recordings;  ///< by name; of a source with labels those with some
  std::vector<std::string> notes;
  std::vector<std::string> unreadable;          ///< Dataset::unreadable
  std::map<std::string, std::string> unopened;  ///< why recordings do not open, by name
};

/// Looks at what lies at the source's root, and for labels beside it or where `annotations` says.
/// Throws InputError if there is no recording, or labels do not tell whose they are; UsageError if
/// `annotations` does not fit.
RecordingFolder look_into_recordings(const SourceSpec& spec, const std::filesystem::path& base);

/// What lies beside a file, or near it, written as that one is.
std::string written_beside(const std::filesystem::path& beside, const std::filesystem::path& file,
                           const std::string& written_file);

}  // namespace eventgan
