#include "pipeline/runtime/trace_file.h"

#include <fmt/core.h>

#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <system_error>

#include "manifests/documents/json_text.h"
#include "manifests/files/own_file.h"
#include "manifests/files/unfinished_files.h"
#include "manifests/values/faults.h"

namespace eventgan {

std::string trace_string(std::string_view text) { return dump_json(nlohmann::json(text)); }

std::string trace_microseconds(std::int64_t nanoseconds) {
  return fmt::format("{}.{:03}", nanoseconds / 1000, nanoseconds % 1000);
}

namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse(const std::string& expected, const std::string& got,
                         const fs::path& file) {
  throw UsageError("--profile: expected " + expected + ", got " + got + ", in " + file.string());
}

/// Where a trace goes that is told to go to `target`: behind links.
fs::path checked_target(const fs::path& target) {
  if (target.filename().empty()) refuse("a file", "a folder or nothing", target);
  std::error_code error;  // of a file that is not there yet
  const fs::file_status status = fs::status(target, error);
  if (!fs::exists(status)) return target;
  if (!fs::is_regular_file(status)) refuse("a file", "something else", target);
  if (!is_replaceable(target, OwnFile::kTrace)) {
    refuse("a new file or an earlier trace", "another file", target);
  }
  const fs::path behind_links = fs::canonical(target, error);
  return error ? target : behind_links;
}

}  // namespace

TraceFile::TraceFile(const fs::path& target) : file_(checked_target(target)) {
  const fs::path& trace = file_.target();
  try {
    const fs::path folder = trace.has_parent_path() ? trace.parent_path() : fs::path(".");
    remove_stale_temporaries(folder, trace.filename().native());
  } catch (const std::runtime_error&) {
    // Whether a trace can be written is what counts; that is tried next.
  }
  try {
    file_.create();
  } catch (const std::system_error& error) {
    refuse("a file that can be written", error.code().message(), trace);
  }
}

void TraceFile::write(std::string_view text) {
  try {
    file_.write(text);
  } catch (const std::system_error& error) {
    throw_system_error("cannot write " + file_.target().string(), error.code().value());
  }
}

}  // namespace eventgan
