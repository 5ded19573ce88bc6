#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <stdexcept>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "manifests/documents/json_text.h"
#include "manifests/files/atomic_file.h"
#include "manifests/values/faults.h"
#include "manifests/values/half.h"
#include "manifests/values/outlines.h"
#include "manifests/values/text.h"
#include "pipeline/exports/detail/sample_events.h"
#include "pipeline/runtime/threads.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/events/representation.h"
#include "stages/exports/array_files.h"
#include "stages/shards/codec/volume_codec.h"
#include "stages/shards/shard_tables.h"

namespace eventgan {
namespace {

using Json = nlohmann::ordered_json;

/// A row's numbers in their shape, null for what is unknown.
template <class Number>
Json json_of(const ColumnSpec& column, std::span<const std::size_t> sides,
             std::span<const Number> numbers) {
  if constexpr (std::is_floating_point_v<Number>) {
    const auto is_nan = [](Number x) { return std::isnan(x); };
    if (!numbers.empty() && std::ranges::all_of(numbers, is_nan)) return {};
  }
  if (!numbers.empty() && std::ranges::equal(numbers, column.unknown)) return {};
  if (sides.empty()) {
    // The bytes of a shard are flags.
    if constexpr (std::is_same_v<Number, std::uint8_t>) return numbers.front() != 0;
    return numbers.front();
  }
  Json lines = Json::array();
  const std::size_t size = sides[0] == 0 ? 0 : numbers.size() / sides[0];
  for (std::size_t i = 0; i < sides[0]; ++i) {
    lines.push_back(json_of(column, sides.subspan(1), numbers.subspan(i * size, size)));
  }
  return lines;
}

/// A row of a column; null also if the shard does not have the column.
template <class Element>
Json row_json(const ColumnSpec& column, const std::vector<Element>& values, std::size_t row) {
  if (values.empty()) return {};
  if constexpr (std::is_same_v<Element, Half>) {  // of images, which are no JSON
    return {};
  } else if constexpr (std::is_same_v<Element, std::string>) {
    return values[row].empty() ? Json() : Json(values[row]);
  } else if constexpr (std::is_same_v<Element, std::vector<char>>) {  // an outline
    const auto outline = read_outline({values[row].data(), values[row].size()});
    return outline && !outline->empty() ? Json::parse(outline_text(*outline)) : Json();
  } else {
    return json_of<Element>(column, column.inner,
                            std::span(values).subspan(row * column.width(), column.width()));
  }
}

/// The sample's columns of /pairs and /labels under their names
/// (manifests/guides/shard_format.md), but for the original annotation.
std::string labels_json(const OutgoingSample& sample) {
  const ShardHeader& header = sample.reader.header();
  const ShardTables& tables = sample.reader.tables();
  const LabelSchema& schema = header.label_schema;
  const auto slot = static_cast<std::size_t>(sample.slot);
  Json json = {{"split", sample.source.split}};
  Json boxes = Json::array();
  Json persons = Json::array();
  visit_columns(tables, header, [&](const ColumnSpec& column, const auto& values) {
    const std::string_view path = column.path;
    if (!path.starts_with("/pairs/") && !path.starts_with("/labels/")) return;
    if (path == "/labels/original" || column.rows == Rows::kOffsets || column.is_image) return;
    const std::string name(column.name());
    const auto each_of = [&](Json& list, const std::vector<std::int64_t>& offsets) {
      const auto first = static_cast<std::size_t>(offsets[slot]);
      const auto count = static_cast<std::size_t>(offsets[slot + 1]) - first;
      for (std::size_t i = 0; i < count; ++i) list[i][name] = row_json(column, values, first + i);
    };
    if (column.rows == Rows::kBoxes) {
      each_of(boxes, tables.boxes.offsets);
    } else if (column.rows == Rows::kPersons) {
      each_of(persons, tables.poses.offsets);
    } else {
      json[name] = row_json(column, values, slot);
    }
  });
  if (sample.source.has_boxes()) {
    for (Json& box : boxes) box["class"] = schema.class_names.at(box.at("class_id"));
    json["boxes"] = std::move(boxes);
  }
  if (sample.source.has_joints()) {
    json["joint_names"] = schema.joint_names;
    if (!schema.joint_aliases.empty()) json["joint_aliases"] = schema.joint_aliases;
    json["persons"] = std::move(persons);
  }
  return dump_json(json) + "\n";
}

const char* dtype_of(StoredType type) {
  switch (type) {
    case StoredType::kFloat32:
      return "<f4";
    case StoredType::kFloat16:
      return "<f2";
    case StoredType::kUint8:
      break;
  }
  return "|u1";
}

using Arrays = std::vector<std::pair<std::string, std::string>>;  ///< names and .npy files

/// [channels, H, W]; of 0 channels [H, W].
std::vector<std::size_t> sides_of(int channels, ImageSize size) {
  std::vector<std::size_t> sides{static_cast<std::size_t>(size.height),
                                 static_cast<std::size_t>(size.width)};
  if (channels > 0) sides.insert(sides.begin(), static_cast<std::size_t>(channels));
  return sides;
}

/// `volume` as the shard stores it, and its `scale`.
Arrays volume_arrays(const OutgoingSample& sample) {
  const ShardHeader& header = sample.reader.header();
  const VolumeShape& shape = header.volume;
  const std::size_t size_bytes = shape.value_count() * stored_size(header.dtype);
  const auto stored = decode_chunk(sample.reader.stored_chunk(sample.slot), header.dtype,
                                   header.deflate_level, size_bytes);
  if (!stored) {
    throw std::runtime_error("expected an intact volume, got a damaged one, in " + header.name +
                             " (" + sample.labels.sample_id + ")");
  }
  const auto sides = sides_of(shape.channels(), shape.size);
  return {{"volume", npy_file(dtype_of(header.dtype), sides, *stored)},
          {"scale", npy_file("<f4", {}, std::vector<float>{sample.labels.scale})}};
}

/// Of a sample with flow `flow` and `flow_valid`, else none.
Arrays flow_arrays(const OutgoingSample& sample) {
  if (sample.labels.flow.empty()) return {};
  const ImageSize size = sample.reader.header().volume.size;
  const std::size_t values = 2 * size.pixel_count();
  const std::span row = std::span(sample.reader.tables().flow)
                            .subspan(values * static_cast<std::size_t>(sample.slot), values);
  return {{"flow", npy_file("<f2", sides_of(2, size), std::as_bytes(row))},
          {"flow_valid", npy_file("|u1", sides_of(0, size), sample.labels.flow.valid)}};
}

std::string tar_name(const ExportShard& shard) {
  return shard.outline.name.substr(0, shard.outline.name.rfind('.')) + ".tar";
}

/// SHARD.tar with NAME.npz and NAME.json.
class WebdatasetExporter : public Exporter {
 public:
  WebdatasetExporter(const ExportInput& input, const ExportOptions& options)
      : seed_(options.seed), events_(input, options) {
    if (options.representation) {
      representation_ = parse_representation(*options.representation);
      word_ = *options.representation;
    } else if (options.counts || options.seed != 0) {
      throw UsageError(
          "--counts, --seed: expected --representation WORD beside them, since volumes as stored "
          "need no events, got none");
    }
  }

