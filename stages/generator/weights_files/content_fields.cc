#include "stages/generator/weights_files/content_fields.h"

#include <charconv>
#include <stdexcept>

namespace eventgan {

int take_number(SafetensorsFile& content, const std::string& key, int largest) {
  const std::string text = content.metadata[key];
  int number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || number < 1 || number > largest) {
    throw std::runtime_error("expected metadata " + key + " in 1.." + std::to_string(largest) +
                             ", got \"" + text + "\"");
  }
  content.metadata.erase(key);
  return number;
}

std::vector<float> take_tensor(SafetensorsFile& content, const std::string& name,
                               const std::vector<std::int64_t>& shape) {
  auto node = content.tensors.extract(name);
  if (node.empty()) throw std::runtime_error("expected tensor " + name + ", got none");
  if (node.mapped().shape != shape) {
    throw std::runtime_error("expected another shape of tensor " + name);
  }
  return std::move(node.mapped().values);
}

}  // namespace eventgan
