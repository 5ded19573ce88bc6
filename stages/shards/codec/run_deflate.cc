#include "stages/shards/codec/run_deflate.h"

#include <isa-l/igzip_lib.h>
#include <libdeflate.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>

#include "stages/base/processor_clones.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace eventgan {
namespace {

constexpr std::size_t kStep = std::size_t{1} << 18;     // bytes that are looked at together
constexpr std::size_t kEnough = std::size_t{1} << 16;   // literals for codes of their own
constexpr std::size_t kLargest = std::size_t{1} << 24;  // block: a literal's place has 24 bits
constexpr std::size_t kHeader = 512;                    // more than a block's codes and end take
constexpr std::size_t kStored = 65535;                  // the most that a stored block holds
constexpr std::size_t kLongest = 258;                   // match
constexpr std::size_t kRun = kLongest + 1;              // a zero and the longest match after it

}  // namespace

namespace run_deflate {  // not without a name: Codes, which the header knows, is made of these

/// Bits as they lie in a stream, the first one lowest.
struct Bits {
  std::uint64_t bits = 0;
  unsigned count = 0;

  void append(const Bits& more) {
    bits |= more.bits << count;
    count += more.count;
  }
};

/// Writes bits to memory, eight bytes at a time: those that are not whole yet are written again.
class BitWriter {
 public:
  static constexpr unsigned kMost = 56;  ///< bits at once

  explicit BitWriter(std::byte* out) : out_(out) {}

  void write(const Bits& more) {
    pending_.append(more);
    std::memcpy(out_, &pending_.bits, sizeof pending_.bits);
    const unsigned whole = pending_.count / 8;
    out_ += whole;
    pending_ = {pending_.bits >> 8 * whole, pending_.count % 8};
  }

  const std::byte* begun() const { return out_; }

  /// Where the next byte lies, after the one that was begun.
  std::byte* next_byte() {
    write({0, (8 - pending_.count) % 8});
    return out_;
  }
  void copy(std::span<const std::byte> bytes) { out_ = std::ranges::copy(bytes, next_byte()).out; }

 private:
  static_assert(std::endian::native == std::endian::little, "bits are written as words");

  std::byte* out_;
  Bits pending_;  ///< fewer than 8 between calls
};

}  // namespace run_deflate

namespace {

using run_deflate::Bits;
using run_deflate::BitWriter;

/// A byte that is not zero, below its place in its block: a list of them is all there is to know of
/// the block.
using Literal = std::uint32_t;

std::size_t place_of(Literal literal) { return literal >> 8; }
std::size_t value_of(Literal literal) { return literal & 0xff; }

/// Bit i tells whether bytes[i] is not zero.
std::uint64_t nonzero_of_64(const std::byte* bytes) {
  std::uint64_t nonzero = 0;
#if defined(__x86_64__)
  for (int i = 0; i < 4; ++i) {
    const __m128i some = _mm_loadu_si128(reinterpret_cast<const __m128i*>(bytes) + i);
    const int zeros = _mm_movemask_epi8(_mm_cmpeq_epi8(some, _mm_setzero_si128()));
    nonzero |= static_cast<std::uint64_t>(static_cast<std::uint16_t>(~zeros)) << (16 * i);
  }
#else
  for (int i = 0; i < 64; ++i) nonzero |= std::uint64_t{bytes[i] != std::byte{0}} << i;
#endif
  return nonzero;
}

constexpr int kAtOnce = 16;

/// Adds the literals of a block from a place on to `found`, which has room for kStep + kAtOnce
/// more;
/// returns where the next one goes. Some are taken at once, needed or not: a loop that ends with
/// the last one of each 64 bytes is hard to predict.
EVENTGAN_CLONES Literal* find_rest(std::span<const std::byte> block, std::size_t place,
                                   Literal* found) {
  const auto take = [&](const std::byte* bytes) {
    std::uint64_t nonzero = nonzero_of_64(bytes);
    const int count = std::popcount(nonzero);
    for (int done = 0; done < count; done += 4) {
      for (int i = 0; i < 4; ++i, nonzero &= nonzero - 1) {
        const int here = std::countr_zero(nonzero) & 63;
        found[done + i] =
            static_cast<Literal>(place + here) << 8 | std::to_integer<Literal>(bytes[here]);
      }
    }
    found += count;
  };
  for (; place + 64 <= block.size(); place += 64) take(block.data() + place);
  std::array<std::byte, 64> rest{};
  std::ranges::copy(block.subspan(place), rest.begin());
  take(rest.data());
  return found;
}

#if defined(__x86_64__)
/// The same for all whole 64 bytes; `place` is then after these.
__attribute__((target("avx512f,popcnt"))) Literal* find_with_avx512(
    std::span<const std::byte> block, std::size_t& place, Literal* found) {
  std::array<Literal, 16> first;
  for (Literal i = 0; i < 16; ++i) first[i] = static_cast<Literal>(place + i) << 8;
  __m512i places = _mm512_loadu_si512(first.data());
  const __m512i step = _mm512_set1_epi32(16 << 8);
  for (; place + 64 <= block.size(); place += 64) {
    const std::byte* const here = block.data() + place;
    const __m512i all = _mm512_loadu_si512(here);
    if (_mm512_test_epi32_mask(all, all) == 0) {
      places = _mm512_add_epi32(places, _mm512_set1_epi32(64 << 8));
      continue;
    }
    for (int i = 0; i < 64; i += 16, places = _mm512_add_epi32(places, step)) {
      const __m512i bytes = _mm512_maskz_cvtepu8_epi32(
          0xffff, _mm_loadu_si128(reinterpret_cast<const __m128i*>(here + i)));
      const __mmask16 nonzero = _mm512_test_epi32_mask(bytes, bytes);
      const __m512i some = _mm512_maskz_compress_epi32(nonzero, _mm512_or_si512(bytes, places));
      _mm512_storeu_si512(found, some);
      found += std::popcount(static_cast<unsigned>(nonzero));
    }
  }
  return found;
}

const bool kHasAvx512 = __builtin_cpu_supports("avx512f");
#endif

/// All that there are from a place on; returns how many.
std::size_t find_literals(std::span<const std::byte> block, std::size_t place, Literal* found) {
  Literal* end = found;
#if defined(__x86_64__)
  if (kHasAvx512) end = find_with_avx512(block, place, end);
#endif
  return static_cast<std::size_t>(find_rest(block, place, end) - found);
}

/// The symbol of a match's length, 3..258 (RFC 1951, 3.2.5): 8 lengths have one each, then four
/// symbols stand for 2 lengths each, four for 4, and so on; the longest has one of its own.
std::size_t length_symbol(std::size_t length) {
  if (length == kLongest) return 285;
  const std::size_t from = length - 3;
  if (from < 8) return 257 + from;
  const std::size_t extra_bits = std::bit_width(from) - 3;
  return 257 + 4 * extra_bits + (from >> extra_bits);
}

/// How a run of zeros is written: run(zeros) for what has an entry in Codes::runs, longest() for a
/// longest match between two of these.
template <class Run, class Longest>
void split_run(std::size_t zeros, Run run, Longest longest) {
  if (zeros > kRun) [[unlikely]] {
    run(kRun);
    for (zeros -= kRun; zeros >= kLongest; zeros -= kLongest) longest();
  }
  run(zeros);
}

}  // namespace

