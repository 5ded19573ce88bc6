#include "pipeline/runtime/errors.h"

#include <sstream>

#include "manifests/values/faults.h"

namespace eventgan {

std::string error_text(const std::exception& error) {
  std::string text = error.what();
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
    const std::size_t start = line.find_first_not_of(' ');
    if (start == std::string::npos) continue;
    text += (text.empty() ? "" : ": ") + line.substr(start);
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
