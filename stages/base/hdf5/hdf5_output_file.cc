#include "stages/base/hdf5/hdf5_output_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <string>

namespace eventgan {
namespace {

/// HDF5's part first, as its drivers do: HDF5 passes pointers to `base` about.
struct OutputFile {
  H5FD_t base{};
  int descriptor = -1;
  haddr_t end_of_allocation = 0;
  haddr_t end_of_file = 0;
  int* error = nullptr;
};

OutputFile& output(H5FD_t* file) { return *reinterpret_cast<OutputFile*>(file); }
const OutputFile& output(const H5FD_t* file) { return *reinterpret_cast<const OutputFile*>(file); }

H5FD_t* open_file(const char* name, unsigned, hid_t access, haddr_t) {
  int* error = *static_cast<int* const*>(H5Pget_driver_info(access));
  const int descriptor = ::open(name, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (descriptor < 0) {
    *error = errno;
    return nullptr;
  }
  auto* file = new OutputFile;
  file->descriptor = descriptor;
  file->error = error;
  return &file->base;
}

herr_t close_file(H5FD_t* file) {
  OutputFile& out = output(file);
  if (::close(out.descriptor) != 0 && *out.error == 0) *out.error = errno;
  delete &out;
  return 0;
}

herr_t query(const H5FD_t*, unsigned long* flags) {
  *flags = H5FD_FEAT_AGGREGATE_METADATA | H5FD_FEAT_ACCUMULATE_METADATA | H5FD_FEAT_DATA_SIEVE |
           H5FD_FEAT_AGGREGATE_SMALLDATA | H5FD_FEAT_DEFAULT_VFD_COMPATIBLE;
  return 0;
}

haddr_t end_of_allocation(const H5FD_t* file, H5FD_mem_t) { return output(file).end_of_allocation; }

herr_t set_end_of_allocation(H5FD_t* file, H5FD_mem_t, haddr_t address) {
  output(file).end_of_allocation = address;
  return 0;
}

haddr_t end_of_file(const H5FD_t* file, H5FD_mem_t) { return output(file).end_of_file; }

/// What was never written reads as zeros, as in HDF5's own drivers.
herr_t read(H5FD_t* file, H5FD_mem_t, hid_t, haddr_t address, std::size_t size, void* buffer) {
  auto* bytes = static_cast<char*>(buffer);
  while (size > 0) {
    const ssize_t got = ::pread(output(file).descriptor, bytes, size, static_cast<off_t>(address));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return -1;
    if (got == 0) break;
    bytes += got;
    address += static_cast<haddr_t>(got);
    size -= static_cast<std::size_t>(got);
  }
  std::memset(bytes, 0, size);
  return 0;
}

herr_t write(H5FD_t* file, H5FD_mem_t, hid_t, haddr_t address, std::size_t size,
             const void* buffer) {
  OutputFile& out = output(file);
  const auto* bytes = static_cast<const char*>(buffer);
  out.end_of_file = std::max(out.end_of_file, address + size);
  while (size > 0 && *out.error == 0) {
    const ssize_t put = ::pwrite(out.descriptor, bytes, size, static_cast<off_t>(address));
    if (put < 0 && errno == EINTR) continue;
    if (put < 0) {
      *out.error = errno;
      break;
    }
    bytes += put;
    address += static_cast<haddr_t>(put);
    size -= static_cast<std::size_t>(put);
  }
  return 0;
}

herr_t truncate(H5FD_t* file, hid_t, hbool_t) {
  OutputFile& out = output(file);
  if (out.end_of_file == out.end_of_allocation) return 0;
  out.end_of_file = out.end_of_allocation;
  if (*out.error == 0 &&
      ::ftruncate(out.descriptor, static_cast<off_t>(out.end_of_allocation)) != 0) {
    *out.error = errno;
  }
  return 0;
}

hid_t register_driver() {
  H5FD_class_t driver{};
  driver.name = "eventgan_output";
  driver.maxaddr = static_cast<haddr_t>(std::numeric_limits<off_t>::max());
  driver.fc_degree = H5F_CLOSE_SEMI;
  driver.fapl_size = sizeof(int*);
  driver.open = open_file;
  driver.close = close_file;
  driver.query = query;
  driver.get_eoa = end_of_allocation;
  driver.set_eoa = set_end_of_allocation;
  driver.get_eof = end_of_file;
  driver.read = read;
  driver.write = write;
  driver.truncate = truncate;
  const H5FD_mem_t free_lists[] = H5FD_FLMAP_DICHOTOMY;
  std::copy(std::begin(free_lists), std::end(free_lists), driver.fl_map);
#if H5_VERSION_GE(1, 13, 0)
  driver.version = H5FD_CLASS_VERSION;
  driver.value = 600;  // of the range that HDF5 leaves to drivers it does not know
#endif
  return H5FDregister(&driver);
}

}  // namespace

Hdf5OutputFile::Hdf5OutputFile(const std::filesystem::path& target)
    : output_(target), error_(std::make_unique<int>(0)) {
  const Hdf5Lock lock;
  static const hid_t driver = checked(register_driver(), "register", "the file driver");
  const Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "create", "access properties");
  int* const error = error_.get();
  checked(H5Pset_driver(access, driver, &error), "set", "the file driver");
  checked(H5Pset_fclose_degree(access, H5F_CLOSE_SEMI), "set", "the close degree");
  checked(H5Pset_libver_bounds(access, H5F_LIBVER_V110, H5F_LIBVER_V110), "set", "the version");
  const std::string path = output_.temporary().string();
  const hid_t id =
      H5Fcreate(path.c_str(), H5F_ACC_EXCL, creation_properties(H5P_FILE_CREATE), access);
  if (id < 0 && *error != 0) {
    throw_system_error("cannot create " + path, *error);
  }
  file_ = Hdf5Handle(id, H5Fclose, "create", path);
}

void Hdf5OutputFile::check() const {
  if (*error_ == 0) return;
  throw_system_error("cannot write " + output_.temporary().string(), *error_);
}

}  // namespace eventgan
