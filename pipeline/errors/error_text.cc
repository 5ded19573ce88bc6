#include "pipeline/errors/error_text.h"

#include "manifests/faults.h"
#include "pipeline/errors/exit_codes.h"

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

int exit_code_of(const std::exception& error) {
  if (dynamic_cast<const UsageError*>(&error) != nullptr) return kUsage;
  if (dynamic_cast<const TooManyFaults*>(&error) != nullptr) return kTooManyFaults;
  if (dynamic_cast<const InputError*>(&error) != nullptr) return kInputMissing;
  if (dynamic_cast<const Stopped*>(&error) != nullptr) return kStopped;
  return kFailed;
}

}  // namespace eventgan
