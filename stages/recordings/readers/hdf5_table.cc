#include "stages/recordings/readers/detail/hdf5_table.h"

#include <dlfcn.h>
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <limits>
#include <system_error>
#include <vector>

#include "stages/recordings/order/event_index.h"
#include "stages/recordings/readers/detail/stored_recording.h"

namespace eventgan {
namespace {

constexpr std::size_t kUsualCacheBytes = std::size_t{1} << 20;
constexpr std::size_t kLargestCacheBytes = std::size_t{16} << 20;
constexpr std::size_t kChunkCacheSlots = 1009;
constexpr double kPreferReadChunks = 1;

/// Bytes of the chunks that rows next to each other lie in; 0 where there are no chunks.
std::size_t bytes_of_a_layer(hid_t dataset, const std::string& path) {
  const Hdf5Handle creation(H5Dget_create_plist(dataset), H5Pclose, "read the layout of", path);
  if (H5Pget_layout(creation) != H5D_CHUNKED) return 0;
  const Dims dims = dims_of(dataset, path);
  Dims chunk(dims.size());
  checked(H5Pget_chunk(creation, static_cast<int>(chunk.size()), chunk.data()),
          "read the chunks of", path);
  const Hdf5Handle type(H5Dget_type(dataset), H5Tclose, "read the type of", path);
  // In floating point, since a damaged file's sides may be of any size.
  double bytes = static_cast<double>(H5Tget_size(type)) * static_cast<double>(chunk[0]);
  for (std::size_t i = 1; i < dims.size(); ++i) {
    const double chunks = std::ceil(static_cast<double>(dims[i]) / static_cast<double>(chunk[i]));
    bytes *= chunks * static_cast<double>(chunk[i]);
  }
  return static_cast<std::size_t>(std::min(bytes, static_cast<double>(kLargestCacheBytes)));
}

/// A layer of events may be larger than HDF5's usual cache, and would be inflated again for every
/// read. A larger cache for all would be filled, in each of a training's many recordings.
Hdf5Handle open_dataset(hid_t file, const std::string& path) {
  Hdf5Handle dataset(H5Dopen2(file, path.c_str(), H5P_DEFAULT), H5Dclose, "open", path);
  const std::size_t bytes = bytes_of_a_layer(dataset, path);
  if (bytes <= kUsualCacheBytes) return dataset;
  dataset = {};  // the first to open it sets the cache up
  const Hdf5Handle access(H5Pcreate(H5P_DATASET_ACCESS), H5Pclose, "create", "access properties");
  checked(H5Pset_chunk_cache(access, kChunkCacheSlots, bytes, kPreferReadChunks), "set",
          "the chunk cache");
  return {H5Dopen2(file, path.c_str(), access), H5Dclose, "open", path};
}

/// numpy's name of a type of numbers; of others "text", "no numbers". A bool of numpy's is stored
/// as an enumeration of whole numbers, which HDF5 reads as these.
std::string describe_type(hid_t type) {
  const std::string bits = std::to_string(8 * H5Tget_size(type));
  switch (H5Tget_class(type)) {
    case H5T_ENUM:
      return describe_type(Hdf5Handle(H5Tget_super(type), H5Tclose, "read", "a type"));
    case H5T_FLOAT:
      return "float" + bits;
    case H5T_INTEGER:
      return (H5Tget_sign(type) == H5T_SGN_NONE ? "uint" : "int") + bits;
    case H5T_STRING:
      return "text";
    default:
      return "no numbers";
  }
}

/// What a dataset's values go through, in order.
std::vector<H5Z_filter_t> filters_of(hid_t creation) {
  std::vector<H5Z_filter_t> filters;
  const int count = checked(H5Pget_nfilters(creation), "count", "the filters");
  for (int i = 0; i < count; ++i) {
    unsigned flags = 0;
    std::size_t values = 0;
    filters.push_back(checked(H5Pget_filter2(creation, static_cast<unsigned>(i), &flags, &values,
                                             nullptr, 0, nullptr, nullptr),
                              "read", "a filter"));
  }
  return filters;
}

/// Whether deflate is all that compresses the dataset.
bool is_deflated(hid_t creation) {
  return std::ranges::all_of(filters_of(creation), [](H5Z_filter_t filter) {
    return filter == H5Z_FILTER_DEFLATE || filter == H5Z_FILTER_SHUFFLE ||
           filter == H5Z_FILTER_FLETCHER32;
  });
}

/// How many values of `width` bytes the dataset's share of the file can give: of each stored byte
/// what deflate can make of it; where other filters compress, whole chunks.
hsize_t most_values(hid_t dataset, std::size_t width) {
  constexpr hsize_t kMost = std::numeric_limits<hsize_t>::max();
  const Hdf5Handle creation(H5Dget_create_plist(dataset), H5Pclose, "read", "the layout");
  const H5D_layout_t layout = H5Pget_layout(creation);
  if (layout == H5D_VIRTUAL || H5Pget_external_count(creation) > 0) return kMost;
  const hsize_t stored = H5Dget_storage_size(dataset);
  hsize_t growth = 1;
  if (layout == H5D_CHUNKED && is_deflated(creation)) {
    growth = kDeflateLimit;
  } else if (layout == H5D_CHUNKED) {
    Dims chunk(dims_of(dataset, "a dataset").size());
    checked(H5Pget_chunk(creation, static_cast<int>(chunk.size()), chunk.data()), "read",
            "the chunks");
    const hsize_t values = element_count(chunk);
    growth = values > kMost / width ? kMost : values * width;
  }
  return stored > kMost / growth ? kMost : stored * growth / width;
}

/// Of the file that an object lies in, as it was opened.
std::string file_name(hid_t object) {
  const auto size = static_cast<std::size_t>(std::max<ssize_t>(H5Fget_name(object, nullptr, 0), 0));
  std::string name(size + 1, '\0');  // with the end that HDF5 writes
  H5Fget_name(object, name.data(), name.size());
  return name;
}

constexpr H5Z_filter_t kLzfFilter = 32000;

/// Filters of recordings that libhdf5 does not have itself, and Debian's packages of them.
struct Plugin {
  H5Z_filter_t filter;
  const char* name;
  const char* package;
};
constexpr std::array kPlugins{Plugin{kLzfFilter, "LZF", "hdf5-plugin-lzf liblzf1"},
                              Plugin{32001, "Blosc", "hdf5-filter-plugin-blosc-serial"}};

/// HDF5 finds a filter that is installed as a plugin by itself.
void require_filters(hid_t dataset, const std::string& place) {
  const Hdf5Handle creation(H5Dget_create_plist(dataset), H5Pclose, "read", "the filters");
  for (const H5Z_filter_t filter : filters_of(creation)) {
    // Debian's plugin does not name the library that it needs, so that HDF5 alone cannot load it.
    if (filter == kLzfFilter) dlopen("liblzf.so.1", RTLD_NOW | RTLD_GLOBAL);
    if (checked(H5Zfilter_avail(filter), "look for", "a filter") > 0) continue;
    const auto known = std::ranges::find(kPlugins, filter, &Plugin::filter);
    throw InputError(
        known == kPlugins.end()
            ? fmt::format("expected HDF5's filter {} to be installed, got none, in {}", filter,
                          place)
            : fmt::format(
                  "expected HDF5's filter {} to be installed, got none (apt-get install {}), in {}",
                  known->name, known->package, place));
  }
}

}  // namespace

Hdf5Handle open_recording_file(const std::filesystem::path& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) {
    throw InputError("expected an HDF5 file, got " +
                     std::string(std::filesystem::exists(path, ignored) ? "a folder" : "none") +
                     ", in " + path.string());
  }
  try {
    return open_hdf5_file(path);
  } catch (const Hdf5Error&) {
    std::throw_with_nested(
        InputError("expected a whole HDF5 file, got one that does not open, in " + path.string()));
  }
}

