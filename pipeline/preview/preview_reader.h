#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "stages/events/pictures/preview_picture.h"

namespace eventgan {

/// Reads samples as pictures show them.
class PreviewReader {
 public:
  /// Relative frame paths start at `frames`. `warnings`, which outlives this, gets a line for each
  /// frame that cannot be shown.
  PreviewReader(std::filesystem::path frames, std::vector<std::string>& warnings);
  ~PreviewReader();
  PreviewReader(PreviewReader&&) noexcept;

  /// What a picture of the sample shows. The shard stays open until another one is asked for.
  /// Throws as ShardReader does.
  PreviewContent content(const std::filesystem::path& shard, int slot);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace eventgan
