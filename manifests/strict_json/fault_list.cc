#include <algorithm>

#include "manifests/strict_json/fault_list_internal.h"

namespace eventgan {
namespace {

constexpr std::size_t kMostLines = 1000;

std::string expectation(std::string_view expected, std::string_view got) {
  return std::string(": expected ").append(expected).append(", got ").append(got);
}

}  // namespace

void FaultList::add(std::string_view json_path, std::string_view expected, std::string_view got) {
  add_line(document_ + ": " + std::string(json_path) + expectation(expected, got));
}

void FaultList::add_at(std::string_view text, std::size_t byte, std::string_view expected,
                       std::string_view got) {
  const std::string_view before = text.substr(0, byte);
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  const std::string_view in_line = before.substr(before.rfind('\n') + 1);  // npos + 1 == 0
  const auto column = 1 + std::count_if(in_line.begin(), in_line.end(), [](unsigned char c) {
                        return (c & 0xc0) != 0x80;  // UTF-8: the first byte of each character
                      });
  add_line(document_ + ":" + std::to_string(line) + ":" + std::to_string(column) +
           expectation(expected, got));
}

void FaultList::add_line(std::string line) {
  if (lines_.size() == kMostLines) {
    ++left_out_;
  } else {
    lines_.push_back(std::move(line));
  }
}

std::string FaultList::text() const {
  std::string text;
  for (const std::string& line : lines_) text += (text.empty() ? "" : "\n") + line;
  if (left_out_ > 0)
    text += "\n" + document_ + ": and " + std::to_string(left_out_) + " more faults";
  return text;
}

}  // namespace eventgan
