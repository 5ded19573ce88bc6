#include "stages/generator/safetensors.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "manifests/documents/json_text.h"
#include "manifests/files/input_file.h"

namespace eventgan {
namespace {

static_assert(std::endian::native == std::endian::little, "tensors are stored little endian");

using nlohmann::json;

constexpr std::size_t kAlignment = 8;

/// JSON grows when it is parsed. A training's checkpoint has a line for each recording.
constexpr std::uint64_t kLargestHeader = 8 << 20;

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

/// A list of integers of at least 0: JSON's 1.5, true and -1 would be converted without a word.
std::vector<std::int64_t> sizes(const json& list, const std::string& key, const std::string& name) {
  const bool good =
      list.is_array() && std::all_of(list.begin(), list.end(), [](const json& size) {
        return size.is_number_unsigned() &&
               size.get<std::uint64_t>() <= std::uint64_t{std::numeric_limits<std::int64_t>::max()};
      });
  if (!good) fail("a list of sizes for " + key + ", got " + list.dump().substr(0, 80), name);
  return list.get<std::vector<std::int64_t>>();
}

json parse_header(std::string_view text, const std::string& name) {
  // As the format's own reader: no white space before the object, each key once.
  if (!text.starts_with('{')) fail("a header that begins with {, got another one", name);
  return parse_json_data(text, name);
}

}  // namespace

std::string serialize_safetensors(const SafetensorsFile& content) {
  std::map<std::string, TensorView> tensors;
  for (const auto& [name, tensor] : content.tensors) tensors[name] = {tensor.shape, tensor.values};
  return serialize_safetensors(tensors, content.metadata);
}

std::string serialize_safetensors(const std::map<std::string, TensorView>& tensors,
                                  const std::map<std::string, std::string>& metadata) {
  json header = json::object();
  if (!metadata.empty()) header["__metadata__"] = metadata;
  std::size_t data_size = 0;
  for (const auto& [tensor_name, tensor] : tensors) {
    const std::size_t end = data_size + tensor.values.size_bytes();
    header[tensor_name] = {
        {"dtype", "F32"}, {"shape", tensor.shape}, {"data_offsets", {data_size, end}}};
    data_size = end;
  }
  std::string text = header.dump();
  if (text.size() > kLargestHeader) {
    throw std::runtime_error("expected a header of at most " + std::to_string(kLargestHeader) +
                             " bytes, got " + std::to_string(text.size()) +
                             " (texts in it, such as a manifest's, are too long)");
  }
  text.resize((text.size() + kAlignment - 1) / kAlignment * kAlignment, ' ');

  const std::uint64_t length = text.size();
  std::string bytes;
  bytes.reserve(sizeof length + text.size() + data_size);
  bytes.append(reinterpret_cast<const char*>(&length), sizeof length);
  bytes += text;
  for (const auto& [tensor_name, tensor] : tensors) {
    bytes.append(reinterpret_cast<const char*>(tensor.values.data()), tensor.values.size_bytes());
  }
  return bytes;
}

SafetensorsFile parse_safetensors(std::string_view bytes, const std::string& name) try {
  std::uint64_t length = 0;
  if (bytes.size() < sizeof length)
    fail("a safetensors header of 8 bytes, got a shorter file", name);
  std::memcpy(&length, bytes.data(), sizeof length);
  if (length > bytes.size() - sizeof length) {
    fail("a header inside the file, got a length of " + std::to_string(length) + " bytes", name);
  }
  if (length > kLargestHeader) {
    fail("a header of at most " + std::to_string(kLargestHeader) + " bytes, got one of " +
             std::to_string(length),
         name);
  }
  const json header = parse_header(bytes.substr(sizeof length, length), name);
  const char* data = bytes.data() + sizeof length + length;
  const std::size_t data_size = bytes.size() - sizeof length - length;

  SafetensorsFile content;
  std::map<std::size_t, std::size_t>
      extents;  // begin → end of every tensor, to find gaps and overlaps
  for (const auto& [key, entry] : header.items()) {
    if (key == "__metadata__") {
      content.metadata = entry.get<std::map<std::string, std::string>>();
      continue;
    }
    if (entry.at("dtype") != "F32")
      fail("dtype F32 for " + key + ", got " + entry.at("dtype").dump(), name);
    NamedTensor tensor{sizes(entry.at("shape"), key, name), {}};
    const std::vector<std::int64_t> offsets = sizes(entry.at("data_offsets"), key, name);
    if (offsets.size() != 2) fail("two offsets for " + key, name);
    const auto begin = static_cast<std::size_t>(offsets[0]);
    const auto end = static_cast<std::size_t>(offsets[1]);
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
  return parse_safetensors(InputFile(file).read_all(), file.string());
}

}  // namespace eventgan
