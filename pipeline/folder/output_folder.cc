#include "pipeline/folder/output_folder.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <istream>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>
#include <streambuf>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/documents/commit_record.h"
#include "manifests/documents/format_version.h"
#include "manifests/documents/job_manifest.h"
#include "manifests/documents/json_text.h"
#include "manifests/files/atomic_file.h"
#include "manifests/files/input_file.h"
#include "manifests/files/own_file.h"
#include "manifests/files/sha256.h"
#include "manifests/values/faults.h"
#include "pipeline/folder/amendments.h"
#include "pipeline/planning/make_plan.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

constexpr char kPlanName[] = "plan.json";
constexpr char kRunName[] = "run.json";
constexpr char kManifestFolder[] = "manifest_folder";
constexpr char kManifestFolderBytes[] = "manifest_folder_bytes";  // of a name that is not UTF-8

/// plan.json cannot be read to its end, which says nothing of the plan.
class ReadingFailed : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A file that is hashed as it is read: what was parsed and what was hashed are the same bytes, and
/// a large file is read once. To be read through a std::istream; its errors are ReadingFailed
/// naming the path, which the stream passes on if its exceptions include badbit.
class HashedFile : public std::streambuf {
 public:
  explicit HashedFile(const fs::path& file)
      : file_(InputFile::open(file, reason_)), block_(std::size_t{1} << 20) {}

  bool is_open() const { return file_.has_value(); }
  const std::string& why_not() const { return reason_; }

  /// SHA-256 of the file up to where the last block read ends: of the whole file once the stream
  /// has met its end.
  std::string hash_of_read() const { return hash_.hex(); }

 protected:
  int_type underflow() override {
    std::size_t size = 0;
    try {
      size = file_->read_some(offset_, block_);
    } catch (const InputError& error) {
      throw ReadingFailed(error.what());
    }
    if (size == 0) return traits_type::eof();
    offset_ += size;
    hash_.update(std::string_view(block_.data(), size));
    setg(block_.data(), block_.data(), block_.data() + size);
    return traits_type::to_int_type(block_.front());
  }

 private:
  std::string reason_;
  std::optional<InputFile> file_;
  std::uint64_t offset_ = 0;
  std::vector<char> block_;
  Sha256 hash_;
};

class DamagedPlan : public std::runtime_error {
  using runtime_error::runtime_error;
};

/// Reads FOLDER/plan.json with `read` (a stream and a name to a plan, or a part of one).
template <class Frozen, class Read>
Frozen read_plan_file(const fs::path& folder, const Read& read) {
  const fs::path file = folder / kPlanName;
  HashedFile hashed(file);
  if (std::error_code unknown; !hashed.is_open() && fs::exists(file, unknown)) {
    throw std::runtime_error("cannot read " + file.string() + ": " + hashed.why_not());
  }
  if (!hashed.is_open()) {
    throw InputError("expected a folder that eventgan convert has written, got no " +
                     file.string());
  }
  try {
    std::istream stream(&hashed);
    stream.exceptions(std::ios::badbit);  // else an error of reading would pass for the end
    auto plan = read(stream, file.string());
    return {std::move(plan), hashed.hash_of_read()};
  } catch (const ReadingFailed&) {
    throw;  // the file system's trouble, not the plan's: starting again would be the wrong advice
  } catch (const UnreadableVersion&) {
    throw;
  } catch (const std::runtime_error&) {
    std::throw_with_nested(DamagedPlan("expected a whole plan, got a damaged one, in " +
                                       file.string() + " (--overwrite starts again)"));
  }
}

/// plan.json has a line for each pair, two for each shard, and few others.
class PlanLines {
 public:
  PlanLines(const ShowPhase& show_phase, const std::string& name, const Plan& plan)
      : phase_(show_phase, {"lines", /*has_bytes=*/false, name},
               2 * std::ssize(plan.shards) + plan.sample_count()) {}

  void count(std::string_view piece) {
    for (auto lines = std::ranges::count(piece, '\n'); lines > 0; --lines) phase_.advance();
  }

 private:
  Phase phase_;
};

std::string hash_of(const Plan& plan, const ShowPhase& show_phase) {
  Sha256 hash;
  PlanLines lines(show_phase, "comparing the plan:", plan);
  write_plan(plan, [&](std::string_view piece) {
    hash.update(piece);
    lines.count(piece);
  });
  return hash.hex();
}

using Fingerprint = std::map<std::string, std::string>;

