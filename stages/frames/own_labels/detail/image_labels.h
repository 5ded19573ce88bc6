#pragma once

#include <optional>
#include <string>
#include <vector>

#include "manifests/values/frames.h"
#include "manifests/values/labels.h"

namespace eventgan {

/// A box and its class by name: which number that is shows once all files are read.
struct NamedBox {
  std::string class_name;
  Box box;  ///< class_id is 0
};

/// What a file says about one image.
struct ImageLabels {
  std::string original;           ///< the file's bytes about it, unchanged
  std::vector<NamedBox> boxes;    ///< pixels of the image, edges (manifests/values/labels.h)
  std::optional<ImageSize> size;  ///< of the image, where the file tells it
};

}  // namespace eventgan
