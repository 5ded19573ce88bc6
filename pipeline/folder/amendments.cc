#include "pipeline/folder/amendments.h"

#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "manifests/documents/report.h"
#include "manifests/documents/strict_json.h"
#include "manifests/files/atomic_file.h"
#include "manifests/files/file_lock.h"
#include "manifests/files/input_file.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

constexpr char kName[] = "amendments.json";
constexpr char kFormat[] = "eventgan-amendments";
constexpr int kVersion = 1;

struct Document {
  std::string plan_hash;
  std::vector<Amendment> amendments;
};

Amendment read_amendment(const StrictValue& value) {
  Amendment amendment;
  StrictObject object = value.object();
  for (const auto& [field, text] : object.at("fields").members()) {
    // Anything else would let another job's output pass as this one's.
    if (!is_amendable(field) && !is_addable(field)) {
      text.fault("fields that may change: annotations, frames, labels", field);
    }
    amendment.fields[field] = text.text();
  }
  for (const StrictValue& sample : object.at("samples").elements()) {
    amendment.samples.push_back(sample.text());
  }
  object.finish();
  return amendment;
}

Document parse_document(const std::string& text, const std::string& name) {
  Document document;
  FaultList faults(name);
  if (const auto json = parse_json_text(text, faults)) {
    StrictObject object = StrictValue(*json, faults).object();
    if (object.has_format(kFormat, kVersion)) {
      document.plan_hash = object.at("plan_hash").text();
      for (const StrictValue& element : object.at("amendments").elements()) {
        document.amendments.push_back(read_amendment(element));
      }
      object.finish();
    }
  }
  if (!faults.empty()) throw std::runtime_error(faults.text());
  return document;
}

}  // namespace

bool is_amendable(const std::string& fingerprint_field) {
  return fingerprint_field == "frames" || fingerprint_field == "annotations";
}

bool is_addable(const std::string& fingerprint_field) {
  return fingerprint_field.starts_with("labels ");
}

std::vector<Amendment> read_amendments(const fs::path& folder, const std::string& plan_hash) {
  const fs::path file = folder / kName;
  if (!fs::exists(file)) return {};
  Document document = parse_document(read_text_file(file), file.string());
  // What a folder's earlier plan was amended by says nothing about this one.
  if (document.plan_hash != plan_hash) return {};
  return std::move(document.amendments);
}

void record_amendment(const fs::path& folder, const std::string& plan_hash,
                      const Amendment& amendment) {
  for (const auto& [field, value] : amendment.fields) {
    if (is_amendable(field) || is_addable(field)) continue;
    throw std::invalid_argument("this field may not change: " + field);
  }
  // Of two that read amendments in order to add one, the one that wrote last would drop the
  // other's.
  const FileLock lock(folder, FileLock::IfTaken::kWait);
  std::vector<Amendment> all = read_amendments(folder, plan_hash);
  if (!all.empty() && all.back() == amendment) return;  // by another who found the same
  all.push_back(amendment);
  const nlohmann::json json = {
      {"format", kFormat},
      {"version", kVersion},
      {"plan_hash", plan_hash},
      {"amendments", json_list(all, [](const Amendment& one) -> nlohmann::json {
         return {{"fields", one.fields}, {"samples", one.samples}};
       })}};
  write_file_atomically(folder / kName, dump_json(json, JsonLayout::kIndented) + "\n");
}

std::map<std::string, std::string> amended(std::map<std::string, std::string> fingerprint,
                                           const std::vector<Amendment>& amendments) {
  for (const Amendment& amendment : amendments) {
    for (const auto& [field, value] : amendment.fields) {
      fingerprint.insert_or_assign(field, value);
    }
  }
  return fingerprint;
}

}  // namespace eventgan
