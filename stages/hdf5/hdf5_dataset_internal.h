#pragma once

#include <string>
#include <vector>

#include "stages/hdf5/hdf5_handle_internal.h"
#include "stages/shards/shard_tables.h"

namespace eventgan {

using Dims = std::vector<hsize_t>;

/// Creation properties without time stamps, for H5P_DATASET_CREATE, H5P_GROUP_CREATE or
/// H5P_FILE_CREATE: a time in the file would make the same samples give other bytes.
Hdf5Handle creation_properties(hid_t object_class);

/// Adds the filters of every numeric dataset: shuffle, deflate unless `deflate_level` is 0,
/// fletcher32.
void set_filters(hid_t creation, int deflate_level, const std::string& path);

/// Shape of a dataset.
Dims dims_of(hid_t dataset, const std::string& path);

/// Writes a whole dataset: C order, chunks of up to 4096 rows, numbers with filters. A dataset
/// without elements has neither. Element: a number, std::string or Bytes.
template <class Element>
void write_dataset(hid_t file, const std::string& path, const std::vector<Element>& values,
                   const Dims& dims, int deflate_level);

/// Reads a whole dataset; `dims` gets its shape. Throws Hdf5Error, also if its type is another one.
template <class Element>
std::vector<Element> read_dataset(hid_t file, const std::string& path, Dims& dims);

}  // namespace eventgan