/// The fingerprint that the second line of FOLDER/plan.json states, also where the plan is damaged
/// further on; empty if that line is.
Fingerprint stated_fingerprint(const fs::path& folder) {
  const fs::path file = folder / kPlanName;
  HashedFile bytes(file);
  if (!bytes.is_open()) return {};
  std::istream stream(&bytes);
  std::string line;
  std::getline(stream, line);  // format and version
  std::getline(stream, line);
  if (line.ends_with(',')) line.back() = '}';
  line.insert(0, "{");
  FaultList faults(file.string());
  const auto document = parse_json_text(line, faults);
  if (!document || !document->is_object() || !document->contains("fingerprint")) return {};
  try {
    return document->at("fingerprint").get<Fingerprint>();
  } catch (const nlohmann::json::type_error&) {
    return {};
  }
}

/// Whether a field of the fingerprint tells which labelled frames are whose: the job's name, and of
/// each source all but what says how pairs are made of its frames.
bool tells_the_job(std::string_view field) {
  constexpr std::string_view kSource = "manifest $.sources[";
  if (field == "manifest $.name") return true;
  if (!field.starts_with(kSource)) return false;
  const std::string_view key = field.substr(std::min(field.find("].") + 2, field.size()));
  return std::ranges::none_of(
      std::array{"pairs", "window_s", "window_events", "label_at", "every", "frames_per_second",
                 "raw_root", "devkit", "sequences"},
      [&](std::string_view how) { return key.substr(0, key.find('.')) == how; });
}

bool is_same_place(const fs::path& a, const fs::path& b) {
  std::error_code unknown;
  return a.lexically_normal() == b.lexically_normal() || fs::equivalent(a, b, unknown);
}

/// A line for each field by which the job that has frozen its plan in FOLDER is another than that
/// of `now`; none if it is the same, or the plan does not tell. `discards`: where places cannot be
/// compared, what is there must be the same.
std::vector<std::string> job_differences(const fs::path& folder, const Fingerprint& frozen,
                                         const Fingerprint& now, const fs::path& manifest_folder,
                                         bool discards) {
  if (frozen.empty()) return {};
  Fingerprint frozen_job, job;
  const auto of_the_job = [](const auto& field) { return tells_the_job(field.first); };
  std::ranges::copy_if(frozen, std::inserter(frozen_job, frozen_job.end()), of_the_job);
  std::ranges::copy_if(now, std::inserter(job, job.end()), of_the_job);
  const auto frozen_folder = recorded_manifest_folder(folder);
  const bool has_folders = frozen_folder && !manifest_folder.empty();
  bool may_have_moved = !has_folders;
  for (auto& [field, value] : frozen_job) {
    const bool is_path = field.ends_with("].root") || field.ends_with("].annotations");
    const auto other = job.find(field);
    if (!is_path || other == job.end() || !has_folders) continue;
    const auto on_disk = [](const fs::path& start, const std::string& text) {
      const auto path = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
      return start / (path.is_string() ? path.get<std::string>() : text);
    };
    const fs::path was = on_disk(*frozen_folder, value);
    const fs::path is = on_disk(manifest_folder, other->second);
    std::error_code unknown;
    if (is_same_place(was, is)) {
      other->second = value;
    } else if (value == other->second) {
      may_have_moved |= !fs::exists(was, unknown);
      if (may_have_moved) continue;
      value = was.string();
      other->second = is.string();
    }
  }
  // Inputs that are not where they were have moved, or belong to a job whose disk is not there.
  for (const char* content : {"annotations", "frames"}) {
    if (!discards || !may_have_moved || !frozen.contains(content) || !now.contains(content)) {
      continue;
    }
    frozen_job[content] = frozen.at(content);
    job[content] = now.at(content);
  }
  if (limit_of(now) && !limit_of(frozen)) job["limit"] = std::to_string(*limit_of(now));
  return fingerprint_differences(frozen_job, job);
}

void refuse_another_job(const fs::path& folder, const Fingerprint& now,
                        const fs::path& manifest_folder, bool discards) {
  const Fingerprint frozen = stated_fingerprint(folder);
  const auto differences = job_differences(folder, frozen, now, manifest_folder, discards);
  if (differences.empty()) return;
  const auto name = frozen.find("manifest $.name");
  std::string message = "expected the output folder of this job, got that of another job" +
                        (name == frozen.end() ? "" : ", " + name->second) + ", in " +
                        folder.string() +
                        " (choose another output folder, or remove that one yourself):";
  for (const std::string& difference : differences) message += "\n  " + difference;
  throw UsageError(message);
}

/// What to do about a fingerprint that differs: inputs that were mended ask for no new start, which
/// would throw away what all other shards took.
std::string way_out(const Fingerprint& frozen, Fingerprint now) {
  for (const auto& [field, value] : frozen) {
    if (is_amendable(field)) now[field] = value;
  }
  std::erase_if(now, [&](const auto& field) {
    return is_addable(field.first) && !frozen.contains(field.first);
  });
  return frozen == now ? " (if inputs were fixed, `eventgan retry` accepts them and keeps finished "
                         "shards; --overwrite starts again):"
                       : " (--overwrite starts again):";
}

