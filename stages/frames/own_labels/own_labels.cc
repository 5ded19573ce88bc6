#include "stages/frames/own_labels/own_labels.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "manifests/values/text.h"
#include "stages/frames/decoding/frame_decoder.h"

namespace eventgan {

OwnLabels::OwnLabels(LabelledSource source)
    : source_(std::move(source)),
      labels_(source_.frames.size()),
      image_sizes_(std::make_unique<ImageSizes>()) {}

OwnLabels::~OwnLabels() = default;

void OwnLabels::give(std::size_t frame, const std::string& key) {
  FrameLabel& label = labels_.at(frame);
  frame_of_key_.emplace(key, frame);
  if (label.key.empty()) {
    label.key = key;
  } else if (label.fault.empty()) {
    label.fault = "expected one label of " + source_.root.written(source_.frames[frame].name) +
                  ", got two, in " + label_place(label.key) + " and " + label_place(key);
  }
}

void OwnLabels::give_absent(const std::string& name, const std::string& key) {
  absent_.push_back({name, key});
}

void OwnLabels::refuse_bare_names(const std::vector<std::string>& names,
                                  const std::string& labels_path) const {
  if (names.empty()) return;
  throw InputError("expected images' paths below " + source_.root.written("") + ", got " +
                   counted(names, "bare name", " that several of its folders have") + ", in " +
                   labels_path);
}

void OwnLabels::note_without_label(const std::string& labels_path) {
  std::size_t without = 0;
  for (const FrameLabel& label : labels_) without += label.key.empty();
  if (without == 0) return;
  notes_.push_back("no label for " + std::to_string(without) + " of " +
                   count_text(std::ssize(labels_), "frame") + " in " + labels_path +
                   ": no samples, but paired frames");
}

Outcome<ImageSize> OwnLabels::image_size(const std::string& label_key,
                                         std::optional<ImageSize> claimed) const {
  const auto found = frame_of_key_.find(label_key);
  if (found == frame_of_key_.end()) {
    return SampleFault{"expected a label of an image of the source, got one of none, in " +
                       label_place(label_key)};
  }
  const SourceFrame& frame = source_.frames[found->second];
  const auto file = source_.root.on_disk(frame.name);
  constexpr auto kUpright = ImageOrientation::kUpright;
  Outcome<ImageSize> size =
      frame.size ? Outcome<ImageSize>(*frame.size) : image_sizes_->of(file, kUpright);
  if (is_fault(size)) size = probe_image_size(file, kUpright);  // it may have been mended since
  if (is_fault(size) || !claimed || *size == *claimed) return size;
  return SampleFault{"expected an image of " + to_string(*claimed) + ", as " +
                     label_place(label_key) + " says, got " + to_string(*size) + ", in " +
                     source_.root.written(frame.name)};
}

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
