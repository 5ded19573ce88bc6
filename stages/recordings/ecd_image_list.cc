#include <charconv>
#include <sstream>
#include <string>
#include <string_view>

#include "manifests/faults.h"
#include "stages/files/text_file.h"
#include "stages/recordings/ecd_image_list_internal.h"
#include "stages/recordings/frame_times_internal.h"

namespace eventgan {
namespace {

constexpr std::string_view kBlanks = " \t\r";

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

/// A recording is one folder: what its list names lies in it.
bool leaves_folder(const std::filesystem::path& path) {
  if (path.is_absolute()) return true;
  for (const auto& part : path) {
    if (part == "..") return true;
  }
  return false;
}

/// False if the line is none.
bool add_line(std::string_view line, EcdImageList& list) {
  double time_s = 0;
  const auto [stop, error] = std::from_chars(line.data(), line.data() + line.size(), time_s);
  const std::string_view rest(stop, static_cast<std::size_t>(line.data() + line.size() - stop));
  const std::string_view path = trimmed(rest);
  if (error != std::errc() || path.empty() || kBlanks.find(rest.front()) == kBlanks.npos ||
      leaves_folder(path)) {
    return false;
  }
  list.times_s.push_back(time_s);
  list.paths.emplace_back(path);
  return true;
}

}  // namespace

EcdImageList read_ecd_image_list(const std::filesystem::path& file) {
  std::string reason;
  const auto text_of_file = try_read_file(file, reason);
  if (!text_of_file) {
    throw InputError("expected a list of frames, got no readable file (" + reason + "), in " +
                     file.string());
  }
  std::istringstream stream(*text_of_file);
  EcdImageList list;
  std::string line;
  for (int number = 1; std::getline(stream, line); ++number) {
    const std::string_view text = trimmed(line);
    if (text.empty() && stream.peek() == std::istringstream::traits_type::eof()) break;
    if (!add_line(text, list)) {
      throw InputError(
          "expected a time in seconds and a path inside the folder, got another line, in " +
          file.string() + " (line " + std::to_string(number) + ")");
    }
  }
  check_frame_times(list.times_s, file.string());
  return list;
}

}  // namespace eventgan
