#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace eventgan {

/// Everything that is wrong with one document, in the order found: a reader adds what it finds and
/// goes on, so that its user mends a document once and not once for each fault.
class FaultList {
 public:
  /// `document` stands for the document in every line; mostly its path.
  explicit FaultList(std::string document) : document_(std::move(document)) {}

  /// "DOCUMENT: $.json.path: expected X, got Y"
  void add(std::string_view json_path, std::string_view expected, std::string_view got);

  /// "DOCUMENT:LINE:COLUMN: expected X, got Y" at a byte of the document's text, for what has no
  /// JSON path. Lines and columns count from 1, columns in characters.
  void add_at(std::string_view text, std::size_t byte, std::string_view expected,
              std::string_view got);

  bool empty() const { return lines_.empty(); }

  /// One fault a line, no newline at the end. Beyond a thousand they are only counted.
  std::string text() const;

 private:
  void add_line(std::string line);

  std::string document_;
  std::vector<std::string> lines_;
  std::size_t left_out_ = 0;
};

}  // namespace eventgan