std::string hdf5_index_key(const std::filesystem::path& path, const std::string& dataset) {
  std::string key = event_index_key(path, dataset);
  if (key.empty()) return key;
  const Hdf5Lock lock;
  try {
    const Hdf5Handle file = open_recording_file(path);
    const Hdf5Handle values(H5Dopen2(file, dataset.c_str(), H5P_DEFAULT), H5Dclose, "open",
                            dataset);
    const Hdf5Handle creation(H5Dget_create_plist(values), H5Pclose, "read", "the layout");
    const bool is_elsewhere = H5Pget_layout(creation) == H5D_VIRTUAL ||
                              H5Pget_external_count(creation) > 0 ||
                              file_name(values) != file_name(file);
    return is_elsewhere ? "" : key;
  } catch (const std::exception&) {  // told when it is opened
    return "";
  }
}

std::vector<double> read_attribute(hid_t object, const char* name, hssize_t most,
                                   const std::string& place) {
  if (checked(H5Aexists(object, name), "look for", name) == 0) return {};
  const Hdf5Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose, "open", name);
  const Hdf5Handle type(H5Aget_type(attribute), H5Tclose, "read", name);
  const Hdf5Handle space(H5Aget_space(attribute), H5Sclose, "read", name);
  const hssize_t count = checked(H5Sget_simple_extent_npoints(space), "read", name);
  const H5T_class_t kind = H5Tget_class(type);
  if ((kind != H5T_INTEGER && kind != H5T_FLOAT) || count < 1 || count > most) {
    throw InputError(fmt::format("expected {}, got {} [{}], in {} (attribute {})",
                                 most == 1 ? "a number" : "numbers", describe_type(type), count,
                                 place, name));
  }
  std::vector<double> numbers(static_cast<std::size_t>(count));
  checked(H5Aread(attribute, H5T_NATIVE_DOUBLE, numbers.data()), "read", name);
  return numbers;
}

