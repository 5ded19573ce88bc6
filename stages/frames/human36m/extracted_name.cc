#include <algorithm>
#include <charconv>
#include <filesystem>
#include <stdexcept>

#include "stages/frames/human36m/extracted_name_internal.h"

namespace eventgan {
namespace {

constexpr std::size_t kMostDigits = 9;

bool is_number(std::string_view text) {
  return !text.empty() && std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; });
}

}  // namespace

ExtractedName parse_extracted_name(std::string_view name) {
  const auto fail = [name] {
    throw std::invalid_argument(
        "expected a picture below the root, named like S1_Directions_1.54138969_000001.jpg, got "
        "\"" +
        std::string(name) + "\"");
  };
  const std::filesystem::path path(name);
  if (path.is_absolute() || std::ranges::find(path, "..") != path.end()) fail();
  const std::string stem = path.stem().string();
  const std::size_t underscore = stem.rfind('_');
  const std::size_t dot = stem.rfind('.');
  const std::size_t subject_end = stem.find('_');
  if (underscore == std::string::npos || dot == std::string::npos || dot > underscore ||
      subject_end > dot || subject_end == 0) {
    fail();
  }
  ExtractedName result;
  result.sequence = stem.substr(0, underscore);
  result.subject = stem.substr(0, subject_end);
  result.camera = stem.substr(dot + 1, underscore - dot - 1);
  const std::string digits = stem.substr(underscore + 1);
  if (!is_number(result.camera) || !is_number(digits) || digits.size() > kMostDigits) fail();
  std::from_chars(digits.data(), digits.data() + digits.size(), result.number);
  result.folder = path.has_parent_path() ? path.parent_path().lexically_normal().generic_string()
                                         : result.subject + "/" + result.sequence;
  return result;
}

}  // namespace eventgan
