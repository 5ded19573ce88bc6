#include "stages/frames/own_labels/label_readers.h"

#include <algorithm>
#include <set>
#include <stdexcept>
#include <utility>

#include "stages/frames/naming/found_frames.h"

namespace eventgan {

const LabelReader& label_reader(LabelFormat format) {
  const auto reader = std::ranges::find(kLabelReaders, format, &LabelReader::format);
  if (reader != kLabelReaders.end()) return **reader;
  throw std::logic_error("label_reader: not a format of labels");
}

LabelSearch take_files(const FoundFrames& frames, const std::vector<ManyLabels>& files) {
  LabelSearch search;
  std::set<std::size_t> labelled;
  for (const ManyLabels& file : files) {
    const bool is_first = search.paths.empty();
    if (!is_first && file.images.empty()) continue;
    std::set<std::size_t> own;
    if (files.size() > 1) own = frames_among(frames, file.images);
    const bool is_again = own.empty() || std::ranges::any_of(own, [&](std::size_t frame) {
                            return labelled.contains(frame);
                          });
    if (is_first || !is_again) {
      search.paths.push_back(file.path);
      labelled.merge(own);
      continue;
    }
    search.unread.push_back(file.path.string() + " labels images that " +
                            search.paths.front().filename().string() +
                            " labels, too, and is not read: join them in one file, or convert the "
                            "manifest that `eventgan init` writes, which leaves it out");
  }
  return search;
}

std::unique_ptr<OwnLabels> open_own_labels(const LabelSpec& spec, const std::filesystem::path& base,
                                           LabelledSource source) {
  return label_reader(spec.format).open(spec, base, std::move(source));
}

}  // namespace eventgan
