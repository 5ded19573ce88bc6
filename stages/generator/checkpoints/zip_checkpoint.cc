#include "stages/generator/checkpoints/zip_checkpoint.h"

#include <stdexcept>

#include "stages/archives/file_bytes.h"
#include "stages/archives/zip_archive.h"
#include "stages/generator/checkpoints/checkpoint_limits.h"

namespace eventgan {
namespace {

constexpr std::string_view kPickle = "data.pkl";

class ZipCheckpoint : public CheckpointArchive {
 public:
  explicit ZipCheckpoint(const std::filesystem::path& file)
      : archive_(file), prefix_(find_prefix(archive_)), document_(read_pickle(file)) {}

  const PickleDocument& document() const override { return document_; }

  std::vector<std::byte> storage(const std::string& key, std::uint64_t most_bytes) const override {
    return archive_.read(prefix_ + "data/" + key, most_bytes);
  }

 private:
  static std::string find_prefix(const ZipArchive& archive) {
    for (const std::string& name : archive.names()) {
      if (name == kPickle || name.ends_with("/" + std::string(kPickle))) {
        return name.substr(0, name.size() - kPickle.size());
      }
    }
    throw std::runtime_error(
        "expected a PyTorch checkpoint with data.pkl inside, got another zip "
        "file");
  }

  PickleDocument read_pickle(const std::filesystem::path& file) const {
    const std::uint64_t size = FileBytes(file).size_bytes();
    const std::string name = prefix_ + std::string(kPickle);
    const std::vector<std::byte> pickle = archive_.read(name, most_pickle_bytes(size));
    return PickleDocument(pickle, checkpoint_globals(), file.string() + ":" + name, nullptr,
                          most_pickle_memory(size));
  }

  ZipArchive archive_;
  std::string prefix_;
  PickleDocument document_;
};

}  // namespace

std::unique_ptr<CheckpointArchive> open_zip_checkpoint(const std::filesystem::path& file) {
  return std::make_unique<ZipCheckpoint>(file);
}

}  // namespace eventgan
