#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "manifests/image_size.h"
#include "stages/hdf5/hdf5_output_file_internal.h"
#include "stages/recordings/growing_dataset_internal.h"

namespace eventgan {

/// The objects of a new file in MVSEC's layout: what is written, in any order of calls. Use it,
/// and end it, within an Hdf5Turn. Throws Hdf5Error; whether the bytes reached the disk says
/// `check`.
class MvsecFile {
 public:
  MvsecFile(const std::filesystem::path& path, ImageSize size, const std::string& settings);

  void append_events(std::span<const double> rows) { events_->append(rows); }  ///< [events, 4]
  void append_frame(std::span<const std::uint8_t> pixels) { frames_->append(pixels); }  ///< [y, x]
  void append_flow(std::span<const float> x_px, std::span<const float> y_px);

  /// Throws std::runtime_error if any write has failed.
  void check() const { file_.check(); }

  /// Writes the frames' times and event indices, and closes everything.
  void close(const std::vector<double>& times_s, const std::vector<std::int64_t>& event_index);

 private:
  ImageSize size_;
  Hdf5OutputFile file_;
  std::optional<GrowingDataset<double>> events_;
  std::optional<GrowingDataset<std::uint8_t>> frames_;
  std::optional<GrowingDataset<float>> flow_;
};

}  // namespace eventgan
