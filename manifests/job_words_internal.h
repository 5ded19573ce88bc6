#pragma once

#include <array>
#include <optional>

#include "manifests/engine.h"
#include "manifests/job_manifest.h"
#include "manifests/strict_json/word_internal.h"

namespace eventgan {

// The manifest's words, in the order in which messages list them.

inline constexpr std::array kDatasetWords{
    Word<DatasetKind>{"kitti_object", DatasetKind::kKittiObject},
    Word<DatasetKind>{"kitti_tracking", DatasetKind::kKittiTracking},
    Word<DatasetKind>{"kitti_raw", DatasetKind::kKittiRaw},
    Word<DatasetKind>{"mpii", DatasetKind::kMpii},
    Word<DatasetKind>{"mpii_list", DatasetKind::kMpiiList},
    Word<DatasetKind>{"human36m", DatasetKind::kHuman36m},
    Word<DatasetKind>{"frames", DatasetKind::kFrames}};

inline constexpr std::array kLayoutWords{
    Word<Human36mLayout>{"fetch", Human36mLayout::kFetch},
    Word<Human36mLayout>{"extracted", Human36mLayout::kExtracted}};

inline constexpr std::array kSideWords{Word<PairSide>{"before", PairSide::kBefore},
                                       Word<PairSide>{"after", PairSide::kAfter},
                                       Word<PairSide>{"around", PairSide::kAround}};

inline constexpr std::array kChoiceWords{Word<PairChoice>{"one", PairChoice::kOne},
                                         Word<PairChoice>{"all", PairChoice::kAll}};

inline constexpr std::array kFitWords{Word<ImageFit>{"stretch", ImageFit::kStretch},
                                      Word<ImageFit>{"letterbox", ImageFit::kLetterbox},
                                      Word<ImageFit>{"crop", ImageFit::kCrop}};

inline constexpr std::array kGreyWords{Word<GreyOrder>{"before_resize", GreyOrder::kBeforeResize},
                                       Word<GreyOrder>{"after_resize", GreyOrder::kAfterResize}};

inline constexpr std::array kGeneratorWords{
    Word<GeneratorKind>{"network", GeneratorKind::kNetwork},
    Word<GeneratorKind>{"esim", GeneratorKind::kEsim},
    Word<GeneratorKind>{"difference", GeneratorKind::kDifference}};

inline constexpr std::array kEngineWords{Word<std::optional<Engine>>{"auto", std::nullopt},
                                         Word<std::optional<Engine>>{"torch", Engine::kTorch},
                                         Word<std::optional<Engine>>{"onednn", Engine::kOnednn}};

inline constexpr std::array kPrecisionWords{Word<Precision>{"float32", Precision::kFloat32},
                                            Word<Precision>{"bfloat16", Precision::kBfloat16},
                                            Word<Precision>{"int8", Precision::kInt8}};

inline constexpr std::array kNormalizationWords{
    Word<Normalization>{"none", Normalization::kNone},
    Word<Normalization>{"eta98", Normalization::kEta98}};

inline constexpr std::array kStoredTypeWords{Word<StoredType>{"float32", StoredType::kFloat32},
                                             Word<StoredType>{"float16", StoredType::kFloat16},
                                             Word<StoredType>{"uint8", StoredType::kUint8}};

inline constexpr std::array kPolicyWords{Word<ErrorPolicy>{"fail", ErrorPolicy::kFail},
                                         Word<ErrorPolicy>{"quarantine", ErrorPolicy::kQuarantine}};

}  // namespace eventgan
