#pragma once

#include <cstddef>
#include <string>

#include "manifests/values/job.h"
#include "pipeline/library/eventgan.h"
#include "stages/frames/decoding/prepared_frame.h"

namespace eventgan {

/// Images in a caller's memory, which must be there as long as this is used.
class Images {
 public:
  /// `name`: what messages call it; must outlive this. Throws UsageError if it is none.
  Images(const eventgan_images& given, const char* name);

  std::size_t count() const { return static_cast<std::size_t>(given_.count); }
  ImageSize size() const {
    return {static_cast<int>(given_.height), static_cast<int>(given_.width)};
  }

  /// What prepare_frame makes of image `index`; floating-point numbers are rounded to levels.
  /// Throws UsageError if a number is not in 0..1, or the image cannot be placed.
  PreparedFrame prepared(std::size_t index, const ImageSpec& spec) const;

 private:
  eventgan_images given_;
  const char* name_;
};

/// Two images of a pair, or as many of each.
struct ImagePairs {
  Images previous;
  Images following;

  /// Throws UsageError unless both are images of one size and count.
  ImagePairs(const eventgan_images& first, const eventgan_images& second);
};

}  // namespace eventgan
