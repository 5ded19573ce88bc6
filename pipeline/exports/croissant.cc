#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>

#include "manifests/documents/json_text.h"
#include "manifests/files/sha256.h"
#include "pipeline/exports/detail/dataset_card.h"

namespace eventgan {
namespace {

using Json = nlohmann::ordered_json;

/// The context that the specification recommends.
constexpr char kContext[] = R"({
  "@language": "en", "@vocab": "https://schema.org/", "citeAs": "cr:citeAs", "column": "cr:column",
  "conformsTo": "dct:conformsTo", "cr": "http://mlcommons.org/croissant/",
  "data": {"@id": "cr:data", "@type": "@json"},
  "dataType": {"@id": "cr:dataType", "@type": "@vocab"}, "dct": "http://purl.org/dc/terms/",
  "examples": {"@id": "cr:examples", "@type": "@json"}, "extract": "cr:extract",
  "field": "cr:field", "fileObject": "cr:fileObject", "fileProperty": "cr:fileProperty",
  "fileSet": "cr:fileSet", "format": "cr:format", "includes": "cr:includes",
  "isLiveDataset": "cr:isLiveDataset", "jsonPath": "cr:jsonPath", "key": "cr:key",
  "md5": "cr:md5", "parentField": "cr:parentField", "path": "cr:path",
  "recordSet": "cr:recordSet", "references": "cr:references", "regex": "cr:regex",
  "repeated": "cr:repeated", "replace": "cr:replace", "sc": "https://schema.org/",
  "separator": "cr:separator", "source": "cr:source", "subField": "cr:subField",
  "transform": "cr:transform"})";

constexpr char kSplits[] = "splits";

constexpr std::array<std::pair<std::string_view, std::string_view>, 8> kEncodings{
    {{".png", "image/png"},
     {".txt", "text/plain"},
     {".json", "application/json"},
     {".yaml", "application/yaml"},
     {".h5", "application/x-hdf5"},
     {".hdf5", "application/x-hdf5"},
     {".npz", "application/zip"},
     {".tar", "application/x-tar"}}};

std::string_view encoding_of(std::string_view name) {
  const auto known = std::ranges::find_if(
      kEncodings, [&](const auto& encoding) { return name.ends_with(encoding.first); });
  return known == kEncodings.end() ? "application/octet-stream" : known->second;
}

Json reference(const std::string& id) { return {{"@id", id}}; }

std::string lower(std::string_view word) {
  std::string text(word);
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

std::string for_regex(char c) {
  if (c == '[') return "(?:";
  if (c == ']') return ")?";
  return std::string_view(".^$*+?(){}|\\").find(c) == std::string_view::npos
             ? std::string(1, c)
             : std::string("\\") + c;
}

/// The record sets of a kind of files.
class RecordSets {
 public:
  RecordSets(const FilesOfKind& files, std::string file_set)
      : files_(files), file_set_(std::move(file_set)) {}

  std::vector<Json> all() const {
    std::vector<Json> sets;
    const std::string_view name = files_.kind->name;
    for (const ExportRecords& records : files_.kind->records) {
      const std::string list = records.list.empty() ? "records" : std::string(records.list);
      sets.push_back(with_columns(list + "-of-" + file_set_, records, name.ends_with(".json")));
    }
    if (!sets.empty()) return sets;
    const bool is_image = name.ends_with(".png");
    const std::string id = "files-of-" + file_set_;
    Json set = empty_set(id);
    set["field"].push_back(field(id, is_image ? "image" : "path",
                                 is_image ? "sc:ImageObject" : "sc:Text",
                                 {{"fileProperty", is_image ? "content" : "fullpath"}}));
    return {set};
  }

 private:
  Json field(const std::string& set, const std::string& name, const std::string& type, Json extract,
             const std::string& regex = {}) const {
    Json source = {{"fileSet", reference(file_set_)}, {"extract", std::move(extract)}};
    if (!regex.empty()) source["transform"] = {{"regex", regex}};
    return {{"@type", "cr:Field"},
            {"@id", set + "/" + name},
            {"name", set + "/" + name},
            {"dataType", type},
            {"source", std::move(source)}};
  }

  /// With a field for each part of the files' names.
  Json empty_set(const std::string& id) const {
    Json set = {{"@type", "cr:RecordSet"}, {"@id", id}, {"name", id}};
    if (!files_.kind->what.empty()) set["description"] = std::string(files_.kind->what);
    set["field"] = Json::array();
    std::vector<std::string_view> parts;  // but those that may be missing
    bool is_optional = false;
    spelled(
        files_.kind->name,
        [&](std::string_view part) {
          if (!is_optional) parts.push_back(part);
          return "";
        },
        [&](char c) {
          if (c == '[' || c == ']') is_optional = c == '[';
          return "";
        });
    for (const std::string_view part : parts) {
      const bool is_split = part == "SPLIT";
      const auto any = [&](std::string_view word) -> std::string {
        if (word != part) return "[^/]+";
        if (!is_split) return "([^/]+)";
        std::string names;
        for (const auto& [split, ignored] : files_.by_split) {
          if (!names.empty()) names += '|';
          for (const char c : split) names += for_regex(c);
        }
        return "(" + names + ")";
      };
      Json of_name = field(id, lower(part), "sc:Text", {{"fileProperty", "fullpath"}},
                           "^" + spelled(files_.kind->name, any, for_regex) + "$");
      if (is_split) of_name["references"] = {{"field", reference(kSplits + std::string("/name"))}};
      set["field"].push_back(std::move(of_name));
    }
    return set;
  }

  Json with_columns(const std::string& id, const ExportRecords& records, bool is_json) const {
    Json set = empty_set(id);
    std::vector<std::pair<std::string, std::string>> columns;
    std::istringstream words{std::string(records.columns)};
    for (std::string word; words >> word;) {
      const std::size_t colon = word.find(':');
      columns.emplace_back(word.substr(0, colon), word.substr(colon + 1));
    }
    for (std::size_t i = 0; i < columns.size(); ++i) {
      auto [name, type] = columns[i];
      const bool is_repeated = type.ends_with('*');
      if (is_repeated) type.pop_back();
      const bool is_box = type == "BoundingBox";
      const std::string type_name = (is_box ? "cr:" : "sc:") + type;
      Json made;
      if (is_json) {
        const std::string list = records.list.empty() ? "$" : "$." + std::string(records.list);
        made = field(id, name, type_name, {{"jsonPath", list + "[*]." + name}});
      } else {
        const bool is_rest = i + 1 == columns.size() && type == "Text";
        made = field(id, name, type_name, {{"fileProperty", "lines"}},
                     "^" + (i == 0 ? "" : fmt::format("(?:\\S+\\s+){{{}}}", i)) +
                         (is_rest ? "(.+)$" : "(\\S+)"));
      }
      if (is_box) made["source"]["format"] = "XYWH";
      if (is_repeated) made["repeated"] = true;
      set["field"].push_back(std::move(made));
    }
    return set;
  }

  const FilesOfKind& files_;
  std::string file_set_;
};

}  // namespace