/// The literals of a block, and codes for them and the runs of zeros between them.
struct RunDeflater::Codes {
  std::unique_ptr<Literal[]> found =
      std::make_unique_for_overwrite<Literal[]>(kEnough + kStep + kAtOnce);
  std::size_t count = 0;
  isal_huff_histogram histogram{};
  isal_hufftables tables{};
  std::array<Bits, kRun + 1> runs;  ///< of so many zeros: each by itself, or one and a match
  std::array<Bits, 256> literals;
  Bits longest;  ///< match
  Bits end;      ///< of the block

  /// The shortest codes for a sample of the block: some 16,000 literals find as good ones as all
  /// do.
  EVENTGAN_CLONES void choose(std::size_t block_size) {
    constexpr std::size_t kSample = 256;
    const std::size_t step = kSample * (1 + count / (64 * kSample));
    std::array<std::uint32_t, kRun + 1> run_counts{};
    std::array<std::uint32_t, 256> literal_counts{};
    std::uint64_t longest_count = 0;
    const auto count_run = [&](std::size_t zeros) {
      split_run(
          zeros, [&](std::size_t some) { ++run_counts[some]; }, [&] { ++longest_count; });
    };
    for (std::size_t from = 0; from < count; from += step) {
      std::size_t next = after(from);
      for (std::size_t i = from; i < std::min(from + kSample, count); ++i) {
        count_run(place_of(found[i]) - next);
        ++literal_counts[value_of(found[i])];
        next = place_of(found[i]) + 1;
      }
    }
    count_run(block_size - after(count));

    histogram = {};
    std::uint64_t* symbols = histogram.lit_len_histogram;
    std::ranges::copy(literal_counts, symbols);
    symbols[256] = 1;  // the block's end
    symbols[285] = longest_count;
    for (std::size_t zeros = 1; zeros <= kRun; ++zeros) {
      symbols[0] += (zeros < 4 ? zeros : 1) * run_counts[zeros];
      if (zeros >= 4) symbols[length_symbol(zeros - 1)] += run_counts[zeros];
    }
    for (int symbol = 257; symbol <= 285; ++symbol) histogram.dist_histogram[0] += symbols[symbol];
    isal_create_hufftables(&tables, &histogram);  // every symbol has a code

    for (std::size_t byte = 0; byte < literals.size(); ++byte) {
      literals[byte] = {tables.lit_table[byte], tables.lit_table_sizes[byte]};
    }
    end = {tables.lit_table[256], tables.lit_table_sizes[256]};
    longest = match(kLongest);
    for (std::size_t zeros = 0; zeros <= kRun; ++zeros) {
      runs[zeros] = {};
      for (std::size_t i = 0; i < (zeros < 4 ? zeros : 1); ++i) runs[zeros].append(literals[0]);
      if (zeros >= 4) runs[zeros].append(match(zeros - 1));
    }
  }

