#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <stdexcept>
#include <string_view>

#include "manifests/values/job.h"
#include "manifests/values/recording_formats.h"
#include "manifests/values/simulation.h"
#include "manifests/values/training.h"

namespace eventgan {

/// A value of an enumeration and what a document calls it.
template <class T>
struct Word {
  std::string_view word;
  T value;
};

/// The word for `value`. Throws std::invalid_argument for a value that has none, which only a bad
/// cast can make.
template <class T, std::size_t N>
std::string_view word_of(const std::array<Word<T>, N>& words, T value) {
  for (const Word<T>& entry : words) {
    if (entry.value == value) return entry.word;
  }
  throw std::invalid_argument("expected a value of the enumeration, got another number");
}

/// The value that `word` stands for; none if it is no word of the table.
template <class T, std::size_t N>
constexpr std::optional<T> value_of_word(const std::array<Word<T>, N>& words,
                                         std::string_view word) {
  for (const Word<T>& entry : words) {
    if (entry.word == word) return entry.value;
  }
  return std::nullopt;
}

/// The words of a table whose rows have `word` and `value`, in its order.
template <class Row, std::size_t N>
constexpr auto words_of(const std::array<Row, N>& rows) {
  std::array<Word<decltype(Row::value)>, N> words{};
  for (std::size_t i = 0; i < N; ++i) words[i] = {rows[i].word, rows[i].value};
  return words;
}

// The manifest's words, in the order in which messages list them.

inline constexpr auto kDatasetWords = words_of(kDatasets);

inline constexpr std::array kLayoutWords{
    Word<Human36mLayout>{"fetch", Human36mLayout::kFetch},
    Word<Human36mLayout>{"extracted", Human36mLayout::kExtracted},
    Word<Human36mLayout>{"official", Human36mLayout::kOfficial}};

inline constexpr auto kLabelFormatWords = words_of(kLabelFormats);

/// Where pairs come from.
inline constexpr std::array kPairOriginWords{Word<bool>{"sequence", false},
                                             Word<bool>{"stills", true}};

/// What EventFields::t counts, in seconds.
inline constexpr std::array kTimeUnitWords{Word<double>{"s", 1}, Word<double>{"ms", 1e-3},
                                           Word<double>{"us", 1e-6}, Word<double>{"ns", 1e-9}};

inline constexpr std::array kSideWords{Word<PairSide>{"before", PairSide::kBefore},
                                       Word<PairSide>{"after", PairSide::kAfter},
                                       Word<PairSide>{"around", PairSide::kAround}};

inline constexpr std::array kChoiceWords{Word<PairChoice>{"one", PairChoice::kOne},
                                         Word<PairChoice>{"all", PairChoice::kAll}};

inline constexpr std::array kLabelPlaceWords{Word<LabelPlace>{"end", LabelPlace::kEnd},
                                             Word<LabelPlace>{"middle", LabelPlace::kMiddle}};

inline constexpr std::array kFitWords{Word<ImageFit>{"stretch", ImageFit::kStretch},
                                      Word<ImageFit>{"letterbox", ImageFit::kLetterbox},
                                      Word<ImageFit>{"crop", ImageFit::kCrop}};

inline constexpr std::array kGreyWords{Word<GreyOrder>{"before_resize", GreyOrder::kBeforeResize},
                                       Word<GreyOrder>{"after_resize", GreyOrder::kAfterResize}};

inline constexpr auto kGeneratorWords = words_of(kGenerators);

inline constexpr std::array kEngineWords{Word<std::optional<Engine>>{"auto", std::nullopt},
                                         Word<std::optional<Engine>>{"torch", Engine::kTorch},
                                         Word<std::optional<Engine>>{"onednn", Engine::kOnednn}};

inline constexpr std::array kDeviceWords{Word<Device>{"cpu", Device::kCpu},
                                         Word<Device>{"cuda", Device::kCuda}};

inline constexpr std::array kScopeWords{
    Word<Scope>{"whole", Scope::kWhole}, Word<Scope>{"motion", Scope::kMotion},
    Word<Scope>{"labels", Scope::kLabels}, Word<Scope>{"labels_only", Scope::kLabelsOnly}};
inline constexpr std::array kPrecisionWords{Word<Precision>{"float32", Precision::kFloat32},
                                            Word<Precision>{"bfloat16", Precision::kBfloat16},
                                            Word<Precision>{"int8", Precision::kInt8}};
inline constexpr std::array kPrecisionChoiceWords{
    Word<std::optional<Precision>>{"float32", Precision::kFloat32},
    Word<std::optional<Precision>>{"bfloat16", Precision::kBfloat16},
    Word<std::optional<Precision>>{"int8", Precision::kInt8},
    Word<std::optional<Precision>>{"auto", std::nullopt}};

inline constexpr std::array kNormalizationWords{
    Word<Normalization>{"none", Normalization::kNone},
    Word<Normalization>{"eta98", Normalization::kEta98}};

inline constexpr std::array kStoredTypeWords{Word<StoredType>{"float32", StoredType::kFloat32},
                                             Word<StoredType>{"float16", StoredType::kFloat16},
                                             Word<StoredType>{"uint8", StoredType::kUint8}};

inline constexpr std::array kPolicyWords{Word<ErrorPolicy>{"fail", ErrorPolicy::kFail},
                                         Word<ErrorPolicy>{"quarantine", ErrorPolicy::kQuarantine}};

/// The simulators' words and those of given motion, sorted.
inline constexpr auto kSimulationMethodWords = [] {
  constexpr auto has_word = [](const GeneratorRow& row) { return !row.simulation.empty(); };
  std::array<Word<SimulationMethod>, 2 + std::ranges::count_if(kGenerators, has_word)> words{
      {{"clip", {SimulationMethod::kClip}}, {"stills", {SimulationMethod::kStills}}}};
  std::size_t count = 2;
  for (const GeneratorRow& row : kGenerators) {
    if (has_word(row)) {
      words[count++] = {row.simulation, {SimulationMethod::kSimulator, row.value}};
    }
  }
  std::ranges::sort(words, {}, &Word<SimulationMethod>::word);
  return words;
}();

inline constexpr std::array kSimulatedFileWords{
    Word<SimulatedFile>{"hdf5", SimulatedFile::kHdf5},
    Word<SimulatedFile>{"aedat4", SimulatedFile::kAedat4},
    Word<SimulatedFile>{"raw", SimulatedFile::kRaw}};

// The training manifest's words, in the order in which messages list them.

inline constexpr auto kRecordingFormatWords = words_of(kRecordingFormats);
inline constexpr auto kFrameFormatWords = words_of(kFrameFormats);

inline constexpr std::array kSpectralNormWords{
    Word<SpectralNormPlace>{"decoders", SpectralNormPlace::kDecoders},
    Word<SpectralNormPlace>{"encoders", SpectralNormPlace::kEncoders},
    Word<SpectralNormPlace>{"none", SpectralNormPlace::kNone}};

inline constexpr std::array kTrainingPrecisionWords{
    Word<TrainingPrecision>{"float32", TrainingPrecision::kFloat32},
    Word<TrainingPrecision>{"bfloat16", TrainingPrecision::kBfloat16}};

/// The phases in their order.
inline constexpr std::array kPhaseWords{
    Word<TrainingPhase>{"flow", TrainingPhase::kFlow},
    Word<TrainingPhase>{"reconstruction", TrainingPhase::kReconstruction},
    Word<TrainingPhase>{"generator", TrainingPhase::kGenerator}};

}  // namespace eventgan
