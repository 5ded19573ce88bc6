#include <stdexcept>
#include <string>
#include <string_view>

#include "manifests/faults.h"
#include "manifests/strict_json/json_text_internal.h"
#include "stages/files/text_file.h"
#include "stages/frames/mpii/mpii_list_file_internal.h"
#include "stages/frames/mpii/mpii_table_internal.h"

namespace eventgan {
namespace {

using Json = nlohmann::ordered_json;

MpiiList read_json_list(const std::string& text, const std::filesystem::path& file) {
  Json rows;
  try {
    rows = parse_json_data(text, file.filename().string());
  } catch (const std::runtime_error& error) {
    throw InputError("expected a JSON list of people or an HDF5 table, got \"" +
                     std::string(error.what()) + "\", in " + file.string());
  }
  if (!rows.is_array()) {
    throw InputError(std::string("expected a JSON list of people, got one ") + rows.type_name() +
                     ", in " + file.string());
  }
  return {MpiiListForm::kJsonList, rows.get<std::vector<Json>>(), {}};
}

}  // namespace

MpiiList read_mpii_list(const std::filesystem::path& file) {
  constexpr std::string_view kHdf5 = "\x89HDF\r\n\x1a\n";
  std::string reason = "an empty file";
  const auto bytes = try_read_file(file, reason);
  if (!bytes || bytes->empty()) {
    throw InputError("expected a JSON list or an HDF5 table, got nothing readable (" + reason +
                     "), in " + file.string());
  }
  MpiiList list = bytes->starts_with(kHdf5) ? read_mpii_table(file) : read_json_list(*bytes, file);
  const char* const name = image_field(list.form);
  for (std::size_t i = 0; i < list.rows.size(); ++i) {
    const Json& row = list.rows[i];
    if (!row.is_object() || !row.contains(name) || !row[name].is_string() || row[name] == "") {
      throw InputError(std::string("expected an image's name under \"") + name +
                       "\", got none, in " + file.string() + " (row " + std::to_string(i) + ")");
    }
  }
  return list;
}

}  // namespace eventgan