/// Throws UsageError with a line for each field that differs.
void require_same_fingerprint(const fs::path& folder, const Fingerprint& frozen,
                              const Fingerprint& now, const fs::path& manifest_folder) {
  const auto differences = fingerprint_differences(frozen, now);
  if (differences.empty()) return;
  refuse_another_job(folder, now, manifest_folder, /*discards=*/false);
  if (const auto trial = limit_of(frozen); trial && trial != limit_of(now)) {
    throw UsageError(
        fmt::format("expected no trial of this job, got one made with --limit {}, in {} (choose "
                    "another --output, or start again with --overwrite)",
                    *trial, folder.string()));
  }
  std::string message = (folder / kPlanName).string() +
                        " was frozen by a run that would write different bytes" +
                        way_out(frozen, now);
  for (const std::string& difference : differences) message += "\n  " + difference;
  throw UsageError(message);
}

}  // namespace

FrozenPlan read_frozen_plan(const fs::path& folder) {
  return read_plan_file<FrozenPlan>(folder, &read_plan);
}

FrozenOutline read_frozen_outline(const fs::path& folder) {
  return read_plan_file<FrozenOutline>(folder, &read_plan_outline);
}

FrozenPlan freeze_plan(const fs::path& folder, Plan plan, const ShowPhase& show_phase,
                       const fs::path& manifest_folder) {
  const fs::path file = folder / kPlanName;
  std::string hash;
  const bool is_first = create_file_atomically(file, [&](const TextSink& sink) {
    Sha256 hashed;
    PlanLines lines(show_phase, "freezing the plan:", plan);
    write_plan(plan, [&](std::string_view piece) {
      hashed.update(piece);
      sink(piece);
      lines.count(piece);
    });
    hash = hashed.hex();
  });
  if (is_first) return {std::move(plan), hash};
  if (hash.empty()) hash = hash_of(plan, show_phase);  // there was a plan from the start

  const std::string frozen_hash = sha256_of_file(file);
  const std::vector<Amendment> amendments = read_amendments(folder, frozen_hash);
  if (amendments.empty() && hash == frozen_hash) return {std::move(plan), hash};

  FrozenOutline frozen = read_frozen_outline(folder);
  require_same_fingerprint(folder, amended(frozen.plan.fingerprint, amendments), plan.fingerprint,
                           manifest_folder);
  // Inputs that were mended since then may give other samples now (a missing frame that was added):
  // those that were frozen stay.
  if (!amendments.empty()) {
    plan = {};  // a large plan need not be in memory twice
    return read_frozen_plan(folder);
  }
  // The manifest may differ in what does not change bytes, and what was noteworthy beside the
  // inputs may (a file that belongs to nothing); nothing else may.
  plan.manifest_text = std::move(frozen.plan.manifest_text);
  for (std::size_t i = 0; i < std::min(plan.sources.size(), frozen.plan.sources.size()); ++i) {
    plan.sources[i].notes = std::move(frozen.plan.sources[i].notes);
  }
  if (hash_of(plan, show_phase) == frozen.hash) return {std::move(plan), frozen.hash};
  throw UsageError("expected the plan of this manifest and these inputs, got an altered one, in " +
                   file.string() + " (--overwrite starts again)");
}

void require_own_results(const fs::path& folder) {
  for (const auto& [name, kind] :
       {std::pair(kPlanName, OwnFile::kPlan), std::pair(kRunName, OwnFile::kRunRecord),
        std::pair("amendments.json", OwnFile::kAmendments),
        std::pair("plan.index", OwnFile::kEventIndex),
        std::pair(kDescriptionName, OwnFile::kDescription), std::pair(kViewName, OwnFile::kView),
        std::pair("report.html", OwnFile::kReport)}) {
    require_replaceable(folder / name, kind);
  }
}

void require_own_shard(const fs::path& folder, const std::string& shard) {
  const fs::path record = folder / commit_record_name(shard), file = folder / shard;
  if (fs::exists(record) && is_replaceable(record, OwnFile::kCommitRecord)) return;
  require_replaceable(file, OwnFile::kShard);
  // A record that is torn tells nothing of itself: beside a shard of the program it is its own.
  if (!fs::exists(file)) require_replaceable(record, OwnFile::kCommitRecord);
}

