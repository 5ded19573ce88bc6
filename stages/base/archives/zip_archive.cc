#include "stages/base/archives/zip_archive.h"

#include <unistd.h>
#include <zip.h>

#include <algorithm>
#include <cerrno>
#include <memory>
#include <stdexcept>
#include <string_view>

#include "manifests/files/input_file.h"

namespace eventgan {
namespace {

// No deflate stream grows by more than this factor when it is inflated.
constexpr zip_uint64_t kDeflateGrowth = 1032;

// libzip holds some 400 bytes for each member that the directory lists.
constexpr std::size_t kMostMembers = 65536;

// Every entry of the directory begins with this; wherever the file says that it is.
constexpr std::string_view kEntrySignature = "PK\1\2";

std::size_t count_signatures(const InputFile& file) {
  constexpr std::uint64_t kBlock = 1 << 20;
  constexpr std::uint64_t kOverlap = kEntrySignature.size() - 1;
  std::size_t count = 0;
  for (std::uint64_t at = 0; at < file.size_bytes(); at += kBlock) {
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

std::vector<std::byte> ZipArchive::read(const std::string& name, std::uint64_t most_bytes) const {
  const State& state = *state_;
  const zip_int64_t index = zip_name_locate(state.archive.get(), name.c_str(), 0);
  if (index < 0) state.fail("a member of that name", "none", name);

  zip_stat_t about;
  constexpr zip_uint64_t kNeeded = ZIP_STAT_SIZE | ZIP_STAT_COMP_SIZE | ZIP_STAT_COMP_METHOD;
  if (zip_stat_index(state.archive.get(), static_cast<zip_uint64_t>(index), 0, &about) != 0 ||
      (about.valid & kNeeded) != kNeeded) {
    state.fail("a member with a size", zip_strerror(state.archive.get()), name);
  }
  if (about.comp_method != ZIP_CM_STORE && about.comp_method != ZIP_CM_DEFLATE) {
    state.fail("a stored or deflated member", "method " + std::to_string(about.comp_method), name);
  }
  const bool stored = about.comp_method == ZIP_CM_STORE;
  if (about.comp_size > state.size_bytes ||
      about.size > (stored ? about.comp_size : about.comp_size * kDeflateGrowth)) {
    state.fail(
        "a member that the file can hold",
        std::to_string(about.size) + " bytes in a file of " + std::to_string(state.size_bytes),
        name);
  }

  if (about.size > most_bytes) {
    state.fail("at most " + std::to_string(most_bytes) + " bytes", std::to_string(about.size),
               name);
  }

  const std::unique_ptr<zip_file_t, CloseMember> member(
      zip_fopen_index(state.archive.get(), static_cast<zip_uint64_t>(index), 0));
  if (!member) state.fail("a readable member", zip_strerror(state.archive.get()), name);
  std::vector<std::byte> bytes(about.size);
  std::size_t filled = 0;
  while (filled < bytes.size()) {
    const zip_int64_t got = zip_fread(member.get(), bytes.data() + filled, bytes.size() - filled);
    if (got < 0) state.fail("readable content", zip_file_strerror(member.get()), name);
    if (got == 0) {
      state.fail(std::to_string(bytes.size()) + " bytes", std::to_string(filled), name);
    }
    filled += static_cast<std::size_t>(got);
  }
  // libzip compares the checksum when it meets the end of the member, so ask for one byte beyond
  // it.
  std::byte beyond;
  const zip_int64_t rest = zip_fread(member.get(), &beyond, 1);
  if (rest < 0)
    state.fail("content with the right checksum", zip_file_strerror(member.get()), name);
  if (rest > 0) state.fail(std::to_string(bytes.size()) + " bytes", "more", name);
  return bytes;
}

}  // namespace eventgan
