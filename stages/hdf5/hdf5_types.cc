#include <stdexcept>

#include "stages/hdf5/hdf5_types_internal.h"

namespace eventgan {
namespace {

Hdf5Handle copy_of(hid_t type) { return {H5Tcopy(type), H5Tclose, "copy", "a type"}; }

/// IEEE 754 binary16, which HDF5 1.10 has no name for.
Hdf5Handle half_type() {
  Hdf5Handle type = copy_of(H5T_IEEE_F32LE);
  checked(H5Tset_fields(type, 15, 10, 5, 0, 10), "make", "float16");
  checked(H5Tset_size(type, 2), "make", "float16");
  checked(H5Tset_ebias(type, 15), "make", "float16");
  return type;
}

}  // namespace

Hdf5Handle text_type() {
  Hdf5Handle type = copy_of(H5T_C_S1);
  checked(H5Tset_size(type, H5T_VARIABLE), "make", "a text type");
  checked(H5Tset_cset(type, H5T_CSET_UTF8), "make", "a text type");
  return type;
}

Hdf5Handle bytes_type() { return {H5Tvlen_create(H5T_STD_U8LE), H5Tclose, "make", "a bytes type"}; }

Hdf5Handle number_type(std::size_t size, bool is_float, bool is_signed) {
  if (is_float) return copy_of(size == 4 ? H5T_IEEE_F32LE : H5T_IEEE_F64LE);
  switch (size) {
    case 1:
      return copy_of(is_signed ? H5T_STD_I8LE : H5T_STD_U8LE);
    case 4:
      return copy_of(is_signed ? H5T_STD_I32LE : H5T_STD_U32LE);
    case 8:
      return copy_of(is_signed ? H5T_STD_I64LE : H5T_STD_U64LE);
    default:
      throw std::logic_error("no column has integers of " + std::to_string(size) + " bytes");
  }
}

Hdf5Handle volume_type(StoredType type) {
  switch (type) {
    case StoredType::kFloat32:
      return copy_of(H5T_IEEE_F32LE);
    case StoredType::kFloat16:
      return half_type();
    case StoredType::kUint8:
      return copy_of(H5T_STD_U8LE);
  }
  throw std::logic_error("unknown stored type");
}

}  // namespace eventgan
