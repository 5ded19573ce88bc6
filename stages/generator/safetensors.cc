#include "stages/generator/safetensors.h"

#include <bit>
#include <cstring>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace eventgan {
namespace {

static_assert(std::endian::native == std::endian::little, "tensors are stored little endian");

using nlohmann::json;

constexpr std::size_t kAlignment = 8;

[[noreturn]] void fail(const std::string& what, const std::string& name) {
  throw std::runtime_error("expected " + what + ", in " + name);
}

/// Product of the shape, or a failure where it is negative or more than `limit` values.
std::size_t value_count(const std::vector<std::int64_t>& shape, std::size_t limit,
                        const std::string& name) {
  std::size_t count = 1;
  for (const std::int64_t side : shape) {
    if (side < 0 || (side > 0 && count > limit / static_cast<std::size_t>(side))) {
      fail("a tensor no larger than the file, got a side of " + std::to_string(side), name);
    }
    count *= static_cast<std::size_t>(side);
  }
  return count;
}

}  // namespace

std::string serialize_safetensors(const SafetensorsFile& content) {
  json header = json::object();
  if (!content.metadata.empty()) header["__metadata__"] = content.metadata;
  std::size_t offset = 0;
  for (const auto& [tensor_name, tensor] : content.tensors) {
    const std::size_t end = offset + tensor.values.size() * sizeof(float);
    header[tensor_name] = {
        {"dtype", "F32"}, {"shape", tensor.shape}, {"data_offsets", {offset, end}}};
    offset = end;
  }
  std::string text = header.dump();
  text.resize((text.size() + kAlignment - 1) / kAlignment * kAlignment, ' ');

  const std::uint64_t length = text.size();
  std::string bytes(sizeof length, '\0');
  std::memcpy(bytes.data(), &length, sizeof length);
  bytes += text;
  for (const auto& [tensor_name, tensor] : content.tensors) {
    bytes.append(reinterpret_cast<const char*>(tensor.values.data()),
                 tensor.values.size() * sizeof(float));
  }
  return bytes;
}

SafetensorsFile parse_safetensors(const std::string& bytes, const std::string& name) try {
  std::uint64_t length = 0;
  if (bytes.size() < sizeof length)
    fail("a safetensors header of 8 bytes, got a shorter file", name);
  std::memcpy(&length, bytes.data(), sizeof length);
  if (length > bytes.size() - sizeof length) {
    fail("a header inside the file, got a length of " + std::to_string(length) + " bytes", name);
  }
  const char* text = bytes.data() + sizeof length;
  const json header = json::parse(text, text + length);
  const char* data = text + length;
  const std::size_t data_size = bytes.size() - sizeof length - length;

  SafetensorsFile content;
  std::map<std::size_t, std::size_t>
      extents;  // begin → end of every tensor, to find holes and overlaps
  for (const auto& [key, entry] : header.items()) {
    if (key == "__metadata__") {
      content.metadata = entry.get<std::map<std::string, std::string>>();
      continue;
    }
    if (entry.at("dtype") != "F32")
      fail("dtype F32 for " + key + ", got " + entry.at("dtype").dump(), name);
    NamedTensor tensor{entry.at("shape").get<std::vector<std::int64_t>>(), {}};
    const auto [begin, end] = entry.at("data_offsets").get<std::pair<std::size_t, std::size_t>>();
    const std::size_t count = value_count(tensor.shape, data_size / sizeof(float), name);
    if (begin > end || end > data_size || end - begin != count * sizeof(float)) {
      fail(std::to_string(count * sizeof(float)) + " bytes inside the file for " + key +
               ", got offsets " + std::to_string(begin) + " to " + std::to_string(end),
           name);
    }
    tensor.values.resize(count);
    if (count > 0) std::memcpy(tensor.values.data(), data + begin, end - begin);
    if (begin != end && !extents.emplace(begin, end).second)
      fail("tensors apart from each other, got two at byte " + std::to_string(begin), name);
    content.tensors.emplace(key, std::move(tensor));
  }
  std::size_t expected = 0;
  for (const auto& [begin, end] : extents) {
    if (begin != expected)
      fail("tensors without holes or overlap, got a gap at byte " + std::to_string(expected), name);
    expected = end;
  }
  if (expected != data_size)
    fail("no bytes behind the last tensor, got " + std::to_string(data_size - expected), name);
  return content;
} catch (const json::exception&) {
  std::throw_with_nested(
      std::runtime_error("expected a safetensors header, got malformed JSON, in " + name));
}

SafetensorsFile read_safetensors(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) fail("a readable weights file, got none", file.string());
  const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
  return parse_safetensors(bytes, file.string());
}

}  // namespace eventgan
