#pragma once

#include <string>
#include <vector>

#include "manifests/labels.h"
#include "manifests/shard.h"
#include "manifests/volume_labels.h"

namespace eventgan {

/// What a shard's sample holds that its source does not: the annotation's bytes, its boxes and
/// persons exactly; their places in the volume, `mapped`, to a millionth of a pixel, since the last
/// bits may depend on the compiler. Texts "expected X, got Y" in which `place` names the
/// annotation; where the bytes differ, that alone. Empty if all is the same.
std::vector<std::string> label_differences(const ShardSample& stored, const Annotation& source,
                                           const VolumeLabels& mapped, const std::string& place);

}  // namespace eventgan
