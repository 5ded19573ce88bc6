#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/weights.h"

namespace eventgan {

/// Content of a safetensors file: float32 tensors and text.
struct SafetensorsFile {
  StateDict tensors;
  std::map<std::string, std::string> metadata;
};

/// A tensor to write, which stays where it is.
struct TensorView {
  std::vector<std::int64_t> shape;
  std::span<const float> values;  ///< C order, as many as the shape says
};

/// The file's bytes: 8-byte little-endian header length, header JSON padded with spaces to a
/// multiple of 8, then the tensors in the order of their names without gaps. The same content
/// gives the same bytes. Throws std::runtime_error where read_safetensors would refuse the header.
std::string serialize_safetensors(const SafetensorsFile& content);

/// The same from tensors that are elsewhere, without a copy of them beside the result.
std::string serialize_safetensors(const std::map<std::string, TensorView>& tensors,
                                  const std::map<std::string, std::string>& metadata);

/// Reads a file and checks all of it before use: a header of at most 8 MiB, lengths against the
/// file's size, dtype F32, shapes against byte counts, no gaps, no overlap. Takes at most twice
/// the file's size and 512 MiB. Throws std::runtime_error "expected X, got Y, in PATH".
SafetensorsFile read_safetensors(const std::filesystem::path& file);

/// The same from bytes; `name` stands for the file in messages.
SafetensorsFile parse_safetensors(std::string_view bytes, const std::string& name);

}  // namespace eventgan
