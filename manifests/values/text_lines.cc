#include "manifests/values/text_lines.h"

#include <algorithm>

namespace eventgan {

std::vector<TextLine> split_lines(std::string_view text) {
  constexpr std::string_view kMark = "\xEF\xBB\xBF";
  if (text.starts_with(kMark)) text.remove_prefix(kMark.size());
  std::vector<TextLine> lines;
  while (!text.empty()) {
    const std::size_t length = std::min(text.find('\n'), text.size() - 1) + 1;
    lines.push_back({text.substr(0, length), static_cast<int>(lines.size()) + 1});
    text.remove_prefix(length);
  }
  return lines;
}

std::vector<std::string_view> split_columns(std::string_view line) {
  constexpr std::string_view kSpace = " \t\r\n";
  std::vector<std::string_view> columns;
  std::size_t begin = line.find_first_not_of(kSpace);
  while (begin != std::string_view::npos) {
    const std::size_t end = std::min(line.find_first_of(kSpace, begin), line.size());
    columns.push_back(line.substr(begin, end - begin));
    begin = line.find_first_not_of(kSpace, end);
  }
  return columns;
}

std::optional<std::int64_t> whole_of(double number) {
  constexpr double kMost = 9007199254740992;  // 2^53
  if (!(std::abs(number) <= kMost) || number != std::trunc(number)) return std::nullopt;
  return static_cast<std::int64_t>(number);
}

std::optional<std::int64_t> parse_whole(std::string_view token) {
  if (const auto number = parse_number<std::int64_t>(token)) return number;
  const auto number = parse_number<double>(token);
  return number ? whole_of(*number) : std::nullopt;
}

std::string in_quotes(std::string_view text) {
  constexpr std::size_t kMaxLength = 40;
  std::string shown(text.substr(0, kMaxLength));
  std::ranges::replace_if(
      shown, [](char c) { return c < ' ' || c > '~'; }, '?');
  return "'" + shown + (text.size() > kMaxLength ? "...'" : "'");
}

std::string shell_word(std::string_view path) {
  constexpr std::string_view kPlain =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./+:,=@%";
  if (!path.empty() && path.find_first_not_of(kPlain) == path.npos) return std::string(path);
  std::string word = "'";
  for (const char c : path) word += c == '\'' ? "'\\''" : std::string(1, c);
  return word + "'";
}

std::string place_in_file(const std::string& path, int line) {
  return path + ":" + std::to_string(line);
}

}  // namespace eventgan
