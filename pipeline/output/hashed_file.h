#pragma once

#include <filesystem>
#include <fstream>
#include <streambuf>
#include <string>
#include <vector>

#include "stages/files/sha256.h"

namespace eventgan {

/// A file that is hashed as it is read: what was parsed and what was hashed are the same bytes, and
/// a large file is read once. To be read through a std::istream; its errors are std::system_error
/// naming the path, which the stream passes on if its exceptions include badbit.
class HashedFile : public std::streambuf {
 public:
  explicit HashedFile(const std::filesystem::path& file);

  bool is_open() const { return file_.is_open(); }

  /// SHA-256 of the file up to where the last block read ends: of the whole file once the stream
  /// has met its end.
  std::string hash_of_read() const { return hash_.hex(); }

 protected:
  int_type underflow() override;

 private:
  std::filesystem::path path_;
  std::ifstream file_;
  std::vector<char> block_;
  Sha256 hash_;
};

}  // namespace eventgan