std::string croissant_text(const ExportWork& work, const ExportFormat& format,
                           const std::vector<FilesOfKind>& files, const std::string& licence) {
  Json distribution = Json::array();
  Json sets = Json::array();
  Json splits = Json::array();
  for (const std::string& split : work.input.splits()) splits.push_back({{"splits/name", split}});
  sets.push_back({{"@type", "cr:RecordSet"},
                  {"@id", kSplits},
                  {"name", kSplits},
                  {"dataType", "cr:Split"},
                  {"key", reference("splits/name")},
                  {"field", Json::array({{{"@type", "cr:Field"},
                                          {"@id", "splits/name"},
                                          {"name", "splits/name"},
                                          {"dataType", "sc:Text"}}})},
                  {"data", std::move(splits)}});
  for (const FilesOfKind& of_kind : files) {
    const std::string_view name = of_kind.kind->name;
    const std::string id = spelled(
        name, [](std::string_view word) { return std::string(word); },
        [](char c) {
          return c == '[' || c == ']' ? std::string() : std::string(1, c == '/' ? '-' : c);
        });
    std::vector<std::string> includes;
    for (const auto& [split, names] : of_kind.by_split) {
      includes.insert(includes.end(), names.begin(), names.end());
    }
    const bool is_file = includes == std::vector{std::string(name)};
    Json resource = {
        {"@type", is_file ? "cr:FileObject" : "cr:FileSet"}, {"@id", id}, {"name", id}};
    if (!of_kind.kind->what.empty()) resource["description"] = std::string(of_kind.kind->what);
    resource["encodingFormat"] = std::string(encoding_of(name));
    if (is_file) {
      const std::filesystem::path path = work.folder.path() / name;
      resource["contentUrl"] = id;
      resource["contentSize"] = fmt::format("{} B", std::filesystem::file_size(path));
      resource["sha256"] = sha256_of_file(path);
    } else {
      resource["includes"] = includes;
      for (Json& set : RecordSets(of_kind, id).all()) sets.push_back(std::move(set));
    }
    distribution.push_back(std::move(resource));
  }
  Json dataset = {
      {"@context", Json::parse(kContext)},
      {"@type", "sc:Dataset"},
      {"conformsTo", "http://mlcommons.org/croissant/1.0"},
      {"name", work.input.name()},
      {"description", "Data for event cameras, made by eventgan: " + std::string(format.title)},
      {"keywords", Json::array({"event camera", "eventgan", std::string(format.word)})}};
  if (!licence.empty()) {
    std::string spdx = licence;
    std::ranges::transform(spdx, spdx.begin(), [](unsigned char c) { return std::toupper(c); });
    dataset["license"] = "https://spdx.org/licenses/" + spdx;
  }
  dataset["distribution"] = std::move(distribution);
  dataset["recordSet"] = std::move(sets);
  return dump_json(dataset, JsonLayout::kIndented) + "\n";
}

}  // namespace eventgan
