#include "tests/fuzz/readers.h"

#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <stdexcept>

#include "manifests/values/faults.h"
#include "manifests/values/outlines.h"
#include "stages/base/archives/cdf_matrix.h"
#include "stages/base/archives/mat_json.h"
#include "stages/base/images/image_file.h"
#include "stages/frames/dataset/label_name.h"
#include "stages/frames/decoding/index_mask.h"
#include "stages/frames/events/recording_labels.h"
#include "stages/frames/own_labels/detail/coco_entry.h"
#include "stages/frames/own_labels/detail/csv_labels.h"
#include "stages/frames/own_labels/detail/mot_labels.h"
#include "stages/frames/own_labels/detail/voc_labels.h"
#include "stages/frames/own_labels/yolo_text.h"
#include "stages/generator/checkpoints/checkpoint.h"
#include "stages/generator/checkpoints/fold.h"
#include "stages/generator/safetensors.h"
#include "stages/generator/weights_file.h"
#include "stages/recordings/readers/detail/aedat3_recording.h"
#include "stages/recordings/readers/detail/aedat4_recording.h"
#include "stages/recordings/readers/detail/prophesee_recording.h"
#include "stages/recordings/readers/detail/rosbag_recording.h"
#include "stages/recordings/readers/detail/table_recording.h"
#include "tests/testing/zip_file.h"

namespace eventgan::testing {
namespace {

std::string text_of(std::span<const std::uint8_t> input) { return {input.begin(), input.end()}; }

/// Lengths, not values: any bytes are numbers.
void check_sizes(const StateDict& state) {
  for (const auto& [name, tensor] : state) {
    std::int64_t count = 1;
    for (const std::int64_t side : tensor.shape) count *= side;
    if (static_cast<std::size_t>(count) != tensor.values.size()) std::abort();
  }
}

void read_networks(const std::filesystem::path& file) {
  for (const char* network : {"gen", "dis"}) {
    StateDict state;
    try {
      state = read_checkpoint(file, network);
    } catch (const InputError&) {
      continue;
    }
    check_sizes(state);
    try {
      fold_generator(std::move(state), "input");
    } catch (const std::runtime_error&) {
    }
  }
}

/// All events, in parts, and all frames.
void read_parts(const StoredParts& parts) {
  constexpr std::int64_t kPart = 1000;
  for (std::int64_t first = 0; first < parts.events->count(); first += kPart) {
    const std::int64_t count = std::min(kPart, parts.events->count() - first);
    if (std::ssize(parts.events->read(first, count)) != count) std::abort();
  }
  for (std::size_t i = 0; parts.frames && i < parts.frames->times_s().size(); ++i) {
    const GreyImage frame = parts.frames->read(static_cast<std::int64_t>(i));
    if (frame.size != parts.size || frame.pixels.size() != parts.size.pixel_count()) std::abort();
  }
}

template <class Open>
void read_recording(std::span<const std::uint8_t> input, const std::filesystem::path& scratch,
                    Open open) {
  std::ofstream(scratch, std::ios::binary) << text_of(input);
  try {
    read_parts(open(scratch, RecordingOptions()));
  } catch (const InputError&) {
  }
}

/// Text that a shard can hold, and boxes that lie somewhere.
void check_labels(const ImageLabels& labels) {
  if (labels.original.find('\0') != std::string::npos) std::abort();
  for (const NamedBox& read : labels.boxes) {
    const Rectangle& xyxy = read.box.xyxy;
    for (const double edge : {xyxy.left, xyxy.top, xyxy.right, xyxy.bottom}) {
      if (!(std::abs(edge) <= 3 * kFarthest_px)) std::abort();
    }
    if (!is_label_name(read.class_name)) std::abort();
  }
}

/// Rings that lie somewhere, of three corners or more.
void check_outline(const Outline& outline) {
  for (const std::vector<Point>& ring : outline.rings) {
    if (ring.size() < 3) std::abort();
    for (const Point& corner : ring) {
      if (!(std::abs(corner.x) <= 2 * kFarthest_px && std::abs(corner.y) <= 2 * kFarthest_px)) {
        std::abort();
      }
    }
  }
}

/// Numbers of classes that are there, boxes that lie somewhere, and as many joints as there are.
void check_annotation(const Annotation& annotation, const LabelSchema& schema) {
  for (const Box& box : annotation.boxes) {
    if (box.class_id < 0 || box.class_id >= std::ssize(schema.class_names)) std::abort();
    if (!(box.xyxy.left < box.xyxy.right && box.xyxy.top < box.xyxy.bottom)) std::abort();
    check_outline(box.outline);
  }
  for (const Person& person : annotation.persons) {
    if (person.joints.size() != schema.joint_names.size()) std::abort();
    for (const Joint& joint : person.joints) {
      if (!(std::abs(joint.at.x) <= 2 * kFarthest_px && joint.visible <= 1)) std::abort();
    }
  }
}

/// No byte may be there twice.
template <class Images>
void check_all(const Images& images, std::size_t input_size) {
  std::size_t bytes = 0;
  for (const auto& [name, outcome] : images) {
    if (is_fault(outcome)) continue;
    check_labels(*outcome);
    bytes += outcome->original.size();
  }
  if (bytes > input_size) std::abort();
}

}  // namespace

void read_checkpoint_input(std::span<const std::uint8_t> input,
                           const std::filesystem::path& scratch) {
  std::ofstream(scratch, std::ios::binary) << text_of(input);
  read_networks(scratch);
}

void read_zip_pickle_input(std::span<const std::uint8_t> input,
                           const std::filesystem::path& scratch) {
  std::filesystem::remove(scratch);
  write_zip(scratch, {{"name/data.pkl", text_of(input)}, {"name/data/0", std::string(64, '\1')}});
  read_networks(scratch);
}

void read_safetensors_input(std::span<const std::uint8_t> input, const std::filesystem::path&) {
  const std::string bytes = text_of(input);
  try {
    const SafetensorsFile content = parse_safetensors(bytes, "input");
    check_sizes(content.tensors);
    // What is read is written and read again as the same.
    const std::string written = serialize_safetensors(content);
    if (serialize_safetensors(parse_safetensors(written, "written")) != written) std::abort();
  } catch (const std::runtime_error&) {
  }
  try {
    parse_weights(bytes, "input");
  } catch (const InputError&) {
  }
}

void read_mat_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch) {
  std::ofstream(scratch, std::ios::binary) << text_of(input);
  for (const char* name : {"RELEASE", "annolist_keyframes"}) {
    try {
      const MatVariable variable = read_mat_variable(scratch, name);
      mat_to_json(variable.array).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
    } catch (const InputError&) {
    } catch (const std::invalid_argument&) {  // of what lies below the variable's own header
    }
  }
}

