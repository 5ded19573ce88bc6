#include "manifests/engine.h"

#include "manifests/job_words_internal.h"

namespace eventgan {

std::string_view to_string(Precision precision) { return word_of(kPrecisionWords, precision); }

std::string_view to_string(Engine engine) {
  return word_of(kEngineWords, std::optional<Engine>(engine));
}

}  // namespace eventgan
