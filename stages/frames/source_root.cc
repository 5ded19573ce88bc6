#include "stages/frames/source_root.h"

#include <array>
#include <cerrno>
#include <cstdio>
#include <memory>
#include <system_error>

#include "stages/frames/folder_listing.h"

namespace eventgan {

SourceRoot::SourceRoot(std::string_view written, const std::filesystem::path& base)
    : written_(written), on_disk_(base / written) {
  while (written_.size() > 1 && written_.back() == '/') written_.pop_back();
}

std::string SourceRoot::written(std::string_view relative) const {
  if (relative.empty()) return written_;
  std::string path = written_;
  if (!path.empty() && path != "/") path += '/';
  return path.append(relative);
}

std::filesystem::path SourceRoot::on_disk(std::string_view relative) const {
  return relative.empty() ? on_disk_ : on_disk_ / relative;
}

void SourceRoot::require_folder(std::string_view relative) const {
  std::error_code error;
  const auto status = std::filesystem::status(on_disk(relative), error);
  if (std::filesystem::is_directory(status)) return;
  throw InputError(std::string("expected a folder, got ") +
                   (std::filesystem::exists(status) ? "a file" : "nothing that can be read") +
                   ", in " + written(relative));
}

bool SourceRoot::has_file(std::string_view relative) const {
  std::error_code error;
  return std::filesystem::is_regular_file(on_disk(relative), error);
}

std::vector<std::string> SourceRoot::folders_in(std::string_view relative) const {
  return list_folder(on_disk(relative)).folders;
}

std::vector<std::string> SourceRoot::files_in(std::string_view relative) const {
  return list_folder(on_disk(relative)).files;
}

Outcome<std::string> SourceRoot::read(std::string_view relative) const {
  // C's streams, since they tell why reading failed.
  const auto close = [](std::FILE* file) { std::fclose(file); };
  const std::unique_ptr<std::FILE, decltype(close)> file(
      std::fopen(on_disk(relative).c_str(), "rb"), close);
  std::string bytes;
  if (file) {
    std::array<char, 1 << 14> block;
    std::size_t count = 0;
    while ((count = std::fread(block.data(), 1, block.size(), file.get())) > 0) {
      bytes.append(block.data(), count);
    }
    if (!std::ferror(file.get())) return bytes;
  }
  return SampleFault{"expected a readable file, got '" + std::generic_category().message(errno) +
                     "', in " + written(relative)};
}

std::string SourceRoot::read_or_throw(std::string_view relative) const {
  Outcome<std::string> bytes = read(relative);
  if (const auto* fault = std::get_if<SampleFault>(&bytes)) throw InputError(fault->reason);
  return std::get<std::string>(std::move(bytes));
}

}  // namespace eventgan