  std::string settings() const override {
    return representation_
               ? fmt::format("representation {}\n{}seed {}\n", word_, events_.settings(), seed_)
               : "";
  }

  void check(const ExportInput&, const std::function<void()>&) const override {
    if (representation_) events_.open();
  }

  void write_shard(const ExportWork& work, const ExportShard& shard, const ShardReader& reader,
                   ExportFolder::Step& step) const override {
    AtomicFile file(step.file(tar_name(shard)));
    file.create();
    // Some samples at a time: a shard may be large.
    constexpr std::size_t kAtOnce = 16;
    const auto count = static_cast<std::size_t>(reader.header().sample_count);
    for (std::size_t first = 0; first < count; first += kAtOnce) {
      work.check_stop();
      std::array<std::string, kAtOnce> members;
      for_each_index(std::min(kAtOnce, count - first), work.threads, [&](std::size_t i) {
        work.with_sample(shard, reader, static_cast<int>(first + i),
                         [&](const OutgoingSample& sample) {
                           members[i] = tar_member(sample.name + ".npz", arrays_npz(sample)) +
                                        tar_member(sample.name + ".json", labels_json(sample));
                         });
      });
      for (const std::string& member : members) file.write(member);
    }
    file.write(tar_end());
    file.publish();
  }

 private:
  std::string arrays_npz(const OutgoingSample& sample) const {
    Arrays arrays =
        representation_ ? Arrays{{"representation", represented(sample)}} : volume_arrays(sample);
    for (auto& array : flow_arrays(sample)) arrays.push_back(std::move(array));
    return npz_file(arrays);
  }

  /// The .npy file of what the sample's events become; the interval is the pair's.
  std::string represented(const OutgoingSample& sample) const {
    const ImageSize size = sample.reader.header().volume.size;
    const double gap_s = known_gap_s(sample.labels.pair);
    std::vector<Event> events = events_.of(sample, gap_s);
    // A recording's times are rounded where its clock starts long before.
    for (Event& event : events) event.t_s = std::clamp(event.t_s, 0.0, gap_s);
    const int channels = channels_of(*representation_);
    const std::size_t bytes = number_bytes(*representation_);
    std::vector<std::byte> values(static_cast<std::size_t>(std::max(1, channels)) *
                                  size.pixel_count() * bytes);
    represent(events, *representation_, size, std::array{0.0, gap_s}, values);
    return npy_file(bytes == 1 ? "|u1" : "<f4", sides_of(channels, size), values);
  }

  std::uint64_t seed_;
  SampleEvents events_;
  std::optional<Representation> representation_;  ///< none: the volume as stored
  std::string word_;                              ///< its
};

}  // namespace

ExportFormat webdataset_format() {
  return {
      .word = "webdataset",
      .title = "tar files with a .npz and a .json for each sample",
      .need = LabelNeed::kNone,
      .tasks = {"object-detection", "keypoint-detection"},
      .options = {"--counts", "--representation", "--seed"},
      .files = {{"SHARD.tar", "NAME.npz with the events and NAME.json with the labels of samples"}},
      .make = make_exporter<WebdatasetExporter>};
}

}  // namespace eventgan
