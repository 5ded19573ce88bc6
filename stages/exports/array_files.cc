#include "stages/exports/array_files.h"

#include <fmt/core.h>
#include <zip.h>

#include <cstdint>
#include <memory>
#include <stdexcept>

namespace eventgan {
namespace {

struct FreeSource {
  void operator()(zip_source_t* source) const { zip_source_free(source); }
};
struct DiscardArchive {
  void operator()(zip_t* archive) const { zip_discard(archive); }
};

[[noreturn]] void fail_zip(const char* action, const char* reason) {
  throw std::runtime_error(fmt::format("cannot {} a zip file in memory: {}", action, reason));
}

}  // namespace

std::string npz_file(const std::vector<std::pair<std::string, std::string>>& arrays) {
  constexpr zip_uint16_t kMidnight = 0;
  constexpr zip_uint16_t kFirstDay = (1 << 5) | 1;  // of January 1980, where zip's time begins
  zip_error_t error{};
  const std::unique_ptr<zip_source_t, FreeSource> memory(
      zip_source_buffer_create(nullptr, 0, /*freep=*/0, &error));
  if (!memory) fail_zip("begin", zip_error_strerror(&error));
  zip_source_keep(memory.get());  // the archive gives up one hold on it when it is closed
  std::unique_ptr<zip_t, DiscardArchive> archive(
      zip_open_from_source(memory.get(), ZIP_TRUNCATE, &error));
  if (!archive) {
    zip_source_free(memory.get());
    fail_zip("begin", zip_error_strerror(&error));
  }
  for (const auto& [name, bytes] : arrays) {
    zip_source_t* content =
        zip_source_buffer(archive.get(), bytes.data(), bytes.size(), /*freep=*/0);
    const zip_int64_t index =
        zip_file_add(archive.get(), (name + ".npy").c_str(), content, ZIP_FL_ENC_UTF_8);
    if (index < 0) {
      zip_source_free(content);
      fail_zip("add to", zip_strerror(archive.get()));
    }
    const auto member = static_cast<zip_uint64_t>(index);
    if (zip_set_file_compression(archive.get(), member, ZIP_CM_DEFLATE, /*level=*/6) != 0 ||
        zip_file_set_dostime(archive.get(), member, kMidnight, kFirstDay, 0) != 0) {
      fail_zip("add to", zip_strerror(archive.get()));
    }
  }
  if (zip_close(archive.get()) != 0) fail_zip("write", zip_strerror(archive.get()));
  static_cast<void>(archive.release());
  zip_stat_t about;
  zip_stat_init(&about);
  if (zip_source_stat(memory.get(), &about) != 0 || zip_source_open(memory.get()) != 0) {
    fail_zip("read", zip_error_strerror(zip_source_error(memory.get())));
  }
  std::string file(about.size, '\0');
  const zip_int64_t got = zip_source_read(memory.get(), file.data(), file.size());
  zip_source_close(memory.get());
  if (got != static_cast<zip_int64_t>(file.size())) fail_zip("read", "too short");
  return file;
}

namespace {

constexpr std::size_t kTarBlock = 512;

/// Writes an octal number with leading zeros that fills the field but for its closing NUL.
void put_octal(std::string& header, std::size_t at, std::size_t width, std::uint64_t number) {
  header.replace(at, width - 1, fmt::format("{:0{}o}", number, width - 1));
}

}  // namespace

std::string tar_member(std::string_view name, std::string_view bytes) {
  constexpr std::size_t kLongestName = 100;
  constexpr std::uint64_t kLargest = std::uint64_t{1} << 33;
  if (name.empty() || name.size() > kLongestName || bytes.size() >= kLargest) {
    throw std::invalid_argument(
        fmt::format("expected a tar member with a name of 1..100 bytes and less than 8 GiB, got {} "
                    "and {} bytes, in {}",
                    name.size(), bytes.size(), name));
  }
  std::string header(kTarBlock, '\0');
  header.replace(0, name.size(), name);
  put_octal(header, 100, 8, 0644);  // mode
  put_octal(header, 108, 8, 0);     // user
  put_octal(header, 116, 8, 0);     // group
  put_octal(header, 124, 12, bytes.size());
  put_octal(header, 136, 12, 0);   // time
  header.replace(148, 8, 8, ' ');  // the checksum's own field counts as blanks
  header[156] = '0';               // a regular file
  header.replace(257, 8, std::string_view("ustar\00000", 8));
  put_octal(header, 329, 8, 0);  // device
  put_octal(header, 337, 8, 0);
  unsigned sum = 0;
  for (const char c : header) sum += static_cast<unsigned char>(c);
  header.replace(148, 8, fmt::format("{:06o}", sum) + std::string("\0 ", 2));
  std::string member = std::move(header);
  member.append(bytes);
  return member.append((kTarBlock - bytes.size() % kTarBlock) % kTarBlock, '\0');
}

std::string tar_end() { return std::string(2 * kTarBlock, '\0'); }

}  // namespace eventgan
