#include "stages/frames/own_labels/detail/voc_labels.h"

#include <pugixml.hpp>
#include <string_view>
#include <type_traits>
#include <utility>

#include "stages/frames/kitti/kitti_label.h"
#include "stages/frames/label_name.h"
#include "stages/frames/own_labels/detail/file_per_image.h"
#include "stages/frames/own_labels/detail/find_labels.h"

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

template <class Number>
Number number(const pugi::xml_node& parent, const char* name, Number least, Number most) {
  const std::string_view text = text_of(one(parent, name));
  const auto value = parse_number<Number>(text);
  if (value && *value >= least && *value <= most) return *value;
  throw BadLabel(std::string("expected a ") + (std::is_integral_v<Number> ? "whole " : "") +
                 "number of pixels for <" + name + ">, got " + in_quotes(text));
}

double pixel(const pugi::xml_node& box, const char* name) {
  return number(box, name, -kFarthest_px, kFarthest_px);
}

/// 0 or 1; -1 if it is not there.
int flag(const pugi::xml_node& object, const char* name) {
  const pugi::xml_node element = at_most_one(object, name);
  if (!element) return -1;
  const std::string_view text = text_of(element);
  if (text == "0" || text == "1") return text == "1" ? 1 : 0;
  throw BadLabel(std::string("expected 0 or 1 for <") + name + ">, got " + in_quotes(text));
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

Rectangle rectangle(const pugi::xml_node& object, ImageSize size) {
  const pugi::xml_node box = one(object, "bndbox");
  const double xmin = pixel(box, "xmin");
  const double ymin = pixel(box, "ymin");
  const double xmax = pixel(box, "xmax");
  const double ymax = pixel(box, "ymax");
  if (xmin >= 1 && ymin >= 1 && xmax >= xmin && ymax >= ymin && xmax <= size.width &&
      ymax <= size.height) {
    return {xmin - 1, ymin - 1, xmax, ymax};
  }
  const auto written = [&](const char* name) { return std::string(box.child_value(name)); };
  throw BadLabel("expected a box from 1, 1 to " + std::to_string(size.width) + ", " +
                 std::to_string(size.height) + ", as VOC counts, got " + written("xmin") + ", " +
                 written("ymin") + " to " + written("xmax") + ", " + written("ymax"));
}

NamedBox read_object(const pugi::xml_node& object, ImageSize size) {
  NamedBox read;
  read.class_name = class_name(object);
  read.box.xyxy = rectangle(object, size);
  read.box.ignore = flag(object, "difficult") == 1;
  read.box.truncation = static_cast<float>(flag(object, "truncated"));
  read.box.occlusion = flag(object, "occluded");
  return read;
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
ImageLabels read_annotation(const pugi::xml_document& document, std::string& place) {
  const pugi::xml_node annotation = annotation_of(document);
  ImageLabels labels;
  constexpr int kMostSide = static_cast<int>(kFarthest_px);
  const pugi::xml_node size = one(annotation, "size");
  const int width = number(size, "width", 1, kMostSide);
  labels.size = ImageSize{number(size, "height", 1, kMostSide), width};
  const std::string file = place;
  for (const pugi::xml_node& object : annotation.children("object")) {
    place = file + " (object " + std::to_string(labels.boxes.size() + 1) + ")";
    labels.boxes.push_back(read_object(object, *labels.size));
  }
  return labels;
}

}  // namespace

Outcome<ImageLabels> parse_voc_labels(std::string xml, const std::string& path) {
  std::string place = path;
  try {
    // A shard's text ends there.
    if (xml.find('\0') != std::string::npos) throw BadLabel("expected text, got a NUL in it");
    pugi::xml_document document;
    const auto result =
        document.load_buffer(xml.data(), xml.size(),
                             pugi::parse_default | pugi::parse_doctype | pugi::parse_trim_pcdata);
    if (!result) throw BadLabel("expected XML, got '" + std::string(result.description()) + "'");
    ImageLabels labels = read_annotation(document, place);
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
    for (const FrameLabel& label : labels()) {
      if (!label.key.empty()) classes.add(read(label.key));
    }
    schema_.class_names = classes.names();
  }

  Outcome<Annotation> annotation(const std::string& label_key) const override {
    Outcome<ImageLabels> labels = read(label_key);
    if (is_fault(labels)) return labels.fault();
    auto& read = *labels;
    Outcome<ImageSize> size = image_size(label_key, read.size);
    if (is_fault(size)) return size.fault();
    return numbered(std::move(read), schema_.class_names, *size, label_place(label_key));
  }

 private:
  Outcome<ImageLabels> read(const std::string& label_key) const {
    Outcome<std::string> text = root().read(label_key);
    if (is_fault(text)) return text.fault();
    return parse_voc_labels(*std::move(text), label_place(label_key));
  }
};

std::optional<std::filesystem::path> find_voc(const FoundFrames& frames,
                                              std::vector<std::string>&) {
  std::filesystem::path labels = find_label_files(frames, kVocFiles);
  return labels.empty() ? std::nullopt : std::optional(std::move(labels));
}

}  // namespace

constinit const LabelReader kVocReader{LabelFormat::kVoc, open_labels<VocLabels>, find_voc};

}  // namespace eventgan
