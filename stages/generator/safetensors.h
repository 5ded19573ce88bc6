#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "stages/generator/state_dict.h"

namespace eventgan {

/// Content of a safetensors file: float32 tensors and text.
struct SafetensorsFile {
  StateDict tensors;
  std::map<std::string, std::string> metadata;
};

/// The file's bytes: 8-byte little-endian header length, header JSON padded with spaces to a
/// multiple of 8, then the tensors in the order of their names without holes. The same content
/// gives the same bytes.
std::string serialize_safetensors(const SafetensorsFile& content);

/// Reads a file and checks all of it before use: lengths against the file's size, dtype F32, shapes
/// against byte counts, no holes, no overlap. Throws std::runtime_error "expected X, got Y, in
/// PATH".
SafetensorsFile read_safetensors(const std::filesystem::path& file);

/// The same from bytes; `name` stands for the file in messages.
SafetensorsFile parse_safetensors(const std::string& bytes, const std::string& name);

}  // namespace eventgan