  EVENTGAN_CLONES void write(std::size_t block_size, bool last, BitWriter& writer) const {
    BitWriter out = writer;  // what is written cannot alias the members of one that stays here
    const std::uint32_t header = 8 * tables.deflate_hdr_count + tables.deflate_hdr_extra_bits;
    for (std::uint32_t bit = 0; bit < header; bit += 8) {
      std::uint64_t byte = tables.deflate_hdr[bit / 8];
      if (bit == 0) byte = (byte & ~std::uint64_t{1}) | (last ? 1 : 0);
      out.write({byte, std::min(8u, header - bit)});
    }
    const auto write_with_zeros = [&](std::size_t zeros, const Bits& symbol) {
      Bits bits;
      split_run(
          zeros,
          [&](std::size_t some) {
            if (bits.count > 0) out.write(bits);
            bits = runs[some];
          },
          [&] {
            out.write(bits);
            bits = longest;
          });
      if (bits.count + symbol.count > BitWriter::kMost) [[unlikely]] {
        out.write(bits);
        bits = {};
      }
      bits.append(symbol);
      out.write(bits);
    };
    std::size_t next = 0;
    const auto write_one = [&](Literal literal) {
      write_with_zeros(place_of(literal) - next, literals[value_of(literal)]);
      next = place_of(literal) + 1;
    };
    std::size_t i = 0;
    for (; i + 2 <= count; i += 2) {  // two at once, since a write waits for the one before it
      const Literal one = found[i], two = found[i + 1];
      const std::size_t zeros_one = place_of(one) - next;
      const std::size_t zeros_two = place_of(two) - place_of(one) - 1;
      if (std::max(zeros_one, zeros_two) <= kRun) [[likely]] {
        const std::array parts{runs[zeros_one], literals[value_of(one)], runs[zeros_two],
                               literals[value_of(two)]};
        if (parts[0].count + parts[1].count + parts[2].count + parts[3].count <= BitWriter::kMost)
            [[likely]] {
          Bits both;
          for (const Bits& part : parts) both.append(part);
          out.write(both);
          next = place_of(two) + 1;
          continue;
        }
      }
      write_one(one);
      write_one(two);
    }
    if (i < count) write_one(found[i]);
    write_with_zeros(block_size - next, end);
    writer = out;
  }

 private:
  /// The place after the literal before literal i.
  std::size_t after(std::size_t i) const { return i == 0 ? 0 : place_of(found[i - 1]) + 1; }

  /// Of distance 1. The lowest five bits of the tables' numbers are the size of what is above them.
  Bits match(std::size_t length) const {
    const std::uint32_t code = tables.len_table[length - 3];
    Bits bits{code >> 5, code & 31};
    bits.append({tables.dist_table[0] >> 5, tables.dist_table[0] & 31});
    return bits;
  }
};

namespace {

/// As it is, in blocks as large as they may be.
void store(std::span<const std::byte> block, bool last, BitWriter& writer) {
  do {
    const std::span<const std::byte> part = block.first(std::min(block.size(), kStored));
    block = block.subspan(part.size());
    writer.write({last && block.empty() ? 1u : 0u, 3});
    writer.next_byte();
    writer.write({part.size() | (~part.size() & 0xffff) << 16, 32});
    writer.copy(part);
  } while (!block.empty());
}

}  // namespace

RunDeflater::RunDeflater() : codes_(std::make_unique<Codes>()) {}

RunDeflater::~RunDeflater() = default;

std::size_t RunDeflater::bound(std::size_t bytes) {
  return 2 * bytes + kHeader * (bytes / kStep + 2);
}

std::size_t RunDeflater::deflate(std::span<const std::byte> bytes, std::byte* room) {
  BitWriter writer(room);
  writer.write({0x0178, 16});  // deflate with a window of 32 KiB, the quickest (RFC 1950)
  std::span<const std::byte> rest = bytes;
  do {
    std::size_t size = 0;
    codes_->count = 0;
    do {
      const std::size_t from = size;
      size += std::min(rest.size() - from, kStep);
      codes_->count += find_literals(rest.first(size), from, codes_->found.get() + codes_->count);
    } while (size < std::min(rest.size(), kLargest) && codes_->count < kEnough);
    const std::span<const std::byte> block = rest.first(size);
    rest = rest.subspan(size);
    codes_->choose(block.size());
    const BitWriter before = writer;
    const std::byte* const begin = writer.begun();
    codes_->write(block.size(), rest.empty(), writer);
    if (static_cast<std::size_t>(writer.begun() - begin) > block.size()) {
      writer = before;
      store(block, rest.empty(), writer);
    }
  } while (!rest.empty());
  const std::uint32_t sum = libdeflate_adler32(1, bytes.data(), bytes.size());
  writer.next_byte();
  for (const int shift : {24, 16, 8, 0}) writer.write({sum >> shift & 0xff, 8});
  return static_cast<std::size_t>(writer.next_byte() - room);
}

}  // namespace eventgan
