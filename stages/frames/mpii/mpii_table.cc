#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "manifests/faults.h"
#include "stages/archives/hdf5_arrays.h"
#include "stages/archives/typed_array_json_internal.h"
#include "stages/frames/mpii/mpii_table_internal.h"

namespace eventgan {
namespace {

using Json = nlohmann::ordered_json;

/// A name given as an array of characters or of character codes, padded with zeros, as text.
Json joined(Json name) {
  if (!name.is_array()) return name;
  std::string text;
  for (const Json& part : name) {
    if (part.is_string()) text += part.get<std::string>();
    if (part.is_number() && part.get<double>() > 0 && part.get<double>() < 256) {
      text += static_cast<char>(static_cast<unsigned char>(part.get<double>()));
    }
  }
  return text;
}

Hdf5Arrays read_columns(const std::filesystem::path& file) try {
  return read_hdf5_arrays(file);
} catch (const std::runtime_error& error) {
  throw InputError(error.what());
}

}  // namespace

MpiiList read_mpii_table(const std::filesystem::path& file) {
  const Hdf5Arrays content = read_columns(file);
  const std::string image = image_field(MpiiListForm::kTable);
  const auto images = content.arrays.find(image);
  if (images == content.arrays.end() || images->second.size() == 0 ||
      images->second.shape.empty()) {
    const auto unread = content.unread.find(image);
    throw InputError("expected a column " + image + ", got " +
                     (unread == content.unread.end() ? "none" : unread->second) + ", in " +
                     file.string());
  }
  const std::size_t count = images->second.shape[0];
  MpiiList list{MpiiListForm::kTable, std::vector<Json>(count, Json::object()), {}};
  const auto note = [&](const std::string& name, const std::string& got) {
    list.notes.push_back("column " + name + " left out (expected " + std::to_string(count) +
                         " rows of numbers or text, got " + got + "), in " + file.string());
  };
  for (const auto& [name, column] : content.arrays) {
    if (column.shape.empty() || column.shape[0] != count) {
      note(name, column.shape_text());
      continue;
    }
    for (std::size_t i = 0; i < count; ++i) {
      Json value = to_json(column, i);
      list.rows[i][name] = name == image ? joined(std::move(value)) : std::move(value);
    }
  }
  for (const auto& [name, reason] : content.unread) note(name, reason);
  return list;
}

}  // namespace eventgan