void read_cdf_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch) {
  std::ofstream(scratch, std::ios::binary) << text_of(input);
  try {
    const TypedArray matrix = read_cdf_matrix(scratch, "Pose");
    if (matrix.size() != matrix.shape.at(0) * matrix.shape.at(1)) std::abort();
  } catch (const std::runtime_error&) {
  }
}

void read_voc_input(std::span<const std::uint8_t> input, const std::filesystem::path&) {
  const auto labels = parse_voc_labels(text_of(input), /*edges_from=*/1, "input");
  if (!is_fault(labels)) check_labels(*labels);
}

void read_mot_input(std::span<const std::uint8_t> input, const std::filesystem::path&) {
  const std::string text = text_of(input);
  for (const MotForm& form :
       {MotForm(), MotForm{0, {"a", "b"}}, MotForm{.is_visdrone = is_visdrone_table(text)}}) {
    try {
      check_all(parse_mot_labels(text, form, "input"), input.size());
    } catch (const InputError&) {
    }
  }
  try {
    parse_mot_sequence(text, "input");
  } catch (const InputError&) {
  }
}

void read_csv_input(std::span<const std::uint8_t> input, const std::filesystem::path&) {
  try {
    check_all(parse_csv_labels(text_of(input), "input"), input.size());
  } catch (const InputError&) {
  }
}

void read_coco_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch) {
  const std::string text = text_of(input);
  std::ofstream(scratch, std::ios::binary) << text;
  CocoIndex index;
  LabelSchema schema;
  try {
    index = index_coco(InputFile(scratch), "input");
    schema = coco_schema(index, "input");
  } catch (const InputError&) {
    return;
  }
  for (std::size_t i = 0; i < index.image_count(); ++i) {
    const CocoIndex::Image& image = index.images[i];
    Annotation annotation;
    const auto part = [&](const ByteRange& range) {
      return text.substr(range.offset, range.length);
    };
    try {
      const CocoImage entry = read_coco_image(part(image.entry), image.id, "input");
      const ImageSize size = entry.size.value_or(ImageSize{480, 640});
      for (std::size_t k = image.first_annotation; k < index.images[i + 1].first_annotation; ++k) {
        add_coco_annotation(part(index.annotations[k]), image.id, size, index, schema, "input",
                            annotation);
      }
      if (!index.categories.empty()) add_ignored_regions(entry, size, index, "input", annotation);
    } catch (const std::runtime_error&) {
    }
    check_annotation(annotation, schema);
  }
}

