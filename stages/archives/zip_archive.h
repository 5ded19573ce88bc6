#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace eventgan {

/// Read access to a zip file (PyTorch checkpoints, .npz). Throws std::runtime_error naming the file
/// and the member. Not thread safe.
class ZipArchive {
 public:
  explicit ZipArchive(const std::filesystem::path& file);
  ~ZipArchive();

  /// Member names in the archive's order.
  const std::vector<std::string>& names() const;

  bool contains(const std::string& name) const;

  /// A whole member. Its declared size is not trusted: a stored member may not be larger than the
  /// file, a deflated one not larger than deflate can make of it (1032:1); the checksum must be
  /// right.
  std::vector<std::byte> read(const std::string& name) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace eventgan
