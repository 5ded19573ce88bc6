#pragma once

#include <cstddef>
#include <memory>
#include <span>

namespace eventgan {

/// Compresses bytes that are mostly zero into zlib's format (RFC 1950 and 1951), which any inflater
/// reads. All that it looks for is runs of zeros: they become matches of distance 1, every other
/// byte a literal. The planes of a volume's numbers have little else that repeats, and some tens of
/// thousands of literals at a time have codes of their own, so the result is smaller than that of a
/// search for matches, in a fraction of the time. What comes out depends on the bytes alone. Thread
/// safety: one thread at a time.
class RunDeflater {
 public:
  RunDeflater();
  ~RunDeflater();
  RunDeflater(const RunDeflater&) = delete;
  RunDeflater& operator=(const RunDeflater&) = delete;

  /// How many bytes `deflate` may write in between for so many; in the end, where they get no
  /// smaller, they are stored.
  static std::size_t bound(std::size_t bytes);

  /// Writes into `room`, of `bound(bytes.size())` bytes; returns the size of the result.
  std::size_t deflate(std::span<const std::byte> bytes, std::byte* room);

 private:
  struct Codes;
  std::unique_ptr<Codes> codes_;
};

}  // namespace eventgan
