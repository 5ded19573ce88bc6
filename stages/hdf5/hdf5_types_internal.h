#pragma once

#include <cstdint>
#include <string>
#include <type_traits>

#include "manifests/job_manifest.h"
#include "stages/hdf5/hdf5_handle_internal.h"
#include "stages/shards/shard_tables.h"

namespace eventgan {

/// Variable-length UTF-8.
Hdf5Handle text_type();

/// Variable-length sequences of uint8.
Hdf5Handle bytes_type();

/// A number as it stands in files: little endian, as the machines are that this program runs on, so
/// that it serves for memory too. `size` in bytes.
Hdf5Handle number_type(std::size_t size, bool is_float, bool is_signed);

/// The type of `/events/volume`.
Hdf5Handle volume_type(StoredType type);

/// HDF5's type of a column's elements: numbers, std::string for text, Bytes.
template <class Element>
Hdf5Handle element_type() {
  if constexpr (std::is_same_v<Element, std::string>) {
    return text_type();
  } else if constexpr (std::is_same_v<Element, Bytes>) {
    return bytes_type();
  } else {
    return number_type(sizeof(Element), std::is_floating_point_v<Element>,
                       std::is_signed_v<Element>);
  }
}

/// numpy's name for the same: "int64", "uint8", "float32"…; else "str" and "bytes".
template <class Element>
std::string type_name() {
  if constexpr (std::is_same_v<Element, std::string>) {
    return "str";
  } else if constexpr (std::is_same_v<Element, Bytes>) {
    return "bytes";
  } else {
    const std::string bits = std::to_string(8 * sizeof(Element));
    if (std::is_floating_point_v<Element>) return "float" + bits;
    return (std::is_signed_v<Element> ? "int" : "uint") + bits;
  }
}

}  // namespace eventgan
