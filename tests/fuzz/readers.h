#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

namespace eventgan::testing {

// What a fuzz target does with one input, and the replay of the corpus too: the reader either reads
// it or throws InputError (safetensors on bytes: std::runtime_error). Anything else leaves as it is
// and ends the target. `scratch` is a file to use; it is overwritten.

/// A checkpoint of either format: its networks "gen" and "dis".
void read_checkpoint_input(std::span<const std::uint8_t> input,
                           const std::filesystem::path& scratch);

/// The pickle of a checkpoint in the zip format, put into a sound zip file with one storage "0" of
/// 64 bytes: random changes to a whole zip file seldom get past its checksums.
void read_zip_pickle_input(std::span<const std::uint8_t> input,
                           const std::filesystem::path& scratch);

/// A weights file.
void read_safetensors_input(std::span<const std::uint8_t> input,
                            const std::filesystem::path& scratch);

/// What reading a MATLAB file may take: no deflate stream grows by more than the first factor, and
/// eight bytes, an array without values, become a field of a name in JSON, as value and as text.
constexpr std::uint64_t most_mat_memory(std::uint64_t file_size) {
  return file_size * 1032 * 64 + (std::uint64_t{32} << 20);
}

/// A MATLAB file: its variables "RELEASE" and "annolist_keyframes", with all that is in them.
void read_mat_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch);

/// What reading a CDF file may take: the file inflated, its variable inflated, and the numbers of
/// that, each at most 64 MiB.
constexpr std::uint64_t most_cdf_memory(std::uint64_t) { return std::uint64_t{200} << 20; }

/// A CDF file: its variable "Pose".
void read_cdf_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch);

}  // namespace eventgan::testing
