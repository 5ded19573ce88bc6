#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace eventgan {

/// One array of a MATLAB version 5 file (numbers, text, a struct array, a cell array), read as far
/// as its own header goes; the arrays in it are read when they are asked for. A file says in many
/// places how much follows. Nothing is believed: what is taken lies within the array's own bytes,
/// and sizes, counts and types must agree exactly. Views into the bytes of a MatVariable.
struct MatArray {
  /// MATLAB's classes, by their numbers in the file.
  enum Class : int {
    kCell = 1,
    kStruct = 2,
    kChar = 4,
    kDouble = 6,
    kSingle = 7,
    kInt8 = 8,
    kUint8,
    kInt16,
    kUint16,
    kInt32,
    kUint32,
    kInt64,
    kUint64
  };
  /// How numbers and characters are stored: mostly in the smallest type that holds them all.
  enum Stored : std::uint32_t {
    kStoredInt8 = 1,
    kStoredUint8 = 2,
    kStoredInt16 = 3,
    kStoredUint16 = 4,
    kStoredInt32 = 5,
    kStoredUint32 = 6,
    kStoredSingle = 7,
    kStoredDouble = 9,
    kStoredInt64 = 12,
    kStoredUint64 = 13,
    kStoredUtf8 = 16,
    kStoredUtf16 = 17
  };

  int class_code = kDouble;  ///< may be another than the above: nothing else of it is read then
  bool is_complex = false;
  bool is_logical = false;
  bool is_little_endian = true;
  std::vector<std::size_t> dims;         ///< 2 to 8, the first one fastest
  std::size_t size = 0;                  ///< their product
  std::string name;                      ///< of a variable
  std::uint32_t stored = kStoredDouble;  ///< numbers and text
  std::string_view data;                 ///< numbers and text: `size` values, UTF-8 perhaps more
  std::vector<std::string> fields;       ///< struct: their names, each once
  /// Cells: one for each. Struct: `fields` for the first element, then for the second, ..
  std::vector<std::string_view> arrays;
};

/// Reads the array whose content (behind its tag) is `bytes`; none at all is an empty array. Throws
/// std::invalid_argument("expected .., got ..").
MatArray parse_mat_array(std::string_view bytes, bool is_little_endian);

/// A variable and the bytes that it points into.
struct MatVariable {
  std::shared_ptr<const std::string> bytes;
  MatArray array;
};

/// Reads the variable `name` from a MATLAB version 5 file (what MATLAB's `save -v6` and `-v7`
/// write; compressed or not). The file's elements must fill it exactly, and every compressed one
/// must match its checksum and inflate to the size it says, at most 1 GiB. Throws InputError naming
/// the file. Memory: the file and its largest variable. Thread safe.
MatVariable read_mat_variable(const std::filesystem::path& file, const std::string& name);

}  // namespace eventgan
