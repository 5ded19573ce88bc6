#include <gtest/gtest.h>

#include <new>
#include <stdexcept>
#include <system_error>

#include "manifests/values/faults.h"
#include "pipeline/runtime/errors.h"

namespace eventgan {
namespace {

TEST(ErrorText, TellsTheWholeChain) {
  try {
    try {
      try {
        throw std::runtime_error("disk full");
      } catch (...) {
        std::throw_with_nested(std::runtime_error("cannot write b"));
      }
    } catch (...) {
      std::throw_with_nested(std::runtime_error("cannot write a"));
    }
  } catch (const std::exception& error) {
    EXPECT_EQ(error_text(error), "cannot write a\n  because: cannot write b\n  because: disk full");
  }
}

TEST(ErrorLine, IsOneLineHoweverDeepTheCause) {
  EXPECT_EQ(error_line(std::runtime_error("cannot read x")), "cannot read x");
  EXPECT_EQ(error_line(std::runtime_error("two faults:\n  first\n  second\n")),
            "two faults: first: second");
  try {
    try {
      throw std::runtime_error("no such file");
    } catch (const std::runtime_error&) {
      std::throw_with_nested(std::runtime_error("cannot read x"));
    }
  } catch (const std::runtime_error& error) {
    EXPECT_EQ(error_line(error), "cannot read x: no such file");
  }
}

TEST(ErrorText, TellsOfTheLimitsThatTheLibraryHasNoWordsFor) {
  EXPECT_EQ(error_text(std::bad_alloc()),
            "expected enough memory, got none (fewer --threads need less; ulimit -v sets a limit)");
  const auto again = std::make_error_code(std::errc::resource_unavailable_try_again);
  EXPECT_EQ(error_text(std::system_error(again)),
            "expected to begin a thread, got 'Resource temporarily unavailable' (fewer --threads; "
            "ulimit -u sets a limit)");
  EXPECT_EQ(error_text(std::system_error(again, "cannot lock a")),
            "cannot lock a: Resource temporarily unavailable");
}

TEST(ExitCodeOf, KnowsTheKindsOfErrors) {
  EXPECT_EQ(exit_code_of(UsageError("")), kUsage);
  EXPECT_EQ(exit_code_of(TooManyFaults("")), kTooManyFaults);
  EXPECT_EQ(exit_code_of(InputError("")), kInputMissing);
  EXPECT_EQ(exit_code_of(Stopped("")), kStopped);
  EXPECT_EQ(exit_code_of(std::runtime_error("")), kFailed);
}

}  // namespace
}  // namespace eventgan
