#include "stages/frames/dataset/label_name.h"

#include "manifests/documents/json_text.h"

namespace eventgan {

bool is_label_name(std::string_view text) { return !text.empty() && escape_controls(text) == text; }

}  // namespace eventgan
