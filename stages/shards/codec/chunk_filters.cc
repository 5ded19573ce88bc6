#include "stages/shards/codec/chunk_filters.h"

#include <libdeflate.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>

#include "stages/base/processor_clones.h"

namespace eventgan {
namespace {

/// One loop a plane: each is a shift and a narrowing, which become vector instructions. Bytes may
/// alias anything, so the compiler must be told that the planes are not the numbers.
template <class Number>
void split(std::span<const Number> numbers, std::byte* planes, std::size_t plane_size) {
  const Number* __restrict in = numbers.data();
  const std::size_t count = numbers.size();
  for (std::size_t byte = 0; byte < sizeof(Number); ++byte) {
    std::byte* __restrict out = planes + byte * plane_size;
    const int shift = static_cast<int>(8 * byte);
    for (std::size_t i = 0; i < count; ++i) out[i] = static_cast<std::byte>(in[i] >> shift);
  }
}

template <class Number>
void join(const std::byte* planes, std::size_t plane_size, std::span<Number> numbers) {
  Number* __restrict out = numbers.data();
  for (std::size_t byte = 0; byte < sizeof(Number); ++byte) {
    const std::byte* __restrict in = planes + byte * plane_size;
    const int shift = static_cast<int>(8 * byte);
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      const auto part = static_cast<Number>(static_cast<Number>(in[i]) << shift);
      out[i] = byte == 0 ? part : static_cast<Number>(out[i] | part);
    }
  }
}

}  // namespace

EVENTGAN_CLONES void split_into_planes(std::span<const std::uint16_t> numbers, std::byte* planes,
                                       std::size_t plane_size) {
  split(numbers, planes, plane_size);
}

EVENTGAN_CLONES void split_into_planes(std::span<const std::uint32_t> numbers, std::byte* planes,
                                       std::size_t plane_size) {
  split(numbers, planes, plane_size);
}

EVENTGAN_CLONES void join_planes(const std::byte* planes, std::size_t plane_size,
                                 std::span<std::uint16_t> numbers) {
  join(planes, plane_size, numbers);
}

EVENTGAN_CLONES void join_planes(const std::byte* planes, std::size_t plane_size,
                                 std::span<std::uint32_t> numbers) {
  join(planes, plane_size, numbers);
}

Deflater::Deflater(int level) {
  if (level == 1) {
    runs_ = std::make_unique<RunDeflater>();
  } else if (library_.reset(libdeflate_alloc_compressor(level)); !library_) {
    throw std::bad_alloc();
  }
}

void Deflater::FreeLibrary::operator()(libdeflate_compressor* library) const {
  libdeflate_free_compressor(library);
}

Deflater::~Deflater() = default;

std::span<const std::byte> Deflater::deflate(std::span<const std::byte> bytes) {
  const std::size_t bound = runs_ ? RunDeflater::bound(bytes.size())
                                  : libdeflate_zlib_compress_bound(library_.get(), bytes.size());
  if (bytes.size() > std::numeric_limits<std::uint32_t>::max()) {
    throw std::length_error("expected at most 4 GiB to compress, got " +
                            std::to_string(bytes.size()) + " bytes");
  }
  if (room_size_ < bound) {  // not cleared: what is never written to takes no memory
    room_ = std::make_unique_for_overwrite<std::byte[]>(bound);
    room_size_ = bound;
  }
  const std::size_t size = runs_ ? runs_->deflate(bytes, room_.get())
                                 : libdeflate_zlib_compress(library_.get(), bytes.data(),
                                                            bytes.size(), room_.get(), bound);
  if (size == 0) throw std::logic_error("libdeflate broke its own bound");
  return {room_.get(), size};
}

