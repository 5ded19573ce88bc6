#include "stages/frames/own_labels/detail/voc_labels.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <pugixml.hpp>
#include <set>
#include <string_view>
#include <unordered_map>
#include <utility>

#include "manifests/values/text_lines.h"
#include "stages/frames/dataset/label_name.h"
#include "stages/frames/decoding/index_mask.h"
#include "stages/frames/naming/file_per_image.h"
#include "stages/frames/naming/found_frames.h"
#include "stages/frames/own_labels/label_readers.h"

namespace eventgan {
namespace {

/// The child of that name; a null node if there is none.
pugi::xml_node at_most_one(const pugi::xml_node& parent, const char* name) {
  const pugi::xml_node child = parent.child(name);
  if (!child.next_sibling(name)) return child;
  throw BadLabel(std::string("expected <") + name + "> once, got it twice");
}

pugi::xml_node one(const pugi::xml_node& parent, const char* name) {
  if (const pugi::xml_node child = at_most_one(parent, name)) return child;
  throw BadLabel(std::string("expected <") + name + ">, got none");
}

/// What stands in an element, if that is text and nothing else.
std::string_view text_of(const pugi::xml_node& element) {
  if (element.first_child() == element.last_child()) return element.child_value();
  throw BadLabel(std::string("expected text alone in <") + element.name() + ">, got more");
}

double pixel(const pugi::xml_node& box, const char* name) {
  const std::string_view text = text_of(one(box, name));
  const auto value = parse_number<double>(text);
  if (value && std::abs(*value) <= kFarthest_px) return *value;
  throw BadLabel(std::string("expected a number of pixels for <") + name + ">, got " +
                 in_quotes(text));
}

/// What <size> says; nothing, as some programs write it, where it is absent, empty or 0.
std::optional<ImageSize> size_of(const pugi::xml_node& annotation) {
  const pugi::xml_node size = at_most_one(annotation, "size");
  const auto side = [&](const char* name) {
    const pugi::xml_node element = at_most_one(size, name);
    const std::string_view text = element ? text_of(element) : "0";
    const auto pixels = text.empty() ? 0 : parse_whole(text);
    if (pixels && *pixels >= 0 && *pixels <= static_cast<std::int64_t>(kFarthest_px)) {
      return static_cast<int>(*pixels);
    }
    throw BadLabel(std::string("expected a whole number of pixels for <") + name + ">, got " +
                   in_quotes(text));
  };
  const ImageSize said{side("height"), side("width")};
  return said.height > 0 && said.width > 0 ? std::optional(said) : std::nullopt;
}

/// A share 0..1; -1 if it is not there, or is something else, which is a remark.
double flag(const pugi::xml_node& object, const char* name, ImageLabels& labels) {
  const pugi::xml_node element = at_most_one(object, name);
  if (!element) return -1;
  const std::string_view text = text_of(element);
  if (text == "true" || text == "True") return 1;
  if (text == "false" || text == "False") return 0;
  const auto share = parse_number<double>(text);
  if (share && *share >= 0 && *share <= 1) return *share;
  labels.remarks.push_back(std::string("<") + name + "> that is no 0 or 1 taken for unknown");
  return -1;
}

/// pugixml leaves an entity that it does not know as it is.
bool has_entity(std::string_view text) {
  const std::size_t begin = text.find('&');
  return begin != std::string_view::npos && text.find(';', begin) != std::string_view::npos;
}

std::string class_name(const pugi::xml_node& object) {
  const std::string_view name = text_of(one(object, "name"));
  if (is_label_name(name) && !has_entity(name)) return std::string(name);
  throw BadLabel("expected a name without control characters and unknown entities, got " +
                 in_quotes(name));
}

void read_object(const pugi::xml_node& object, int edges_from, ImageLabels& labels) {
  NamedBox read;
  read.class_name = class_name(object);
  const pugi::xml_node box = one(object, "bndbox");
  read.box.xyxy = {pixel(box, "xmin") - edges_from, pixel(box, "ymin") - edges_from,
                   pixel(box, "xmax"), pixel(box, "ymax")};
  read.box.ignore = flag(object, "difficult", labels) == 1;
  read.box.truncation = static_cast<float>(flag(object, "truncated", labels));
  const double occluded = flag(object, "occluded", labels);
  read.box.occlusion = occluded == 0 || occluded == 1 ? static_cast<int>(occluded) : -1;
  if (const pugi::xml_node track = at_most_one(object, "trackid")) {  // of ImageNet VID
    const auto number = parse_whole(text_of(track));
    if (number && *number >= 0) {
      read.box.track_id = *number;
    } else {
      labels.remarks.push_back("<trackid> that is no whole number from 0 left out");
    }
  }
  labels.boxes.push_back(std::move(read));
}

/// The document's element <annotation>, if it is a document of that and nothing before it.
pugi::xml_node annotation_of(const pugi::xml_document& document) {
  for (const pugi::xml_node& child : document.children()) {
    if (child.type() == pugi::node_doctype) throw BadLabel("expected no DOCTYPE, got one");
  }
  const pugi::xml_node annotation = document.document_element();
  const std::string_view name = annotation.name();
  if (name == "annotation" && document.last_child() == annotation) return annotation;
  throw BadLabel("expected <annotation> alone, got " +
                 in_quotes(name == "annotation" ? document.last_child().name() : name));
}

/// `place` becomes that of the object where a fault of one is thrown.
ImageLabels read_annotation(const pugi::xml_document& document, int edges_from,
                            std::string& place) {
  const pugi::xml_node annotation = annotation_of(document);
  ImageLabels labels;
  labels.size = size_of(annotation);
  const std::string file = place;
  for (const pugi::xml_node& object : annotation.children("object")) {
    place = file + " (object " + std::to_string(labels.boxes.size() + 1) + ")";
    read_object(object, edges_from, labels);
  }
  return labels;
}

}  // namespace

Outcome<ImageLabels> parse_voc_labels(std::string xml, int edges_from, const std::string& path) {
  std::string place = path;
  try {
    // A shard's text ends there.
    if (xml.find('\0') != std::string::npos) throw BadLabel("expected text, got a NUL in it");
    pugi::xml_document document;
    const auto result =
        document.load_buffer(xml.data(), xml.size(),
                             pugi::parse_default | pugi::parse_doctype | pugi::parse_trim_pcdata);
    if (!result) throw BadLabel("expected XML, got '" + std::string(result.description()) + "'");
    ImageLabels labels = read_annotation(document, edges_from, place);
    labels.original = std::move(xml);
    return labels;
  } catch (const BadLabel& bad) {
    return bad.in(place);
  }
}

namespace {

const LabelFiles kVocFiles{
    ".xml", {"jpegimages", "images"}, {"annotations", "annotations/xmls", "labels", "xml", "xmls"}};

class VocLabels : public FilePerImage {
 public:
  VocLabels(const LabelSpec& spec, const std::filesystem::path& base, LabelledSource labelled)
      : FilePerImage(spec, base, std::move(labelled), kVocFiles) {
    ClassList classes;
    Remarks remarks;
    std::string at_0;  // a file with an edge there
    bool has_boxes = false, are_roboflows = true;
    for (const FrameLabel& label : labels()) {
      if (label.key.empty()) continue;
      const Outcome<ImageLabels> read = read_file(label.key);
      classes.add(read);
      if (is_fault(read)) continue;
      remarks.add(*read, label_place(label.key));
      has_boxes = has_boxes || !read->boxes.empty();
      const bool is_roboflows = read->original.find("<database>roboflow.") != std::string::npos;
      are_roboflows = are_roboflows && (is_roboflows || read->boxes.empty());
      const auto is_at_0 = [](const NamedBox& box) {
        const auto [left, top, right, bottom] = box.box.xyxy;
        return (left >= 0 && left < 1) || (top >= 0 && top < 1);
      };
      if (at_0.empty() && std::ranges::any_of(read->boxes, is_at_0)) at_0 = label_place(label.key);
    }
    are_roboflows = are_roboflows && has_boxes;
    schema_.class_names = classes.names();
    edges_from_ = spec.edges_from.value_or(at_0.empty() && !are_roboflows ? 1 : 0);
    if (has_boxes) meanings_["edges_from"] = std::to_string(edges_from_);
    if (has_boxes && !spec.edges_from) note_edges(at_0, are_roboflows);
    remarks.move_to(notes_);
    find_masks();
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override {
    Outcome<ImageLabels> labels = read_file(label_key);
    if (is_fault(labels)) return labels.fault();
    auto& read = *labels;
    Outcome<ImageSize> size = image_size(label_key, read.size);
    if (is_fault(size)) return size.fault();
    auto annotation = numbered(std::move(read), schema_.class_names, *size, label_place(label_key));
    const auto mask = mask_of_.find(label_key);
    if (is_fault(annotation) || mask == mask_of_.end()) return annotation;
    auto fault = give_outlines(mask->second.on_disk, mask->second.written, *size,
                               label_place(label_key), *annotation);
    return fault ? Outcome<Annotation>(*std::move(fault)) : annotation;
  }

 private:
  Outcome<ImageLabels> read_file(const std::string& label_key) const {
    Outcome<std::string> text = root().read(label_key);
    if (is_fault(text)) return text.fault();
    return parse_voc_labels(*std::move(text), edges_from_, label_place(label_key));
  }

  void find_masks() {
    std::map<std::string, std::set<std::string>> listed;  // by the folder of labels
    for (const FrameLabel& label : labels()) {
      if (label.key.empty()) continue;
      const std::filesystem::path key(label.key);
      const std::string folder = key.parent_path().generic_string();
      const auto [masks, is_new] = listed.try_emplace(folder);
      if (is_new) {
        for (std::string& name : root().above(folder).files_in(kMasks)) {
          masks->second.insert(std::move(name));
        }
      }
      const std::string name = key.stem().string() + ".png";
      if (!masks->second.contains(name)) continue;
      const SourceRoot above = root().above(folder);
      const std::string file = std::string(kMasks) + "/" + name;
      annotation_files_.push_back(above.written(file));
      mask_of_[label.key] = {above.on_disk(file), above.written(file)};
    }
  }

  /// A pixel is not much, and nobody would find out otherwise.
  void note_edges(const std::string& at_0, bool are_roboflows) {
    const std::string begin =
        "edges count from " + std::to_string(edges_from_) + " in " + root().written("");
    notes_.push_back(
        are_roboflows ? begin + ", as Roboflow's do"
        : at_0.empty()
            ? begin +
                  ", as Pascal VOC's do, since none is at 0 (CVAT's, VoTT's and Roboflow's "
                  "count from 0: \"edges_from\": 0 in the manifest's labels)"
            : begin + ", since one is at 0 in " + at_0 +
                  " (if that is a slip: \"edges_from\": 1 in the manifest's labels)");
  }

  static constexpr std::string_view kMasks = "SegmentationObject";
  struct Mask {
    std::filesystem::path on_disk;
    std::string written;
  };

  int edges_from_ = 0;  ///< until all files are read: edges as they are written
  std::unordered_map<std::string, Mask> mask_of_;  ///< by label_key
};

LabelSearch find_voc(const FoundFrames& frames) {
  const std::filesystem::path labels = find_label_files(frames, kVocFiles);
  if (labels.empty()) return {};
  return {{labels}};
}

}  // namespace

constinit const LabelReader kVocReader{LabelFormat::kVoc, open_labels<VocLabels>, find_voc,
                                       /*image_folder=*/{}, /*extension=*/".xml"};

}  // namespace eventgan
