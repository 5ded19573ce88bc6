#include "manifests/values/words.h"

namespace eventgan {

std::string_view to_string(Precision precision) { return word_of(kPrecisionWords, precision); }

std::string_view to_string(Engine engine) {
  return word_of(kEngineWords, std::optional<Engine>(engine));
}
std::string_view to_string(Device device) { return word_of(kDeviceWords, device); }

std::string_view to_string(DatasetKind kind) { return word_of(kDatasetWords, kind); }
std::string_view to_string(Human36mLayout layout) { return word_of(kLayoutWords, layout); }
std::string_view to_string(LabelFormat format) { return word_of(kLabelFormatWords, format); }
std::string_view to_string(PairSide side) { return word_of(kSideWords, side); }
std::string_view to_string(PairChoice choice) { return word_of(kChoiceWords, choice); }
std::string_view to_string(LabelPlace place) { return word_of(kLabelPlaceWords, place); }
std::string_view to_string(ImageFit fit) { return word_of(kFitWords, fit); }
std::string_view to_string(GreyOrder order) { return word_of(kGreyWords, order); }
std::string_view to_string(GeneratorKind kind) { return word_of(kGeneratorWords, kind); }
std::string_view to_string(Scope scope) { return word_of(kScopeWords, scope); }
std::string_view to_string(Normalization normalization) {
  return word_of(kNormalizationWords, normalization);
}
std::string_view to_string(StoredType type) { return word_of(kStoredTypeWords, type); }
std::string_view to_string(ErrorPolicy policy) { return word_of(kPolicyWords, policy); }

std::string_view to_string(SimulationMethod method) {
  return word_of(kSimulationMethodWords, method);
}
std::string_view to_string(SimulatedFile file) { return word_of(kSimulatedFileWords, file); }

std::string_view to_string(RecordingFormat format) {
  return word_of(kRecordingFormatWords, format);
}
std::string_view to_string(SpectralNormPlace place) { return word_of(kSpectralNormWords, place); }
std::string_view to_string(TrainingPrecision precision) {
  return word_of(kTrainingPrecisionWords, precision);
}
std::string_view to_string(TrainingPhase phase) { return word_of(kPhaseWords, phase); }

}  // namespace eventgan
