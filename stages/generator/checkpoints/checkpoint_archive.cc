#include "stages/generator/checkpoints/checkpoint_archive.h"

#include <cstring>
#include <map>
#include <span>
#include <stdexcept>

#include "manifests/files/input_file.h"
#include "stages/base/archives/zip_archive.h"
#include "stages/generator/checkpoints/stored_tensor.h"

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
    const std::uint64_t size = InputFile(file).size_bytes();
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

namespace {

using Kind = PickleNode::Kind;

/// 0x1950a86a20f9469cfc6c, little endian as a pickle has it.
constexpr std::string_view kMagic = "\x6c\xfc\x9c\x46\xf9\x20\x6a\xa8\x50\x19";
constexpr std::int64_t kProtocolVersion = 1001;

/// Where a storage's values are in the file.
struct StorageExtent {
  std::uint64_t begin = 0;
  std::uint64_t size_bytes = 0;
};

class LegacyCheckpoint : public CheckpointArchive {
 public:
  explicit LegacyCheckpoint(const std::filesystem::path& file)
      : bytes_(file), name_(file.string()), document_(read_pickles()) {
    find_storages();
    keys_.reset();
  }

  const PickleDocument& document() const override { return document_; }

  std::vector<std::byte> storage(const std::string& key, std::uint64_t most_bytes) const override {
    const auto found = storages_.find(key);
    if (found == storages_.end()) fail("storage " + printable(key), "none");
    const StorageExtent& extent = found->second;
    if (extent.size_bytes > most_bytes) {
      fail("a storage of at most " + std::to_string(most_bytes) + " bytes",
           std::to_string(extent.size_bytes));
    }
    return bytes_.read_bytes(extent.begin, extent.size_bytes);
  }

 private:
  [[noreturn]] void fail(const std::string& expected, const std::string& got) const {
    throw std::runtime_error("expected " + expected + ", got " + got + ", in " + name_);
  }

  /// Reads the five pickles; sets keys_ and values_begin_.
  PickleDocument read_pickles() {
    const std::uint64_t size = bytes_.size_bytes();
    const std::vector<std::byte> head =
        bytes_.read_bytes(0, std::min(size, most_pickle_bytes(size)));
    std::uint64_t memory = most_pickle_memory(size);
    const auto next = [&](const char* what, const std::set<std::string>& globals) {
      std::size_t used = 0;
      PickleDocument document(
          std::span<const std::byte>(head).subspan(values_begin_), globals,
          name_ + " (" + what + ", from byte " + std::to_string(values_begin_) + ")", &used,
          memory);
      values_begin_ += used;
      memory -= document.memory_bytes();
      return document;
    };
    check_magic(next("magic number", {}).root());
    check_version(next("protocol version", {}).root());
    check_machine(next("system information", {}).root());
    PickleDocument data = next("data", checkpoint_globals());
    keys_ = std::make_unique<PickleDocument>(next("storage keys", {}));
    return data;
  }

  void check_magic(const PickleNode& magic) const {
    if (magic.kind != Kind::kLong || magic.text != kMagic) {
      fail("PyTorch's magic number", "another pickle");
    }
  }

  void check_version(const PickleNode& version) const {
    if (version.kind != Kind::kInt || version.integer != kProtocolVersion) {
      fail("protocol version 1001",
           version.kind == Kind::kInt ? std::to_string(version.integer) : describe(version.kind));
    }
  }

  void check_machine(const PickleNode& machine) const {
    const PickleNode* little_endian = machine.find("little_endian");
    if (little_endian == nullptr || little_endian->kind != Kind::kBool) {
      fail("system information that says whether it is little endian", "none");
    }
    if (little_endian->integer == 0) {
      fail("a checkpoint of a little-endian machine", "one of a big-endian machine");
    }
  }

  /// What the data says of its storages, by key.
  std::map<std::string, StorageId> named_storages() const {
    std::map<std::string, StorageId> storages;
    for (const PickleNode& node : document_.nodes()) {
      if (node.kind != Kind::kPersistent) continue;
      StorageId id = parse_storage_id(node);
      const auto [first, is_new] = storages.try_emplace(id.key, id);
      if (!is_new && (first->second.count != id.count ||
                      first->second.number.size_bytes != id.number.size_bytes)) {
        fail("one size of storage " + printable(id.key), "two");
      }
    }
    return storages;
  }

  void find_storages() {
    const std::map<std::string, StorageId> named = named_storages();
    const PickleNode& keys = keys_->root();
    if (keys.kind != Kind::kList) fail("a list of storage keys", describe(keys.kind));
    std::uint64_t at = values_begin_;
    for (std::size_t i = 0; i < keys.items.size(); ++i) {
      const std::string& key = checkpoint_text(keys, i, "a storage's key");
      const auto found = named.find(key);
      if (found == named.end()) fail("a storage that the data names", "key " + printable(key));
      const StorageId& id = found->second;
      const std::int64_t count = read_count(at);
      at += sizeof count;
      const std::uint64_t left = bytes_.size_bytes() - at;
      if (count != id.count || static_cast<std::uint64_t>(count) > left / id.number.size_bytes) {
        fail(std::to_string(id.count) + " values of storage " + printable(key) + " inside the file",
             std::to_string(count) + " with " + std::to_string(left) + " bytes left");
      }
      const std::uint64_t size_bytes = static_cast<std::uint64_t>(count) * id.number.size_bytes;
      if (!storages_.emplace(key, StorageExtent{at, size_bytes}).second) {
        fail("each storage once", "storage " + printable(key) + " twice");
      }
      at += size_bytes;
    }
  }

  std::int64_t read_count(std::uint64_t at) const {
    std::int64_t count = 0;
    std::memcpy(&count, bytes_.read(at, sizeof count).data(), sizeof count);
    return count;
  }

  InputFile bytes_;
  std::string name_;
  std::uint64_t values_begin_ = 0;
  std::unique_ptr<PickleDocument> keys_;
  PickleDocument document_;
  std::map<std::string, StorageExtent> storages_;
};

}  // namespace

std::unique_ptr<CheckpointArchive> open_legacy_checkpoint(const std::filesystem::path& file) {
  return std::make_unique<LegacyCheckpoint>(file);
}

}  // namespace eventgan
