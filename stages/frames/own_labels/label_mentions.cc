#include <zlib.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "manifests/values/text.h"
#include "manifests/values/text_lines.h"
#include "stages/frames/own_labels/detail/label_file.h"

namespace eventgan {
namespace {

std::vector<std::string_view> parts_of(std::string_view text, std::string_view separators) {
  std::vector<std::string_view> parts;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find_first_of(separators, begin), text.size());
    if (end > begin) parts.push_back(trimmed(text.substr(begin, end - begin)));
    begin = end + 1;
  }
  return parts;
}

/// A line of a text: an image, and what stands beside it.
Said said_by_line(std::string_view line, const ImageNames& images) {
  Said said;
  std::size_t numbers = 0, others = 0;
  for (const std::string_view field : parts_of(line, ",;\t\"'|")) {
    const std::string_view folders = field.substr(0, field.find_last_of("/\\") + 1);
    if (folders.find(' ') == folders.npos && images.find(field) != nullptr) {
      said.names_images = true;
      continue;
    }
    for (const std::string_view part : parts_of(field, " =:()[]{}")) {
      constexpr std::size_t kHash = 32;
      const bool is_hash =
          part.size() >= kHash && part.find_first_not_of("0123456789abcdef") == part.npos;
      if (images.find(part) != nullptr) {
        said.names_images = true;
      } else if (parse_number<double>(part)) {
        ++numbers;
      } else if (!is_hash) {
        ++others;
      }
    }
  }
  said.has_numbers = numbers >= 2 && 2 * numbers >= others;
  said.has_words = others > 0;
  return said;
}

Said said_by_text(const LabelFile& file) {
  Said said;
  const bool is_named = file.is_of_image || file.is_of_sequence;
  for (const TextLine& line : split_lines(file.text)) {
    const Said of_line = said_by_line(line.bytes, file.images);
    said.names_images |= of_line.names_images;
    if (!of_line.names_images && !is_named) continue;
    said.has_numbers |= of_line.has_numbers;
    said.has_words |= of_line.has_words;
  }
  return said;
}

Said said_by_json(const LabelFile& file) {
  Said said;
  std::size_t numbers = 0;
  bool is_quoted = false;
  for (std::size_t begin = 0; begin < file.text.size(); is_quoted = !is_quoted) {
    const std::size_t end = std::min(file.text.find('"', begin), file.text.size());
    const std::string_view part = std::string_view(file.text).substr(begin, end - begin);
    begin = end + 1;
    if (is_quoted) {
      said.names_images = said.names_images || file.images.find(part) != nullptr;
      continue;
    }
    for (const std::string_view value : parts_of(part, ",:[]{} \n\r\t")) {
      numbers += parse_number<double>(value).has_value();
    }
  }
  constexpr std::size_t kBox = 4;
  const bool are_captions = file.has("\"caption\"") && !file.has("\"bbox\"");
  said.has_numbers = numbers >= kBox && !are_captions;
  said.has_words = true;
  return said;
}

/// Appends what a deflated stream begins with.
void inflate_into(std::string& text, std::string_view stream, int window_bits) {
  constexpr std::size_t kMost = std::size_t{1} << 18;
  z_stream state{};
  if (inflateInit2(&state, window_bits) != Z_OK) return;
  std::string inflated(kMost, '\0');
  state.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(stream.data()));
  state.avail_in = static_cast<uInt>(stream.size());
  state.next_out = reinterpret_cast<Bytef*>(inflated.data());
  state.avail_out = static_cast<uInt>(kMost);
  inflate(&state, Z_SYNC_FLUSH);  // what is cut off or damaged ends it
  text.append(inflated, 0, kMost - state.avail_out);
  inflateEnd(&state);
}

/// The beginning of a MAT file (version 5) or of an .npz, and what lies deflated in it.
std::string with_inflated(std::string_view bytes) {
  constexpr std::size_t kMost = std::size_t{1} << 22, kTag = 8, kMatHeader = 128, kMember = 30;
  const auto number = [&](std::size_t at, std::size_t width, bool little = true) {
    std::size_t value = 0;
    for (std::size_t i = 0; i < width; ++i) {
      value = value << 8 | static_cast<unsigned char>(bytes[at + (little ? width - 1 - i : i)]);
    }
    return value;
  };
  std::string text(bytes);
  if (bytes.starts_with("MATLAB 5.0")) {
    constexpr std::size_t kCompressed = 15;
    const bool little = bytes.substr(0, kMatHeader).ends_with("IM");
    for (std::size_t at = kMatHeader; at + kTag <= bytes.size() && text.size() < kMost;) {
      const std::size_t size = number(at + 4, 4, little);
      if (number(at, 4, little) == kCompressed) {
        inflate_into(text, bytes.substr(at + kTag, size), MAX_WBITS);
      }
      at += kTag + size;
    }
  }
  constexpr std::string_view kSignature = "PK\3\4";
  for (std::size_t at = bytes.starts_with(kSignature) ? 0 : bytes.npos;
       at < bytes.size() && at + kMember <= bytes.size() && text.size() < kMost;
       at = bytes.find(kSignature, at + 1)) {
    const std::size_t data = at + kMember + number(at + 26, 2) + number(at + 28, 2);
    const bool is_deflated = number(at + 8, 2) == Z_DEFLATED;
    if (is_deflated && data < bytes.size()) inflate_into(text, bytes.substr(data), -MAX_WBITS);
  }
  return text;
}

/// Whether an array of texts of one length, as NumPy has them, begins with one of the images.
bool has_array_of_names(std::string_view text, const ImageNames& images) {
  for (const auto& [type, letter_bytes] : {std::pair("'<U", 4), std::pair("'|S", 1)}) {
    const std::size_t at = text.find(type);
    if (at == text.npos) continue;
    const std::size_t digits = at + 3, end = text.find('\'', digits), begin = text.find('\n', at);
    if (end == text.npos || begin == text.npos) continue;
    const auto letters = parse_whole(text.substr(digits, end - digits));
    if (!letters || *letters <= 0 || *letters > 1000) continue;
    std::string name(
        text.substr(begin + 1, static_cast<std::size_t>(*letters) * std::size_t(letter_bytes)));
    std::erase(name, '\0');
    if (images.find(name) != nullptr) return true;
  }
  return false;
}

/// Of XML, MAT and NumPy files; letters of two or four bytes have zeros between them.
Said said_by_bytes(const LabelFile& file) {
  std::string text = with_inflated(file.text);
  Said said;
  said.names_images = has_array_of_names(text, file.images);
  std::erase(text, '\0');
  for (std::size_t begin = 0; begin < text.size() && !said.names_images;) {
    constexpr std::string_view kOfNames =
        "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./\\";
    begin = std::min(text.find_first_of(kOfNames, begin), text.size());
    const std::size_t end = std::min(text.find_first_not_of(kOfNames, begin), text.size());
    said.names_images =
        file.images.find(std::string_view(text).substr(begin, end - begin)) != nullptr;
    begin = end;
  }
  said.has_numbers = said.has_words = true;
  return said;
}

}  // namespace

Said said_by(const LabelFile& file, std::string_view extension) {
  if (extension == ".xml" || extension.starts_with(".m") || extension.starts_with(".np")) {
    return said_by_bytes(file);
  }
  const bool is_json =
      extension.starts_with(".j") || extension == ".ndjson" || extension == ".odgt";
  return is_json ? said_by_json(file) : said_by_text(file);
}

}  // namespace eventgan
