#include "pipeline/training/training_folder.h"

#include "stages/files/unfinished_files.h"

namespace eventgan {

namespace fs = std::filesystem;

void TrainingFolder::prepare() const {
  for (const fs::path& folder : {root, checkpoints(), pictures()}) {
    fs::create_directories(folder);
    remove_stale_temporaries(folder);
  }
}

void TrainingFolder::discard() const {
  // The checkpoints first: without them nothing goes on from the rest.
  for (const fs::path& file :
       {checkpoints() / "latest.safetensors", checkpoints() / "previous.safetensors",
        checkpoints() / "next.safetensors", checkpoints() / "damaged.safetensors", losses(),
        curves(), validation(), latest_weights(), weights()}) {
    fs::remove(file);
  }
  if (!fs::is_directory(pictures())) return;
  for (const auto& entry : fs::directory_iterator(pictures())) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("generator-") && name.ends_with(".png")) fs::remove(entry.path());
  }
}

}  // namespace eventgan
