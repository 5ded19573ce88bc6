#include "stages/frames/naming/absent_frames.h"

#include <map>
#include <set>
#include <string>
#include <utility>

namespace eventgan {

void add_absent_frames(const OwnLabels& labels, std::vector<LabelledFrame>& frames) {
  namespace fs = std::filesystem;
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
    frames.push_back(std::move(frame));
  }
}

}  // namespace eventgan
