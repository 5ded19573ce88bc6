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
/// of members takes less than 32 MiB. Opening it reads that list, and no members. Throws
/// std::runtime_error naming the file and the member; LimitReached as InputFile does. Not thread
/// safe.
class ZipArchive {
 public:
  explicit ZipArchive(const std::filesystem::path& file);
  ~ZipArchive();

  /// Member names in the archive's order.
  const std::vector<std::string>& names() const;

  bool contains(const std::string& name) const;

  /// The size that a member declares. It is not trusted, but refused if the file cannot hold it: a
  /// stored member may not be larger than the file, a deflated one not larger than deflate can make
  /// of it (1032:1).
  std::uint64_t size_bytes(const std::string& name) const;

  /// A whole member of at most `most_bytes`. Its size must be as declared (see size_bytes), and its
  /// checksum right.
  std::vector<std::byte> read(
      const std::string& name,
      std::uint64_t most_bytes = std::numeric_limits<std::uint64_t>::max()) const;

  /// `count` bytes of a member from byte `offset` on, which must lie within its declared size (see
  /// size_bytes). Of a stored member no others are read; of a deflated one all before
  /// them are inflated and thrown away, 64 KiB at a time. The checksum is of the whole member and
  /// cannot be compared: damage that leaves the sizes right is not found.
  std::vector<std::byte> read_part(const std::string& name, std::uint64_t offset,
                                   std::uint64_t count) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace eventgan