namespace {

static_assert(std::endian::native == std::endian::little, "words are read as they lie in memory");

constexpr std::uint64_t kModulus = 65535;

/// Fletcher's two sums over n 16-bit words w_i, i = 0..n-1.
struct Sums {
  std::uint64_t first = 0;   ///< Σ w_i, exact
  std::uint64_t second = 0;  ///< Σ (n - i) w_i modulo 65535
};

constexpr std::size_t kLanes = 16;
/// With rows r of words w_rl in lanes l, a_l = Σ w_rl and b_l = Σ (rows - r) w_rl <= 65535 rows
/// (rows + 1) / 2: so many rows stay below 2^32.
constexpr std::size_t kRows = 360;

/// Adds rows x kLanes words. Each lane runs Fletcher's recurrence for itself, in vector
/// instructions; word l of row r has weight n - (r kLanes + l) = kLanes (rows - r) - l, so
/// Σ weight w = Σ (kLanes b_l - l a_l).
void add_rows(const std::byte* bytes, std::size_t rows, Sums& sums) {
  std::array<std::uint32_t, kLanes> a{};
  std::array<std::uint32_t, kLanes> b{};
  for (std::size_t row = 0; row < rows; ++row, bytes += 2 * kLanes) {
    std::array<std::uint16_t, kLanes> words;
    std::memcpy(words.data(), bytes, sizeof words);
    for (std::size_t l = 0; l < kLanes; ++l) a[l] += words[l];
    for (std::size_t l = 0; l < kLanes; ++l) b[l] += a[l];
  }
  sums.second += sums.first % kModulus * (rows * kLanes);
  for (std::size_t l = 0; l < kLanes; ++l) {
    sums.first += a[l];
    sums.second += kLanes * std::uint64_t{b[l]} - l * std::uint64_t{a[l]};
  }
  sums.second %= kModulus;
}

/// What is left of a row, an odd last byte being the low half of its little-endian word.
void add_rest(std::span<const std::byte> bytes, Sums& sums) {
  for (std::size_t i = 0; i < bytes.size(); i += 2) {
    sums.first += std::to_integer<std::uint64_t>(bytes[i]);
    if (i + 1 < bytes.size()) sums.first += std::to_integer<std::uint64_t>(bytes[i + 1]) << 8;
    sums.second += sums.first % kModulus;
  }
}

/// The sum over the same words in big endian: swapping the bytes of a 16-bit word multiplies it by
/// 256 modulo 65535 (256 (256 h + l) = 65536 h + 256 l ≡ h + 256 l). HDF5 folds carries in instead
/// of taking remainders, so a multiple of 65535 is stored as 0xffff; only words that are all zero
/// have the sum 0.
std::uint32_t big_endian(std::uint64_t sum, bool all_zero) {
  const auto remainder = static_cast<std::uint32_t>(sum % kModulus * 256 % kModulus);
  return remainder == 0 && !all_zero ? 0xffff : remainder;
}

}  // namespace

std::uint32_t fletcher32(std::span<const std::byte> bytes) {
  Sums sums;
  while (bytes.size() >= 2 * kLanes) {
    const std::size_t rows = std::min(bytes.size() / (2 * kLanes), kRows);
    add_rows(bytes.data(), rows, sums);
    bytes = bytes.subspan(rows * 2 * kLanes);
  }
  add_rest(bytes, sums);
  const bool all_zero = sums.first == 0;
  return big_endian(sums.second, all_zero) << 16 | big_endian(sums.first, all_zero);
}

void append_fletcher32(std::vector<std::byte>& bytes) {
  const std::uint32_t sum = fletcher32(bytes);
  for (int shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<std::byte>(sum >> shift));
}

bool ends_in_fletcher32(std::span<const std::byte> bytes) {
  if (bytes.size() < sizeof(std::uint32_t)) return false;
  const std::size_t size = bytes.size() - sizeof(std::uint32_t);
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i < sizeof sum; ++i) {
    sum |= std::to_integer<std::uint32_t>(bytes[size + i]) << (8 * i);
  }
  return sum == fletcher32(bytes.first(size));
}

}  // namespace eventgan