void read_yolo_input(std::span<const std::uint8_t> input, const std::filesystem::path&) {
  const std::string text = text_of(input);
  std::vector<YoloSchema> schemas{parse_yolo_classes("a\nb\n", "classes")};
  for (const bool is_yaml : {false, true}) {
    try {
      schemas.push_back(is_yaml ? parse_yolo_yaml(text, "input")
                                : parse_yolo_classes(text, "input"));
    } catch (const InputError&) {
    }
  }
  schemas.push_back(parse_yolo_yaml("names: [a]\nkpt_shape: [2, 3]", "data"));
  for (const YoloSchema& schema : schemas) {
    const auto annotation = parse_yolo_text(text, schema, {480, 640}, "input");
    if (!is_fault(annotation)) check_annotation(*annotation, schema.names);
  }
}

void read_mask_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch) {
  std::ofstream(scratch, std::ios::binary) << text_of(input);
  const Outcome<IndexMask> mask = IndexMask::read(scratch, "input");
  if (is_fault(mask)) return;
  std::size_t pixels = 0;
  for (const int index : mask->indices()) {
    const Outline outline = mask->outline(index);
    check_outline(outline);
    const GreyImage drawn = mask_of(outline, mask->size());
    pixels += static_cast<std::size_t>(std::ranges::count(drawn.pixels, 1));
  }
  if (pixels > mask->size().pixel_count()) std::abort();
  Annotation annotation;
  annotation.boxes.resize(2, Box{.xyxy = {0, 0, 4, 3}});
  annotation.left_out_at = {1};
  give_outlines(scratch, "input", mask->size(), "labels", annotation);
}

void read_png_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch) {
  constexpr std::size_t kHeader = 13;
  if (input.size() <= kHeader) return;
  const auto chunk = [](const std::string& kind_and_data) {
    const auto big_endian = [](std::uint64_t value) {
      std::string bytes;
      for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift);
      return bytes;
    };
    const auto* const bytes = reinterpret_cast<const Bytef*>(kind_and_data.data());
    return big_endian(kind_and_data.size() - 4) + kind_and_data +
           big_endian(crc32(0, bytes, static_cast<uInt>(kind_and_data.size())));
  };
  const std::span<const std::uint8_t> after = input.subspan(kHeader + 1);
  const std::size_t palette = std::min<std::size_t>(3 * input[kHeader], after.size());
  const std::span<const std::uint8_t> rows = after.subspan(palette);
  std::string stream(compressBound(rows.size()), '\0');
  uLongf size = stream.size();
  if (compress(reinterpret_cast<Bytef*>(stream.data()), &size, rows.data(), rows.size()) != Z_OK) {
    std::abort();
  }
  std::ofstream(scratch, std::ios::binary)
      << "\x89PNG\r\n\x1a\n"
      << chunk("IHDR" + text_of(input.first(kHeader)))
      << (palette > 0 ? chunk("PLTE" + text_of(after.first(palette))) : "")
      << chunk("IDAT" + stream.substr(0, size)) << chunk("IEND");
  try {
    const ColourFrame frame = decode_image_file(scratch);
    if (frame.bgr.size() != 3 * frame.size.pixel_count()) std::abort();
  } catch (const std::runtime_error&) {
  }
  try {
    const IndexImage image = decode_index_image(InputFile(scratch));
    if (image.indices.size() != image.size.pixel_count()) std::abort();
  } catch (const std::runtime_error&) {
  }
  try {
    const WideFrame image = decode_wide_image(InputFile(scratch));
    if (image.bgr.size() != 3 * image.size.pixel_count()) std::abort();
  } catch (const std::runtime_error&) {
  }
}

void read_aedat3_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch) {
  read_recording(input, scratch, open_aedat3);
}

void read_aedat4_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch) {
  read_recording(input, scratch, open_aedat4);
}

void read_prophesee_input(std::span<const std::uint8_t> input,
                          const std::filesystem::path& scratch) {
  read_recording(input, scratch, open_prophesee);
}

void read_rosbag_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch) {
  read_recording(input, scratch, open_rosbag);
}

void read_table_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch) {
  RecordingOptions options;
  options.sensor = ImageSize{3, 4};
  for (const char* extension : {".npy", ".npz", ".csv"}) {
    std::filesystem::path file = scratch;
    file += extension;
    std::ofstream(file, std::ios::binary) << text_of(input);
    try {
      find_recording_format(file, options);
      const auto recording = open_table_recording(file, options);
      for (const Event& event : recording->events_around(0, 1000, 1000)) {
        if (event.x < 0 || event.x > 3 || event.y < 0 || event.y > 2) std::abort();
      }
    } catch (const InputError&) {
    }
    std::filesystem::remove(file);
  }
  std::filesystem::path boxes = scratch;
  boxes += ".npy";
  std::ofstream(boxes, std::ios::binary) << text_of(input);
  try {
    for (const auto& [time_s, annotation] : read_recording_labels(boxes).annotations) {
      if (annotation.boxes.empty() || annotation.original.empty()) std::abort();
    }
  } catch (const std::runtime_error&) {
  }
  std::filesystem::remove(boxes);
}

}  // namespace eventgan::testing
