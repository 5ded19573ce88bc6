#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace eventgan {

// Files as bytes, the same for the same content: no times, no owners. All thread safe.

/// A .npy file of format version 1: `dtype` is numpy's ("<f2", "|u1"), `values` the array in C
/// order, little endian. Throws std::invalid_argument if there are not as many bytes as shape and
/// dtype say.
std::string npy_file(std::string_view dtype, const std::vector<std::size_t>& shape,
                     std::span<const std::byte> values);

/// The same of a vector of numbers.
template <class Number>
std::string npy_file(std::string_view dtype, const std::vector<std::size_t>& shape,
                     const std::vector<Number>& values) {
  return npy_file(dtype, shape, std::as_bytes(std::span(values)));
}

/// A list of text, "<U" of the longest one; what is not UTF-8 becomes U+FFFD.
std::string npy_texts(const std::vector<std::string>& texts);

/// A .npz file: a zip of NAME.npy members, deflated, dated 1980-01-01. Throws std::runtime_error if
/// libzip fails.
std::string npz_file(const std::vector<std::pair<std::string, std::string>>& arrays);

/// One member of a tar file (POSIX ustar): header, bytes, padding; mode 0644, owner 0, time 0.
/// Throws std::invalid_argument for a name that is empty or longer than 100 bytes, or 8 GiB and
/// more.
std::string tar_member(std::string_view name, std::string_view bytes);

/// What stands at a tar file's end.
std::string tar_end();

}  // namespace eventgan
