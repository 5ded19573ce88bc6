#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <vector>

#include "manifests/faults.h"
#include "stages/frames/mpii/mat_file_internal.h"

namespace eventgan {
namespace {

constexpr std::size_t kHeaderBytes = 128;
constexpr std::uint32_t kCompressed = 15;  // miCOMPRESSED

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& expected,
                         const std::string& got) {
  throw InputError("expected " + expected + ", got " + got + ", in " + file.string());
}

/// Inflates a zlib stream of `size` bytes that starts where `stream` stands, keeping nothing: zlib
/// compares the Adler-32 sum at its end. True if stream and sum are right.
bool inflates(std::ifstream& stream, std::uint64_t size) {
  z_stream state{};
  if (inflateInit(&state) != Z_OK) return false;
  std::vector<Bytef> input(1 << 16), output(1 << 18);
  int status = Z_OK;
  while (status == Z_OK && size > 0) {
    const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(size, input.size()));
    if (!stream.read(reinterpret_cast<char*>(input.data()), static_cast<std::streamsize>(count)))
      break;
    size -= count;
    state.next_in = input.data();
    state.avail_in = static_cast<uInt>(count);
    do {
      state.next_out = output.data();
      state.avail_out = static_cast<uInt>(output.size());
      status = inflate(&state, Z_NO_FLUSH);
    } while (status == Z_OK && (state.avail_in > 0 || state.avail_out == 0));
    if (status == Z_BUF_ERROR) status = Z_OK;  // all input used: go on with the next piece
  }
  inflateEnd(&state);
  return status == Z_STREAM_END;
}

void check_whole(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream)
    throw InputError("expected a MATLAB file, got nothing readable, in " + file.string());
  std::array<char, kHeaderBytes> header{};
  stream.read(header.data(), header.size());
  const bool little = std::memcmp(&header[126], "IM", 2) == 0;
  const bool big = std::memcmp(&header[126], "MI", 2) == 0;
  const int version = stream && (little || big) ? header[little ? 125 : 124] : 0;
  if (version != 1) {
    refuse(file, "a MATLAB version 5 file (saved with -v7 or -v6)",
           version == 2 ? "version 7.3" : "something else");
  }
  const auto number = [little](const unsigned char* bytes) {
    std::uint32_t value = 0;
    for (int i = 0; i < 4; ++i) value = value << 8 | bytes[little ? 3 - i : i];
    return value;
  };

  const std::uint64_t file_size = std::filesystem::file_size(file);
  std::uint64_t at = kHeaderBytes;
  while (at < file_size) {
    std::array<unsigned char, 8> tag{};
    stream.seekg(static_cast<std::streamoff>(at));
    stream.read(reinterpret_cast<char*>(tag.data()), tag.size());
    const std::uint64_t size = number(&tag[4]);
    if (!stream || at + tag.size() + size > file_size) {
      refuse(file, "a whole file", "one cut off at byte " + std::to_string(file_size));
    }
    if (number(tag.data()) == kCompressed && !inflates(stream, size)) {
      refuse(file, "a compressed element with a matching checksum",
             "damaged data at byte " + std::to_string(at));
    }
    at += tag.size() + size;
  }
}

struct MatFileCloser {
  void operator()(mat_t* file) const { Mat_Close(file); }
};

}  // namespace

MatVariable read_mat_variable(const std::filesystem::path& file, const std::string& name) {
  check_whole(file);
  const std::unique_ptr<mat_t, MatFileCloser> opened(Mat_Open(file.c_str(), MAT_ACC_RDONLY));
  if (!opened) refuse(file, "a MATLAB file", "one that matio cannot open");
  MatVariable variable(Mat_VarRead(opened.get(), name.c_str()));
  if (!variable) refuse(file, "a variable " + name, "none");
  return variable;
}

}  // namespace eventgan
