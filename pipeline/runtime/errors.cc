#include "pipeline/runtime/errors.h"

#include <cerrno>
#include <new>
#include <sstream>
#include <system_error>

#include "manifests/values/faults.h"

namespace eventgan {
namespace {

/// The library's own words for a limit of the process say neither what it is nor what helps.
std::string words_of(const std::exception& error) {
  if (dynamic_cast<const std::bad_alloc*>(&error) != nullptr) {
    return "expected enough memory, got none (fewer --threads need less; ulimit -v sets a limit)";
  }
  const auto* of_system = dynamic_cast<const std::system_error*>(&error);
  if (of_system != nullptr && of_system->code().value() == EAGAIN &&
      of_system->what() == of_system->code().message()) {
    return "expected to begin a thread, got '" + of_system->code().message() +
           "' (fewer --threads; ulimit -u sets a limit)";
  }
  return error.what();
}

}  // namespace

std::string error_text(const std::exception& error) {
  std::string text = words_of(error);
  try {
    std::rethrow_if_nested(error);
  } catch (const std::exception& nested) {
    text += "\n  because: " + error_text(nested);
  }
  return text;
}

std::string error_line(const std::exception& error) {
  std::istringstream lines(error_text(error));
  std::string text;
  for (std::string line; std::getline(lines, line);) {
    constexpr std::string_view kBecause = "because: ";
    const std::size_t start = line.find_first_not_of(' ');
    if (start == std::string::npos) continue;
    line.erase(0, start);
    if (line.starts_with(kBecause)) line.erase(0, kBecause.size());
    text += (text.empty() ? "" : text.ends_with(':') ? " " : ": ") + line;
  }
  return text;
}

int exit_code_of(const std::exception& error) {
  if (dynamic_cast<const UsageError*>(&error) != nullptr) return kUsage;
  if (dynamic_cast<const TooManyFaults*>(&error) != nullptr) return kTooManyFaults;
  if (dynamic_cast<const InputError*>(&error) != nullptr) return kInputMissing;
  if (dynamic_cast<const Stopped*>(&error) != nullptr) return kStopped;
  return kFailed;
}

}  // namespace eventgan
