#include "stages/base/archives/zip_archive.h"

#include <unistd.h>
#include <zip.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <memory>
#include <span>
#include <stdexcept>
#include <string_view>

#include "manifests/files/input_file.h"

namespace eventgan {
namespace {

// No deflate stream grows by more than this factor when it is inflated.
constexpr zip_uint64_t kDeflateGrowth = 1032;

// libzip holds some 400 bytes for each member that the directory lists.
constexpr std::size_t kMostMembers = 65536;

// Every entry of the directory begins with this.
constexpr std::string_view kEntrySignature = "PK\1\2";

std::uint64_t zip_number(std::string_view bytes, std::size_t at, std::size_t width) {
  std::uint64_t value = 0;
  for (std::size_t i = width; i-- > 0;) {
    value = value << 8 | static_cast<std::uint8_t>(bytes[at + i]);
  }
  return value;
}

// Where the directory begins, or before: the end of the file may hold several records that look
// like the last one, and zip64's beside them, so this is the first place that they name. The file's
// size if they name none.
std::uint64_t directory_begin(const InputFile& file) {
  constexpr std::size_t kEnd = 22;  // the last record; a comment follows
  constexpr std::size_t kMostComment = 65536;
  constexpr std::size_t kLocator = 20;  // before the last record: where zip64's is
  constexpr std::size_t kRecord64 = 56;
  const std::uint64_t size = file.size_bytes();
  const std::uint64_t tail_size = std::min<std::uint64_t>(size, kLocator + kEnd + kMostComment);
  const std::string tail = file.read(size - tail_size, tail_size);
  std::uint64_t begin = size;
  for (std::size_t at = tail.find("PK\5\6"); at != std::string::npos;
       at = tail.find("PK\5\6", at + 1)) {
    if (tail.size() - at < kEnd) break;
    std::uint64_t named = zip_number(tail, at + 16, 4);
    if (at >= kLocator && tail.compare(at - kLocator, 4, "PK\6\7") == 0) {
      const std::uint64_t record = zip_number(tail, at - kLocator + 8, 8);
      if (record < size && size - record >= kRecord64) {
        const std::uint64_t named64 = zip_number(file.read(record, kRecord64), 48, 8);
        named = named == 0xffffffff ? named64 : std::min(named, named64);
      }
    }
    begin = std::min(begin, named);
  }
  return begin;
}

// At least as many as libzip finds entries: it reads one after the other, even beyond the size that
// the directory is said to have. The members before, which may be larger than memory, are not read.
std::size_t count_signatures(const InputFile& file) {
  constexpr std::uint64_t kBlock = 1 << 20;
  constexpr std::uint64_t kOverlap = kEntrySignature.size() - 1;
  std::size_t count = 0;
  for (std::uint64_t at = directory_begin(file); at < file.size_bytes(); at += kBlock) {
    const std::string text = file.read(at, std::min(kBlock + kOverlap, file.size_bytes() - at));
    for (std::size_t hit = text.find(kEntrySignature); hit != std::string_view::npos;
         hit = text.find(kEntrySignature, hit + 1)) {
      ++count;
    }
  }
  return count;
}

struct CloseMember {
  void operator()(zip_file_t* member) const { zip_fclose(member); }
};
using OpenMember = std::unique_ptr<zip_file_t, CloseMember>;

/// What the directory says of a member.
struct MemberEntry {
  zip_uint64_t index;
  std::uint64_t size_bytes;
  bool is_stored;
};

std::string text_of(int code) {
  zip_error_t error;
  zip_error_init_with_code(&error, code);
  const std::string text = zip_error_strerror(&error);
  zip_error_fini(&error);
  return text;
}

}  // namespace

struct ZipArchive::State {
  struct Discard {
    void operator()(zip_t* archive) const { zip_discard(archive); }
  };

  explicit State(const std::filesystem::path& file) : path(file.string()) {
    const InputFile bytes(file);
    size_bytes = bytes.size_bytes();
    if (count_signatures(bytes) > kMostMembers) {
      throw std::runtime_error("expected a zip file of at most " + std::to_string(kMostMembers) +
                               " members, got more, in " + path);
    }
    int code = 0;
    const int descriptor = ::dup(bytes.descriptor());  // libzip's, unless it fails
    if (descriptor < 0) require_open_files_left(errno, path);
    archive.reset(zip_fdopen(descriptor, 0, &code));
    if (!archive) {
      const int error = errno;  // of another descriptor that libzip makes
      ::close(descriptor);
      if (code == ZIP_ER_OPEN) require_open_files_left(error, path);
      throw std::runtime_error("expected a zip file, got \"" + text_of(code) + "\", in " + path);
    }
    const zip_int64_t count = zip_get_num_entries(archive.get(), 0);
    for (zip_int64_t i = 0; i < count; ++i) {
      const char* name = zip_get_name(archive.get(), static_cast<zip_uint64_t>(i), 0);
      if (name == nullptr)
        fail("readable member names", zip_strerror(archive.get()), std::to_string(i));
      names.emplace_back(name);
    }
    auto sorted = names;
    std::ranges::sort(sorted);
    const auto twice = std::ranges::adjacent_find(sorted);  // readers differ in which one they take
    if (twice != sorted.end()) {
      throw std::runtime_error("expected each member once, got one twice, in " + path +
                               " (member " + *twice + ")");
    }
  }

