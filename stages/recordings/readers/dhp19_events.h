#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "manifests/values/events.h"

namespace eventgan {

inline constexpr int kDhp19Cameras = 4;
inline constexpr ImageSize kDhp19Size{260, 346};

/// Events of a recording of DHP19 in an HDF5 file: groups cam0 .. cam3, each with timeStamp (µs),
/// x, y and polarity, numbers of any type, [1, N], [N, 1] or [N]. x is 0..345 and y 0..259 from the
/// top left pixel, polarity of {0, 1} or {-1, 1}. Only what is asked for is read. Thread safe.
///
/// Times are in seconds since the first event of the four cameras, at which the poses start.
class Dhp19Events {
 public:
  /// Throws InputError, cause nested.
  explicit Dhp19Events(const std::filesystem::path& path);
  ~Dhp19Events();
  Dhp19Events(Dhp19Events&&) noexcept;

  std::int64_t count(int camera) const;

  /// Time of one event, in 0..count-1. Throws InputError if it is not finite.
  double time_s(int camera, std::int64_t event) const;

  /// The events first .. first + count - 1 of a camera, which there must be. Throws InputError
  /// where they are malformed: times that fall, pixels outside the image, values that are not
  /// finite.
  std::vector<Event> events(int camera, std::int64_t first, std::int64_t count) const;

 private:
  struct File;
  std::unique_ptr<File> file_;
};

}  // namespace eventgan
