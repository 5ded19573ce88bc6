#pragma once

#include <csetjmp>
#include <cstdio>
#include <stdexcept>
#include <string>

namespace eventgan {

/// Where libjpeg and libpng jump to when they give up: both are C and leave by longjmp.
struct Escape {
  std::jmp_buf place;
  char message[256] = "";

  [[noreturn]] void leave(const char* why) {
    std::snprintf(message, sizeof message, "%s", why);
    std::longjmp(place, 1);
  }
};

/// Runs `step`; throws std::runtime_error with the library's message if it left through `escape`.
/// longjmp runs no destructor: `step` must own nothing.
template <class Step>
void run_guarded(Escape& escape, Step step) {
  if (setjmp(escape.place) != 0) throw std::runtime_error(escape.message);
  step();
}

}  // namespace eventgan
