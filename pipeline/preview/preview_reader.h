#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "stages/events/images/preview_image.h"

namespace eventgan {

/// Frames of a sample, each [y, x, 3] uint8 blue green red, laid into the volume's frame; empty:
/// there is none, or it was not found.
struct SampleFrames {
  std::vector<std::uint8_t> previous_bgr;
  std::vector<std::uint8_t> next_bgr;
  std::vector<std::uint8_t> labelled_bgr;  ///< where the label lies between the two
};

/// Reads samples as images show them.
class PreviewReader {
 public:
  /// Relative frame paths start at `frames`. `warnings`, which outlives this, gets a line for each
  /// frame that cannot be shown.
  PreviewReader(const std::filesystem::path& frames, std::vector<std::string>& warnings);
  ~PreviewReader();
  PreviewReader(PreviewReader&&) noexcept;

  /// What an image of the sample shows. The shard stays open until another one is asked for.
  /// Throws as ShardReader does.
  PreviewContent content(const std::filesystem::path& shard, int slot);

  /// The frames alone, `with_labelled` or without. Throws as ShardReader does.
  SampleFrames frames(const std::filesystem::path& shard, int slot, bool with_labelled);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace eventgan
