#include "stages/recordings/readers/detail/unpacking.h"

#include <bzlib.h>
#include <fmt/core.h>
#include <lz4frame.h>
#include <zstd.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <new>

#include "stages/recordings/order/event_check.h"

namespace eventgan {
namespace {

template <class Context, auto release>
struct Released {
  void operator()(Context* context) const { release(context); }
};
using Bz2Context = std::unique_ptr<bz_stream, Released<bz_stream, BZ2_bzDecompressEnd>>;
using Lz4Context = std::unique_ptr<LZ4F_dctx, Released<LZ4F_dctx, LZ4F_freeDecompressionContext>>;
using ZstdContext = std::unique_ptr<ZSTD_DStream, Released<ZSTD_DStream, ZSTD_freeDStream>>;

/// What one step of unpacking took and gave.
struct UnpackStep {
  std::size_t taken = 0;
  std::size_t given = 0;
  bool is_end = false;
};

/// `step` gets the target and the packed bytes left.
template <class Step>
std::string unpack_by(std::string_view packed, std::size_t most, Step step) {
  std::string unpacked;
  std::size_t used = 0;
  for (;;) {
    if (used == unpacked.size()) {
      unpacked.resize(std::min(std::max(2 * used, 4 * packed.size() + 64), most + 1));
    }
    const UnpackStep made = step(unpacked.data() + used, unpacked.size() - used, packed);
    used += made.given;
    if (used > most) {
      throw EventFault(fmt::format("expected at most {} bytes unpacked, got more", most));
    }
    packed.remove_prefix(made.taken);
    if (made.is_end) break;
    if (made.taken == 0 && made.given == 0) {
      throw EventFault("expected a whole packed frame, got one that is cut off");
    }
  }
  if (!packed.empty()) {
    throw EventFault(
        fmt::format("expected one packed frame, got {} bytes behind its end", packed.size()));
  }
  unpacked.resize(used);
  return unpacked;
}

}  // namespace

std::string unpack_bz2(std::string_view packed, std::size_t most) {
  bz_stream stream{};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) throw std::bad_alloc();
  const Bz2Context context(&stream);
  return unpack_by(packed, most, [&](char* target, std::size_t room, std::string_view rest) {
    constexpr std::size_t kMost = std::numeric_limits<unsigned>::max();
    const auto given = static_cast<unsigned>(std::min(room, kMost));
    const auto left = static_cast<unsigned>(std::min(rest.size(), kMost));
    stream.next_in = const_cast<char*>(rest.data());
    stream.avail_in = left;
    stream.next_out = target;
    stream.avail_out = given;
    const int result = BZ2_bzDecompress(&stream);
    if (result != BZ_OK && result != BZ_STREAM_END) {
      throw EventFault(fmt::format("expected a bzip2 stream, got damage (error {})", result));
    }
    return UnpackStep{left - stream.avail_in, given - stream.avail_out, result == BZ_STREAM_END};
  });
}

std::string unpack_lz4(std::string_view packed, std::size_t most) {
  LZ4F_dctx* made = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION))) throw std::bad_alloc();
  const Lz4Context context(made);
  return unpack_by(packed, most, [&](char* target, std::size_t room, std::string_view rest) {
    UnpackStep step{rest.size(), room};
    const std::size_t hint =
        LZ4F_decompress(context.get(), target, &step.given, rest.data(), &step.taken, nullptr);
    if (LZ4F_isError(hint)) {
      throw EventFault(
          fmt::format("expected an LZ4 frame, got damage ({})", LZ4F_getErrorName(hint)));
    }
    step.is_end = hint == 0;
    return step;
  });
}

std::string unpack_zstd(std::string_view packed, std::size_t most) {
  const ZstdContext context(ZSTD_createDStream());
  if (!context) throw std::bad_alloc();
  return unpack_by(packed, most, [&](char* target, std::size_t room, std::string_view rest) {
    ZSTD_outBuffer output{target, room, 0};
    ZSTD_inBuffer input{rest.data(), rest.size(), 0};
    const std::size_t hint = ZSTD_decompressStream(context.get(), &output, &input);
    if (ZSTD_isError(hint)) {
      throw EventFault(
          fmt::format("expected a Zstandard frame, got damage ({})", ZSTD_getErrorName(hint)));
    }
    return UnpackStep{input.pos, output.pos, hint == 0};
  });
}

}  // namespace eventgan
