#pragma once

#include <functional>
#include <ostream>
#include <string>
#include <vector>

namespace eventgan::testing {

/// A manifest that is right; cases change it.
extern const char kSoundManifest[];

/// A change of one place of a document.
struct Edit {
  std::string pointer;  ///< JSON pointer
  std::string value;    ///< JSON text; empty: remove what is there
};

/// The sound manifest with some changes, and what is wrong with it then.
struct ManifestCase {
  std::string name;
  std::vector<Edit> edits;
  std::vector<std::string> faults;  ///< lines after the document's name; empty: nothing is wrong
  bool beyond_schema = false;       ///< JSON Schema cannot express what is wrong
};

/// A JSON text with some changes.
std::string edited(const char* sound, const std::vector<Edit>& edits);

/// That the sound text with the case's changes has its faults, each after the document's name "d",
/// and that the schema sees them.
void expect_faults(const ManifestCase& manifest_case, const char* sound, const char* schema,
                   const std::function<void(const std::string& text)>& parse);

/// What a test of all cases calls one: its name in letters, digits and "_".
std::string test_name(const ManifestCase& manifest_case);

/// Every rule of the manifest, kept and broken: those of the whole and of its top keys, of its
/// sources, of its other sections.
std::vector<ManifestCase> manifest_cases();
std::vector<ManifestCase> top_cases();
std::vector<ManifestCase> source_cases();
std::vector<ManifestCase> setting_cases();
std::vector<ManifestCase> generator_cases();

/// What names must be, as messages say it.
inline const std::string kNameRule =
    R"(expected 1..64 letters, digits, ".", "_" or "-", not beginning with "." or "-", got )";

/// What the generator's weights must be.
inline const std::string kWeightsRule =
    R"(expected the path of a .safetensors file, "shipped", "shipped:sensor", or "shipped:WIDTH" or )"
    R"("untrained:WIDTH" with WIDTH in 1..64, got )";

inline void PrintTo(const ManifestCase& manifest_case, std::ostream* stream) {
  *stream << manifest_case.name;
}

}  // namespace eventgan::testing
