#include "stages/hdf5/hdf5_attribute_internal.h"
#include "stages/hdf5/hdf5_types_internal.h"

namespace eventgan {
namespace {

std::string called(const char* name) { return std::string("attribute ") + name; }

void write(hid_t object, const char* name, hid_t type, const Hdf5Handle& space, const void* data) {
  Hdf5Handle attribute(H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose,
                       "create", called(name));
  if (data != nullptr) checked(H5Awrite(attribute, type, data), "write", called(name));
  attribute.close(called(name));
}

Hdf5Handle scalar() { return {H5Screate(H5S_SCALAR), H5Sclose, "create", "a scalar"}; }

/// Reads texts of a scalar or a list.
std::vector<std::string> read_texts(hid_t object, const char* name) {
  const Hdf5Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose, "open", called(name));
  const Hdf5Handle type = text_type();
  const Hdf5Handle stored_type(H5Aget_type(attribute), H5Tclose, "read", called(name));
  if (checked(H5Tequal(stored_type, type), "compare the type of", called(name)) == 0) {
    throw Hdf5Error("expected text in " + called(name) + ", got another type");
  }
  const Hdf5Handle space(H5Aget_space(attribute), H5Sclose, "read", called(name));
  std::vector<char*> stored(
      static_cast<std::size_t>(checked(H5Sget_simple_extent_npoints(space), "read", called(name))));
  std::vector<std::string> texts;
  if (stored.empty()) return texts;
  checked(H5Aread(attribute, type, stored.data()), "read", called(name));
  for (const char* text : stored) texts.emplace_back(text == nullptr ? "" : text);
  H5Dvlen_reclaim(type, space, H5P_DEFAULT, stored.data());
  return texts;
}

}  // namespace

void write_attribute(hid_t object, const char* name, const std::string& text) {
  const char* data = text.c_str();
  write(object, name, text_type(), scalar(), &data);
}

void write_attribute(hid_t object, const char* name, const std::vector<std::string>& texts) {
  std::vector<const char*> data;
  for (const std::string& text : texts) data.push_back(text.c_str());
  const hsize_t count = data.size();
  write(object, name, text_type(),
        Hdf5Handle(H5Screate_simple(1, &count, nullptr), H5Sclose, "create", called(name)),
        data.empty() ? nullptr : data.data());
}

void write_attribute(hid_t object, const char* name, std::int32_t number) {
  write(object, name, H5T_STD_I32LE, scalar(), &number);
}

std::string read_text_attribute(hid_t object, const char* name) {
  const std::vector<std::string> texts = read_texts(object, name);
  if (texts.size() != 1) throw Hdf5Error("expected one text in " + called(name));
  return texts[0];
}

std::vector<std::string> read_texts_attribute(hid_t object, const char* name) {
  return read_texts(object, name);
}

std::int32_t read_number_attribute(hid_t object, const char* name) {
  const Hdf5Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose, "open", called(name));
  const Hdf5Handle space(H5Aget_space(attribute), H5Sclose, "read", called(name));
  if (H5Sget_simple_extent_npoints(space) != 1) {
    throw Hdf5Error("expected one number in " + called(name));
  }
  std::int32_t number = 0;
  checked(H5Aread(attribute, H5T_NATIVE_INT32, &number), "read", called(name));
  return number;
}

}  // namespace eventgan
