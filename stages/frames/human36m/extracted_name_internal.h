#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace eventgan {

/// What the name of an extracted picture says:
/// "S1/S1_Directions_1.54138969/S1_Directions_1.54138969_000006.jpg".
struct ExtractedName {
  std::string folder;    ///< "S1/S1_Directions_1.54138969", below the root
  std::string sequence;  ///< "S1_Directions_1.54138969"
  std::string subject;   ///< "S1"
  std::string camera;    ///< "54138969"
  std::int64_t number = 0;
};

/// Takes a path below the root, or a bare file name, for which the folder follows from the name.
/// Throws std::invalid_argument "expected X, got Y".
ExtractedName parse_extracted_name(std::string_view name);

}  // namespace eventgan
