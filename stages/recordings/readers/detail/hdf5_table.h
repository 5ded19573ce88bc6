#pragma once

#include <exception>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/faults.h"
#include "manifests/values/frames.h"
#include "stages/base/hdf5/hdf5.h"

namespace eventgan {

/// Opens a recording's file. Throws InputError "expected an HDF5 file, got X, in PATH".
Hdf5Handle open_recording_file(const std::filesystem::path& path);

/// event_index_key of a dataset's file; empty, too, if its values lie in others (a virtual or an
/// external dataset, or one behind a link), whose changes the key does not show. Like it to be made
/// before the file is opened.
std::string hdf5_index_key(const std::filesystem::path& path, const std::string& dataset);

/// Runs `read` under the lock. Throws InputError "expected readable values, got damage, in PLACE"
/// with the cause nested if HDF5 fails.
template <class Read>
auto read_hdf5(const std::string& place, Read read) {
  const Hdf5Lock lock;
  try {
    return read();
  } catch (const Hdf5Error&) {
    std::throw_with_nested(InputError("expected readable values, got damage, in " + place));
  }
}

/// The numbers of an attribute; none if it is absent. Throws InputError, which names `place`, if it
/// has other values or more than `most`; Hdf5Error.
std::vector<double> read_attribute(hid_t object, const char* name, hssize_t most,
                                   const std::string& place);

/// A sensor's size by what a file says of its sides. Throws InputError unless these are whole
/// numbers of 1 to kMostSensorSide.
ImageSize told_sensor(double height, double width, const std::string& place);

/// The size that the attributes `width` and `height` of the object at `path`, or else of the file,
/// tell; none if neither has both. Throws as read_attribute and told_sensor.
std::optional<ImageSize> attribute_size(hid_t file, const std::string& path,
                                        const std::string& file_name);

/// An open dataset of numbers, of which parts are read.
class Hdf5Table {
 public:
  /// Throws InputError if there is no such dataset, if it does not hold numbers, if its shape
  /// claims more values than the bytes it stores can give, or if it is compressed with what is not
  /// installed. `file_name` is for messages.
  Hdf5Table(hid_t file, const std::string& path, const std::string& file_name);

  const Dims& dims() const { return dims_; }
  bool is_float() const { return is_float_; }  ///< float32 or float64
  bool is_uint8() const { return type_ == "uint8"; }

  /// "PATH (dataset davis/left/events)".
  const std::string& place() const { return place_; }

  /// Throws InputError "expected EXPECTED, got uint8 [3, 4], in PATH (dataset D)".
  [[noreturn]] void refuse(const std::string& expected) const;

  /// Reads the block that starts at `start` and has the shape `count`, in C order and as `Number`.
  /// Throws Hdf5Error.
  template <class Number>
  void read(const Dims& start, const Dims& count, Number* values) const {
    read_block(dataset_, place_, start, count, element_type<Number>(), values);
  }

 private:
  std::string place_;
  Hdf5Handle dataset_;
  Dims dims_;
  std::string type_;  ///< numpy's name of it
  bool is_float_ = false;
};

}  // namespace eventgan
