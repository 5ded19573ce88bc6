#include "tests/stages/generator/checkpoint_bytes.h"

#include <cstring>
#include <utility>

namespace eventgan::testing {
namespace {

template <class T>
std::string little_endian(T value) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}

}  // namespace

std::string pickled_text(const std::string& value) {
  return "X" + little_endian(static_cast<std::uint32_t>(value.size())) + value;
}

std::string pickled_integer(std::int32_t value) { return "J" + little_endian(value); }

std::string pickled_integers(const std::vector<int>& values) {
  std::string items;
  for (const int value : values) items += pickled_integer(value);
  return pickled_tuple(items);
}

std::string pickled_global(const std::string& module, const std::string& name) {
  return "c" + module + "\n" + name + "\n";
}

std::string pickled_tuple(const std::string& items) { return "(" + items + "t"; }

std::string pickled_dict(const std::string& keys_and_values) {
  return "}(" + keys_and_values + "u";
}

std::string pickled_list(const std::string& items) { return "](" + items + "e"; }

std::string whole_pickle(const std::string& value) { return "\x80\x02" + value + "."; }

std::string pickled_tensor(const PickledTensor& tensor) {
  const std::string id = pickled_tuple(
      pickled_text("storage") + pickled_global("torch", tensor.type) + pickled_text(tensor.key) +
      pickled_text("cpu") + pickled_integer(tensor.count) + tensor.view);
  const std::string no_hooks = pickled_global("collections", "OrderedDict") + ")R";
  return pickled_global("torch._utils", "_rebuild_tensor_v2") +
         pickled_tuple(id + "Q" + pickled_integer(tensor.offset) + pickled_integers(tensor.shape) +
                       pickled_integers(tensor.stride) + "\x89" + no_hooks) +
         "R";
}

LegacyFile::LegacyFile(std::string pickled_data, std::vector<LegacyStorage> with_storages)
    : magic("\x8a\x0a\x6c\xfc\x9c\x46\xf9\x20\x6a\xa8\x50\x19"),
      version(pickled_integer(1001)),
      machine(pickled_dict(pickled_text("protocol_version") + pickled_integer(1001) +
                           pickled_text("little_endian") + "\x88")),
      data(std::move(pickled_data)),
      storages(std::move(with_storages)) {}

std::string LegacyFile::bytes() const {
  std::string keys;
  std::string values;
  for (const LegacyStorage& storage : storages) {
    keys += pickled_text(storage.key);
    values += little_endian(storage.count) + storage.bytes;
  }
  return whole_pickle(magic) + whole_pickle(version) + whole_pickle(machine) + whole_pickle(data) +
         whole_pickle(pickled_list(keys)) + values;
}

}  // namespace eventgan::testing
