#pragma once

#include <array>

#include "manifests/strict_json/word_internal.h"
#include "manifests/training_manifest.h"

namespace eventgan {

// The training manifest's words, in the order in which messages list them.

inline constexpr std::array kRecordingFormatWords{
    Word<RecordingFormat>{"mvsec", RecordingFormat::kMvsec},
    Word<RecordingFormat>{"eventgan", RecordingFormat::kEventgan},
    Word<RecordingFormat>{"ecd", RecordingFormat::kEcd}};

inline constexpr std::array kSpectralNormWords{
    Word<SpectralNormPlace>{"decoders", SpectralNormPlace::kDecoders},
    Word<SpectralNormPlace>{"encoders", SpectralNormPlace::kEncoders},
    Word<SpectralNormPlace>{"none", SpectralNormPlace::kNone}};

inline constexpr std::array kPrecisionWords{
    Word<TrainingPrecision>{"float32", TrainingPrecision::kFloat32},
    Word<TrainingPrecision>{"bfloat16", TrainingPrecision::kBfloat16}};

inline constexpr std::array kPhaseWords{
    Word<TrainingPhase>{"flow", TrainingPhase::kFlow},
    Word<TrainingPhase>{"reconstruction", TrainingPhase::kReconstruction},
    Word<TrainingPhase>{"generator", TrainingPhase::kGenerator}};

}  // namespace eventgan
