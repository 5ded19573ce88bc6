#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <vector>

namespace eventgan {

/// Read access to a zip file of at most 65536 members (PyTorch checkpoints, .npz), so that its list
/// of members takes less than 32 MiB. Throws std::runtime_error naming the file and the member;
/// LimitReached as InputFile does. Not thread safe.
class ZipArchive {
 public:
  explicit ZipArchive(const std::filesystem::path& file);
  ~ZipArchive();

  /// Member names in the archive's order.
  const std::vector<std::string>& names() const;

  bool contains(const std::string& name) const;

  /// A whole member of at most `most_bytes`. Its declared size is not trusted: a stored member may
  /// not be larger than the file, a deflated one not larger than deflate can make of it (1032:1);
  /// the checksum must be right.
  std::vector<std::byte> read(
      const std::string& name,
      std::uint64_t most_bytes = std::numeric_limits<std::uint64_t>::max()) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace eventgan
