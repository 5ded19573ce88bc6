#include "pipeline/verification/fault_line.h"

#include <sstream>

#include "pipeline/errors/error_text.h"

namespace eventgan {

std::string fault_line(const std::exception& error) {
  std::istringstream lines(error_text(error));
  std::string text;
  for (std::string line; std::getline(lines, line);) {
    const std::size_t start = line.find_first_not_of(' ');
    if (start == std::string::npos) continue;
    text += (text.empty() ? "" : ": ") + line.substr(start);
  }
  return text;
}

}  // namespace eventgan
