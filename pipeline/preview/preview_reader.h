#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "stages/events/images/preview_image.h"

namespace eventgan {

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

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace eventgan
