#include "pipeline/commands/generator_notes.h"

#include "pipeline/commands/standard_streams.h"

namespace eventgan {

void tell_generator(const LoadedGenerator& loaded) {
  if (!loaded.choice.empty()) tell(loaded.choice);
  for (const std::string& warning : loaded.warnings) tell_warning(warning);
}

}  // namespace eventgan
