#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "stages/hdf5/hdf5_handle_internal.h"

namespace eventgan {

/// Attributes of an open file, group or dataset: UTF-8 text, lists of it, and whole numbers
/// (int32). All throw Hdf5Error.
void write_attribute(hid_t object, const char* name, const std::string& text);
void write_attribute(hid_t object, const char* name, const std::vector<std::string>& texts);
void write_attribute(hid_t object, const char* name, std::int32_t number);

std::string read_text_attribute(hid_t object, const char* name);
std::vector<std::string> read_texts_attribute(hid_t object, const char* name);
std::int32_t read_number_attribute(hid_t object, const char* name);

}  // namespace eventgan
