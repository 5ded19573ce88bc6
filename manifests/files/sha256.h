#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "manifests/files/input_file.h"

namespace eventgan {

/// SHA-256 of bytes that come in pieces. For one thread at a time.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(Sha256&&) noexcept;
  Sha256& operator=(Sha256&&) noexcept;

  void update(std::span<const std::byte> bytes);
  void update(std::string_view text);

  /// Of all pieces so far, as 64 lower-case hex digits; more may follow.
  std::string hex() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// SHA-256 as 64 lower-case hex digits. Thread safe.
std::string sha256_hex(std::span<const std::byte> bytes);
std::string sha256_hex(std::string_view text);

/// Of a file's content, read in blocks. The second throws std::runtime_error "cannot read PATH:
/// REASON" if it cannot be opened.
std::string sha256_of(const InputFile& file);
std::string sha256_of_file(const std::filesystem::path& file);

}  // namespace eventgan
