#include "stages/frames/naming/absent_frames.h"

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "stages/frames/listing/image_folder.h"
#include "stages/frames/listing/numbered_sequence.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// An image that is there and is no frame, as the labels name it or of a format that is not read;
/// empty if there is none.
std::string passed_over_image(const SourceRoot& root, const std::string& name) {
  if (has_file(root.on_disk(name))) return name;
  for (const char* extension : {".heic", ".HEIC", ".heif", ".avif", ".jxl", ".jp2", ".gif"}) {
    const std::string other = fs::path(name).replace_extension(extension).generic_string();
    if (has_file(root.on_disk(other))) return other;
  }
  return {};
}

}  // namespace

void add_absent_frames(const OwnLabels& labels, std::vector<LabelledFrame>& frames) {
  if (frames.empty() && labels.absent().empty()) {
    throw InputError("expected labels of the frames in " + labels.source().root.written("") +
                     ", got of none of the " + std::to_string(labels.source().frames.size()));
  }
  std::map<std::string, std::string> sequence_of_folder;  // where it has one alone
  for (const SourceFrame& frame : labels.source().frames) {
    const std::string folder = fs::path(frame.name).parent_path().generic_string();
    std::string& sequence = sequence_of_folder.try_emplace(folder, frame.sequence).first->second;
    if (sequence != frame.sequence) sequence = folder;
  }
  std::set<std::string> ids;
  for (const LabelledFrame& frame : frames) ids.insert(frame.sample_id);
  std::set<std::string> names;
  for (const AbsentFrame& absent : labels.absent()) {
    if (!names.insert(absent.name).second) continue;  // named twice, missing once
    const fs::path name(absent.name);
    const std::string folder = name.parent_path().generic_string();
    const auto known = sequence_of_folder.find(folder);
    LabelledFrame frame;
    frame.sequence = known == sequence_of_folder.end() ? folder : known->second;
    frame.sample_id = (fs::path(frame.sequence) / name.stem()).generic_string();
    if (ids.contains(frame.sample_id)) frame.sample_id = absent.name;
    while (!ids.insert(frame.sample_id).second) frame.sample_id += '~';
    frame.frame.path = labels.source().root.written(absent.name);
    frame.frame.index = kAbsentFrame;
    frame.label_key = absent.key;
    frame.fault = absent.fault;
    const SourceRoot& root = labels.source().root;
    const std::string other = frame.fault.empty() ? passed_over_image(root, absent.name) : "";
    if (!other.empty()) {
      const bool is_read =
          std::ranges::find(kImageExtensions, lower_extension(other)) != kImageExtensions.end();
      frame.fault = (is_read ? "expected a frame, got an image that was passed over, in a folder "
                               "beside images, more than two folders deep, or beside one of its "
                               "name that counts, in "
                             : "expected a frame, got a file of another format, which ImageMagick "
                               "converts (mogrify -format png), in ") +
                    root.written(other);
    }
    frames.push_back(std::move(frame));
  }
}

}  // namespace eventgan
