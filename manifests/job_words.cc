#include "manifests/job_words_internal.h"

namespace eventgan {

std::string_view to_string(DatasetKind kind) { return word_of(kDatasetWords, kind); }
std::string_view to_string(Human36mLayout layout) { return word_of(kLayoutWords, layout); }
std::string_view to_string(PairSide side) { return word_of(kSideWords, side); }
std::string_view to_string(PairChoice choice) { return word_of(kChoiceWords, choice); }
std::string_view to_string(ImageFit fit) { return word_of(kFitWords, fit); }
std::string_view to_string(GreyOrder order) { return word_of(kGreyWords, order); }
std::string_view to_string(GeneratorKind kind) { return word_of(kGeneratorWords, kind); }
std::string_view to_string(Normalization normalization) {
  return word_of(kNormalizationWords, normalization);
}
std::string_view to_string(StoredType type) { return word_of(kStoredTypeWords, type); }
std::string_view to_string(ErrorPolicy policy) { return word_of(kPolicyWords, policy); }

}  // namespace eventgan
