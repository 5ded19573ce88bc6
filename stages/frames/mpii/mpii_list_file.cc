#include <array>
#include <fstream>
#include <string>
#include <string_view>

#include "manifests/faults.h"
#include "stages/frames/mpii/mpii_list_file_internal.h"
#include "stages/frames/mpii/mpii_table_internal.h"

namespace eventgan {
namespace {

using Json = nlohmann::ordered_json;

MpiiList read_json_list(std::ifstream& stream, const std::filesystem::path& file) {
  Json rows;
  try {
    rows = Json::parse(stream);
  } catch (const Json::exception& error) {
    throw InputError("expected a JSON list of people or an HDF5 table, got " +
                     std::string(error.what()) + ", in " + file.string());
  }
  if (!rows.is_array()) {
    throw InputError(std::string("expected a JSON list of people, got one ") + rows.type_name() +
                     ", in " + file.string());
  }
  return {MpiiListForm::kJsonList, rows.get<std::vector<Json>>(), {}};
}

}  // namespace

MpiiList read_mpii_list(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  constexpr std::string_view kHdf5 = "\x89HDF\r\n\x1a\n";
  std::array<char, 8> start{};
  if (!stream.read(start.data(), start.size()) && stream.gcount() == 0) {
    throw InputError("expected a JSON list or an HDF5 table, got nothing readable, in " +
                     file.string());
  }
  MpiiList list;
  if (std::string_view(start.data(), start.size()) == kHdf5) {
    stream.close();
    list = read_mpii_table(file);
  } else {
    stream.clear();
    stream.seekg(0);
    list = read_json_list(stream, file);
  }
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
