#include "pipeline/commands/generator_notes.h"

#include <iostream>
#include <string>

#include "pipeline/progress/progress.h"

namespace eventgan {

void tell_generator(const LoadedGenerator& loaded, bool as_json) {
  if (!loaded.choice.empty()) {
    std::cerr << (as_json ? note_json(loaded.choice) : loaded.choice) << std::endl;
  }
  for (const std::string& warning : loaded.warnings) {
    std::cerr << (as_json ? warning_json(warning) : "warning: " + warning) << std::endl;
  }
}

}  // namespace eventgan
