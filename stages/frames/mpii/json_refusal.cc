#include <stdexcept>

#include "manifests/strict_json/json_text_internal.h"
#include "stages/frames/mpii/json_refusal_internal.h"

namespace eventgan {

void refuse_json(const std::string& where, const std::string& expected,
                 const nlohmann::ordered_json& got) {
  constexpr std::size_t kReadable = 80;
  std::string text = dump_json(got, JsonLayout::kAsciiLine);
  if (text.size() > kReadable) text = text.substr(0, kReadable) + "...";
  throw std::invalid_argument("expected " + expected + ", got " + text + " at " + where);
}

}  // namespace eventgan
