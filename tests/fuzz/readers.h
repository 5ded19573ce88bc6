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

/// What reading labels may take: where all the text is faults of frames or empty elements, some
/// hundred bytes for each two or four.
constexpr std::uint64_t most_label_memory(std::uint64_t file_size) {
  return file_size * 512 + (std::uint64_t{1} << 20);
}

/// Labels of one's own: Pascal VOC's XML; MOT's gt.txt, and the same as seqinfo.ini; a table; a
/// COCO file with all its entries; YOLO's data.yaml, classes.txt and an image's text.
void read_voc_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch);
void read_mot_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch);
void read_csv_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch);
void read_coco_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch);
void read_mask_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch);
void read_yolo_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch);

/// What reading an image may take: a header may announce kMaxImagePixels.
constexpr std::uint64_t most_png_memory(std::uint64_t) { return std::uint64_t{512} << 20; }

/// 13 bytes of a PNG's header, the number of colours in its palette, these, and its rows, put into
/// a file with sound checksums: its colours and its numbers.
void read_png_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch);

/// What reading a recording in AEDAT 3.1 may take: a frame of its sensor, and its events.
constexpr std::uint64_t most_aedat3_memory(std::uint64_t file_size) {
  return file_size * 64 + (std::uint64_t{64} << 20);
}

/// A recording in AEDAT 3.1: all its events and frames.
void read_aedat3_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch);

/// What reading a recording in AEDAT 4.0 may take: of what is unpacked, at most 256 MiB and as much
/// again while that grows, its events and its XML, and what the unpackers keep.
constexpr std::uint64_t most_aedat4_memory(std::uint64_t) { return std::uint64_t{1536} << 20; }

/// A recording in AEDAT 4.0: all its events and frames.
void read_aedat4_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch);

/// What reading a recording of Prophesee's may take: a word of two bytes is twelve events at most.
constexpr std::uint64_t most_prophesee_memory(std::uint64_t file_size) {
  return file_size * 6 * 32 * 2 + (std::uint64_t{1} << 20);
}

/// A recording of Prophesee's: all its events.
void read_prophesee_input(std::span<const std::uint8_t> input,
                          const std::filesystem::path& scratch);

/// What reading a ROS bag may take: what bzip2 makes of a file of 16 KiB, and as much again while
/// that grows.
constexpr std::uint64_t most_rosbag_memory(std::uint64_t) { return std::uint64_t{1536} << 20; }

/// A ROS bag: all its events and frames.
void read_rosbag_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch);

/// What reading a table of events may take: deflate's growth, and an event for every four numbers.
constexpr std::uint64_t most_table_memory(std::uint64_t file_size) {
  return file_size * 1032 * 64 + (std::uint64_t{32} << 20);
}

/// Events as .npy, .npz and .csv, and boxes as .npy.
void read_table_input(std::span<const std::uint8_t> input, const std::filesystem::path& scratch);

}  // namespace eventgan::testing
