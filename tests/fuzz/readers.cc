#include "tests/fuzz/readers.h"

#include <cstdlib>
#include <fstream>
#include <stdexcept>

#include "manifests/values/faults.h"
#include "stages/base/archives/cdf_matrix.h"
#include "stages/frames/mpii/detail/mat_json.h"
#include "stages/generator/checkpoints/checkpoint.h"
#include "stages/generator/checkpoints/fold.h"
#include "stages/generator/safetensors.h"
#include "stages/generator/weights_file.h"
#include "tests/testing/zip_file.h"

namespace eventgan::testing {
namespace {

std::string text_of(std::span<const std::uint8_t> input) { return {input.begin(), input.end()}; }

/// Lengths, not values: any bytes are numbers.
void check_sizes(const StateDict& state) {
  for (const auto& [name, tensor] : state) {
    std::int64_t count = 1;
    for (const std::int64_t side : tensor.shape) count *= side;
    if (static_cast<std::size_t>(count) != tensor.values.size()) std::abort();
  }
}

void read_networks(const std::filesystem::path& file) {
  for (const char* network : {"gen", "dis"}) {
    StateDict state;
    try {
      state = read_checkpoint(file, network);
    } catch (const InputError&) {
      continue;
    }
    check_sizes(state);
    try {
      fold_generator(std::move(state), "input");
    } catch (const std::runtime_error&) {
    }
  }
}

}  // namespace

void read_checkpoint_input(std::span<const std::uint8_t> input,
                           const std::filesystem::path& scratch) {
  std::ofstream(scratch, std::ios::binary) << text_of(input);
  read_networks(scratch);
}

void read_zip_pickle_input(std::span<const std::uint8_t> input,
                           const std::filesystem::path& scratch) {
  std::filesystem::remove(scratch);
  write_zip(scratch, {{"name/data.pkl", text_of(input)}, {"name/data/0", std::string(64, '\1')}});
  read_networks(scratch);
}

void read_safetensors_input(std::span<const std::uint8_t> input, const std::filesystem::path&) {
  const std::string bytes = text_of(input);
  try {
    const SafetensorsFile content = parse_safetensors(bytes, "input");
    check_sizes(content.tensors);
    // What is read is written and read again as the same.
    const std::string written = serialize_safetensors(content);
    if (serialize_safetensors(parse_safetensors(written, "written")) != written) std::abort();
  } catch (const std::runtime_error&) {
  }
  try {
    parse_weights(bytes, "input");
  } catch (const InputError&) {
  }
}

void read_mat_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch) {
  std::ofstream(scratch, std::ios::binary) << text_of(input);
  for (const char* name : {"RELEASE", "annolist_keyframes"}) {
    try {
      const MatVariable variable = read_mat_variable(scratch, name);
      mat_to_json(variable.array).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
    } catch (const InputError&) {
    } catch (const std::invalid_argument&) {  // of what lies below the variable's own header
    }
  }
}

void read_cdf_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch) {
  std::ofstream(scratch, std::ios::binary) << text_of(input);
  try {
    const TypedArray matrix = read_cdf_matrix(scratch, "Pose");
    if (matrix.size() != matrix.shape.at(0) * matrix.shape.at(1)) std::abort();
  } catch (const std::runtime_error&) {
  }
}

}  // namespace eventgan::testing