ImageSize told_sensor(double height, double width, const std::string& place) {
  const auto is_side = [](double side) {
    return side >= 1 && side <= kMostSensorSide && side == std::floor(side);
  };
  if (!is_side(height) || !is_side(width)) {
    throw InputError(fmt::format("expected a sensor of 1 to {} pixels a side, got {}x{}, in {}",
                                 kMostSensorSide, width, height, place));
  }
  return {static_cast<int>(height), static_cast<int>(width)};
}

std::optional<ImageSize> attribute_size(hid_t file, const std::string& path,
                                        const std::string& file_name) {
  for (const std::string& owner : {path, std::string("/")}) {
    const Hdf5Handle object = open_object(file, owner);
    const std::string place = fmt::format("{} ({})", file_name, owner);
    const std::vector<double> width = read_attribute(object, "width", 1, place);
    const std::vector<double> height = read_attribute(object, "height", 1, place);
    if (!width.empty() && !height.empty()) {
      return told_sensor(height[0], width[0], place + " (attributes width, height)");
    }
  }
  return std::nullopt;
}

Hdf5Table::Hdf5Table(hid_t file, const std::string& path, const std::string& file_name)
    : place_(file_name + " (dataset " + path + ")") {
  if (!has_object(file, path)) throw InputError("expected a dataset, got none, in " + place_);
  try {
    dataset_ = open_dataset(file, path);
    const Hdf5Handle type(H5Dget_type(dataset_), H5Tclose, "read the type of", path);
    type_ = describe_type(type);
    is_float_ = type_ == "float32" || type_ == "float64";
    dims_ = dims_of(dataset_, path);
    if (type_ == "text" || type_ == "no numbers") refuse("numbers");
    require_filters(dataset_, place_);
    if (side_beyond(dims_, most_values(dataset_, H5Tget_size(type)))) {
      refuse("what its " + std::to_string(H5Dget_storage_size(dataset_)) +
             " stored bytes can hold");
    }
  } catch (const Hdf5Error&) {
    std::throw_with_nested(InputError("expected a readable dataset, got damage, in " + place_));
  }
}

void Hdf5Table::refuse(const std::string& expected) const {
  throw InputError("expected " + expected + ", got " + type_ + " " + shape_text(dims_) + ", in " +
                   place_);
}

}  // namespace eventgan