  [[noreturn]] void fail(const std::string& expected, const std::string& got,
                         const std::string& member) const {
    throw std::runtime_error("expected " + expected + ", got \"" + got + "\", in " + path +
                             " (member " + member + ")");
  }

  /// Of a size that the file can hold.
  MemberEntry find(const std::string& name) const {
    const zip_int64_t index = zip_name_locate(archive.get(), name.c_str(), 0);
    if (index < 0) fail("a member of that name", "none", name);

    zip_stat_t about;
    constexpr zip_uint64_t kNeeded = ZIP_STAT_SIZE | ZIP_STAT_COMP_SIZE | ZIP_STAT_COMP_METHOD;
    if (zip_stat_index(archive.get(), static_cast<zip_uint64_t>(index), 0, &about) != 0 ||
        (about.valid & kNeeded) != kNeeded) {
      fail("a member with a size", zip_strerror(archive.get()), name);
    }
    if (about.comp_method != ZIP_CM_STORE && about.comp_method != ZIP_CM_DEFLATE) {
      fail("a stored or deflated member", "method " + std::to_string(about.comp_method), name);
    }
    const bool stored = about.comp_method == ZIP_CM_STORE;
    if (about.comp_size > size_bytes ||
        about.size > (stored ? about.comp_size : about.comp_size * kDeflateGrowth)) {
      fail("a member that the file can hold",
           std::to_string(about.size) + " bytes in a file of " + std::to_string(size_bytes), name);
    }
    return {static_cast<zip_uint64_t>(index), about.size, stored};
  }

  OpenMember open(const MemberEntry& entry, const std::string& name) const {
    OpenMember member(zip_fopen_index(archive.get(), entry.index, 0));
    if (!member) fail("a readable member", zip_strerror(archive.get()), name);
    return member;
  }

  /// With what comes next of the member.
  void fill(std::span<std::byte> bytes, zip_file_t* member, const MemberEntry& entry,
            const std::string& name) const {
    while (!bytes.empty()) {
      const zip_int64_t got = zip_fread(member, bytes.data(), bytes.size());
      if (got < 0) fail("readable content", zip_file_strerror(member), name);
      if (got == 0) fail(std::to_string(entry.size_bytes) + " bytes", "fewer", name);
      bytes = bytes.subspan(static_cast<std::size_t>(got));
    }
  }

  std::string path;
  std::uintmax_t size_bytes = 0;
  std::unique_ptr<zip_t, Discard> archive;
  std::vector<std::string> names;
};

ZipArchive::ZipArchive(const std::filesystem::path& file) : state_(new State(file)) {}

ZipArchive::~ZipArchive() = default;

const std::vector<std::string>& ZipArchive::names() const { return state_->names; }

bool ZipArchive::contains(const std::string& name) const {
  return zip_name_locate(state_->archive.get(), name.c_str(), 0) >= 0;
}

std::uint64_t ZipArchive::size_bytes(const std::string& name) const {
  return state_->find(name).size_bytes;
}

std::vector<std::byte> ZipArchive::read(const std::string& name, std::uint64_t most_bytes) const {
  const State& state = *state_;
  const MemberEntry entry = state.find(name);
  if (entry.size_bytes > most_bytes) {
    state.fail("at most " + std::to_string(most_bytes) + " bytes", std::to_string(entry.size_bytes),
               name);
  }
  const OpenMember member = state.open(entry, name);
  std::vector<std::byte> bytes(entry.size_bytes);
  state.fill(bytes, member.get(), entry, name);
  // libzip compares the checksum when it meets the end of the member, so ask for one byte beyond
  // it.
  std::byte beyond;
  const zip_int64_t rest = zip_fread(member.get(), &beyond, 1);
  if (rest < 0)
    state.fail("content with the right checksum", zip_file_strerror(member.get()), name);
  if (rest > 0) state.fail(std::to_string(bytes.size()) + " bytes", "more", name);
  return bytes;
}

std::vector<std::byte> ZipArchive::read_part(const std::string& name, std::uint64_t offset,
                                             std::uint64_t count) const {
  const State& state = *state_;
  const MemberEntry entry = state.find(name);
  if (offset > entry.size_bytes || count > entry.size_bytes - offset) {
    state.fail(std::to_string(count) + " bytes from byte " + std::to_string(offset) + " on",
               "a member of " + std::to_string(entry.size_bytes), name);
  }
  if (count == 0) return {};  // in an empty member libzip crashes when it seeks
  const OpenMember member = state.open(entry, name);
  if (entry.is_stored) {
    if (zip_fseek(member.get(), static_cast<zip_int64_t>(offset), SEEK_SET) != 0) {
      state.fail("a member that can be read from any byte on", zip_file_strerror(member.get()),
                 name);
    }
  } else {
    std::array<std::byte, 65536> before;
    for (std::uint64_t at = 0; at < offset; at += before.size()) {
      const auto size = std::min<std::uint64_t>(before.size(), offset - at);
      state.fill(std::span(before).first(size), member.get(), entry, name);
    }
  }
  std::vector<std::byte> bytes(count);
  state.fill(bytes, member.get(), entry, name);
  return bytes;
}

}  // namespace eventgan
