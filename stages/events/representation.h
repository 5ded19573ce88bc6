#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/events.h"

namespace eventgan {

enum class RepresentationKind {
  kVolume,
  kVoxel,
  kNormalizedVoxel,
  kHistogram,
  kCount,
  kTimeSurface,
  kEros
};

/// How events become an array that a network takes.
struct Representation {
  RepresentationKind kind = RepresentationKind::kVolume;
  double number = 0;  ///< B, T, τ or k of its row; 0: it has none
  bool operator==(const Representation&) const = default;
};

/// A row of the table of representations. Equations: events i at pixel (x, y) and time tᵢ, polarity
/// pᵢ = ±1; t₁ and t_N the interval's ends.
struct RepresentationRow {
  RepresentationKind kind;
  std::string_view word;
  std::string_view number;  ///< the symbol of its number, as behind the word's colon; "": none
  std::string_view shape;
  std::string_view dtype;
  std::string_view equation;  ///< with its source
  std::string_view readers;
};

const std::vector<RepresentationRow>& representations();

/// "histogram:10". Throws UsageError for another word, or for a number that is missing or outside
/// 1..64 (B and T), 1e-6..1e6 (τ, seconds) or 1..49 (k, pixels).
Representation parse_representation(std::string_view text);

/// Channels [C, H, W]; 0: the array is [H, W].
int channels_of(const Representation& representation);

/// Bytes of a number: 4, float32, or 1, uint8.
std::size_t number_bytes(const Representation& representation);

/// Writes what the row of `representation` says of the events to `values`, in C order, little
/// endian: max(1, channels) x H x W numbers. t₁ and t_N are `times_s`, or without them the first
/// and the last event's times. No events: zeros. Throws std::invalid_argument for events as
/// event_volume does, and for values of another size. Thread safe.
void represent(std::span<const Event> events, const Representation& representation, ImageSize size,
               const std::optional<std::array<double, 2>>& times_s, std::span<std::byte> values);

/// The exponentially reduced ordinal surface, which keeps what it has seen from one call to the
/// next (EROS of github.com/event-driven-robotics/hpe-core, core/event_representations): an event
/// multiplies the k x k pixels around it by 0.3^(1/k) and sets its own to 255, whatever the time.
/// An even k, 1..49, is the next odd one. Thread safety: one surface is for one thread.
class ErosSurface {
 public:
  ErosSurface(ImageSize size, int kernel);

  /// Throws std::invalid_argument for an event outside the image.
  void add(std::span<const Event> events);

  /// [y, x], rounded, into `image` of as many pixels.
  void write(std::span<std::uint8_t> image) const;

 private:
  static constexpr std::uint8_t kNever = 255;

  ImageSize size_;
  std::size_t kernel_;
  std::size_t stride_;  ///< of a row with half a kernel on both sides
  /// Of each pixel, [y, x] with that border, how many events were around it since its own.
  std::vector<std::uint8_t> since_;
  std::array<std::uint8_t, kNever + 1> greys_{};  ///< what these numbers stand for
};

}  // namespace eventgan
