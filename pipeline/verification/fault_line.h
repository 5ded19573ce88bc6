#pragma once

#include <exception>
#include <string>

namespace eventgan {

/// An exception's message and those nested in it as one line, for lists with a line a fault.
std::string fault_line(const std::exception& error);

}  // namespace eventgan
