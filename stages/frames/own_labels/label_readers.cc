#include "stages/frames/own_labels/label_readers.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace eventgan {

const LabelReader& label_reader(LabelFormat format) {
  const auto reader = std::ranges::find(kLabelReaders, format, &LabelReader::format);
  if (reader != kLabelReaders.end()) return **reader;
  throw std::logic_error("label_reader: not a format of labels");
}

std::unique_ptr<OwnLabels> open_own_labels(const LabelSpec& spec, const std::filesystem::path& base,
                                           LabelledSource source) {
  return label_reader(spec.format).open(spec, base, std::move(source));
}

}  // namespace eventgan