namespace {

/// The shards that a folder's plan names; where it is damaged, those that lie there.
std::set<std::string> shards_of(const fs::path& folder) {
  std::set<std::string> shards;
  try {
    for (ShardOutline& shard : read_frozen_outline(folder).plan.shards) {
      shards.insert(std::move(shard.name));
    }
  } catch (const DamagedPlan&) {
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
      const fs::path& file = entry.path();
      const bool is_record = file.extension() == ".json";
      const std::string shard = fs::path(file.filename()).replace_extension(".h5").string();
      if (is_shard_name(shard) && (is_record || file.extension() == ".h5") &&
          is_replaceable(file, is_record ? OwnFile::kCommitRecord : OwnFile::kShard)) {
        shards.insert(shard);
      }
    }
  }
  return shards;
}

}  // namespace

void discard_output(const fs::path& folder, const Fingerprint& fingerprint,
                    const fs::path& manifest_folder) {
  if (!fs::exists(folder / kPlanName)) return;
  refuse_another_job(folder, fingerprint, manifest_folder, /*discards=*/true);
  const std::set<std::string> shards = shards_of(folder);
  // What says that something is whole goes before what it says it of; the plan last, so that after
  // an interruption the next run finds the rest.
  for (const char* name : {kDescriptionName, kViewName, "report.html"}) fs::remove(folder / name);
  for (const std::string& shard : shards) {
    fs::remove(folder / commit_record_name(shard));
    fs::remove(folder / shard);
  }
  fs::remove(folder / "amendments.json");
  fs::remove(folder / kPlanName);
}

bool outdate_dataset(const fs::path& folder, const std::string& shard,
                     const std::string& up_to_date) {
  const fs::path description = folder / kDescriptionName;
  if (!fs::exists(description) || !is_replaceable(description, OwnFile::kDescription)) return false;
  std::string text;
  try {
    text = read_text_file(description);
  } catch (const std::runtime_error&) {
    if (!fs::exists(description)) return false;  // another worker has removed it
  }
  const auto json = nlohmann::json::parse(text, nullptr, false);
  const auto shards = json.is_object() ? json.find("shards") : json.end();
  if (shards != json.end() && shards->is_array() &&
      std::ranges::none_of(*shards, [&](const nlohmann::json& entry) {
        return !entry.is_object() || !entry.contains("name") ||
               (entry.at("name") == shard && (up_to_date.empty() || !entry.contains("sha256") ||
                                              entry.at("sha256") != up_to_date));
      })) {
    return false;
  }
  // The view first: killed in between, the next run finds the description and removes it, too.
  fs::remove(folder / kViewName);
  fs::remove(description);
  return true;
}

void record_manifest_folder(const fs::path& folder, const JobManifest& manifest) {
  const std::string where = manifest.directory.string();
  std::string text;
  try {
    text = nlohmann::json{{kManifestFolder, where}}.dump(2);
  } catch (const nlohmann::json::type_error&) {  // a name that is not UTF-8, as JSON must be
    text = nlohmann::json{{kManifestFolderBytes,
                           std::vector<unsigned char>(where.begin(), where.end())}}
               .dump();
  }
  write_file_atomically(folder / kRunName, text + "\n");
}

namespace {

/// What run.json may say: a program's working folder says nothing of where the inputs are, and the
/// file system would cut a path at a NUL.
std::optional<fs::path> as_manifest_folder(const std::string& path) {
  const bool is_sound = path.starts_with('/') && path.find('\0') == path.npos;
  return is_sound ? std::optional<fs::path>(path) : std::nullopt;
}

}  // namespace

std::optional<fs::path> recorded_manifest_folder(const fs::path& folder) {
  std::string text;
  try {
    text = read_text_file(folder / kRunName);
  } catch (const std::runtime_error&) {  // there is none, as a rule
    return std::nullopt;
  }
  FaultList faults(kRunName);
  const auto json = parse_json_text(text, faults);
  if (!json || !json->is_object()) return std::nullopt;
  try {
    if (json->contains(kManifestFolder)) return as_manifest_folder(json->at(kManifestFolder));
    if (!json->contains(kManifestFolderBytes)) return std::nullopt;
    const auto bytes = json->at(kManifestFolderBytes).get<std::vector<unsigned char>>();
    return as_manifest_folder({bytes.begin(), bytes.end()});
  } catch (const nlohmann::json::type_error&) {  // other values
    return std::nullopt;
  }
}

JobManifest recorded_manifest(const fs::path& folder, const PlanOutline& plan,
                              const std::optional<fs::path>& file) {
  if (file) return read_job_manifest(*file);
  const auto inputs = recorded_manifest_folder(folder);
  if (!inputs) {
    throw UsageError("expected the manifest's folder, an absolute path, got none, in " +
                     (folder / "run.json").string() + " (--manifest FILE says where it is)");
  }
  return parse_job_manifest(plan.manifest_text, *inputs, (folder / "plan.json").string());
}

}  // namespace eventgan
