#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "manifests/values/labels.h"
#include "manifests/values/outlines.h"

namespace eventgan {

/// What labels lost (see Annotation).
struct LabelLosses {
  /// How many, and of the first three why.
  struct Reasons {
    std::int64_t count = 0;
    std::vector<std::string> first;

    bool operator==(const Reasons&) const = default;
  };
  Reasons boxes;
  Reasons outlines;  ///< that are without some of their parts
  Reasons tracks;
  std::int64_t of_other_classes = 0;  ///< boxes too

  bool operator==(const LabelLosses&) const = default;
};

/// Of one sample.
LabelLosses losses_of(const Annotation& annotation);

/// What a person should know of the inputs of samples that are valid, of one or of many.
struct InputCounts {
  LabelLosses losses;
  std::int64_t same_images = 0;    ///< pairs of the same image twice
  std::int64_t empty_volumes = 0;  ///< without any event, of other pairs
  OutlineCounts outlines;          ///< of objects that move on their own

  /// Those of samples behind these: the first reasons are those of the sum.
  InputCounts& operator+=(const InputCounts& other);
  /// A line for each kind of which there are any.
  std::vector<std::string> notes() const;
  bool operator==(const InputCounts&) const = default;
};

}  // namespace eventgan
