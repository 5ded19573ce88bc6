#include "stages/frames/own_labels/label_readers.h"

#include <algorithm>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>

#include "stages/frames/naming/found_frames.h"

namespace eventgan {

const LabelReader& label_reader(LabelFormat format) {
  const auto reader = std::ranges::find(kLabelReaders, format, &LabelReader::format);
  if (reader != kLabelReaders.end()) return **reader;
  throw std::logic_error("label_reader: not a format of labels");
}

LabelSearch take_files(const FoundFrames& frames, const std::vector<ManyLabels>& files) {
  constexpr std::size_t kMost = 8;  // each is read, and planned, as a source
  LabelSearch search;
  if (files.empty()) return search;
  search.paths.push_back(files.front().path);
  if (files.size() == 1) return search;
  const auto leave = [&](const ManyLabels& file, const std::string& reason) {
    search.unread.push_back(file.path.string() + reason +
                            " and is not read: join them in one file, or convert the manifest that "
                            "`eventgan init` writes, which leaves it out");
  };
  if (files.size() > kMost) {
    leave(files[1],
          ", as " + std::to_string(files.size() - 2) + " other files, labels these images, too,");
    return search;
  }
  std::map<std::string, std::string> labelled;  // images, with the name of their file
  for (const ManyLabels& file : files) {
    const std::set<std::string> images = frames_among(frames, file.images);
    const auto again = std::ranges::find_if(
        images, [&](const std::string& image) { return labelled.contains(image); });
    const bool is_first = &file == &files.front();
    if (again != images.end()) {
      leave(file, " labels images that " + labelled.at(*again) + " labels, too,");
    } else if (!images.empty()) {
      if (!is_first) search.paths.push_back(file.path);
      for (const std::string& image : images) {
        labelled.emplace(image, file.path.filename().string());
      }
    } else if (!is_first && !file.images.empty()) {
      leave(file, " names images that several folders have");
    }
  }
  return search;
}

std::unique_ptr<OwnLabels> open_own_labels(const LabelSpec& spec, const std::filesystem::path& base,
                                           LabelledSource source) {
  return label_reader(spec.format).open(spec, base, std::move(source));
}

}  // namespace eventgan
