#pragma once

/// Before a function: it is compiled for several processors, with all that it calls, and the one
/// for this processor is chosen when the program starts. For loops whose results do not depend on
/// the width of the instructions: no sum of floats over neighbours, and no product that an addition
/// follows, which a compiler may contract. Only GCC does both. Not under a sanitizer, which is not
/// set up yet when that choice is made.
#if defined(__x86_64__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define EVENTGAN_CLONES \
  __attribute__((flatten, target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define EVENTGAN_CLONES
#endif
