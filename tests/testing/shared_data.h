#pragma once

#include <cstdlib>
#include <filesystem>

namespace eventgan::testing {

/// The folder with real frames and golden numbers that is kept beside a checkout and not part of
/// it: EVENTGAN_TEST_DATA if set, else ../shared/data; an empty path if there is none.
inline std::filesystem::path shared_data() {
  if (const char* folder = std::getenv("EVENTGAN_TEST_DATA")) return folder;
  const auto beside = std::filesystem::path(EVENTGAN_SOURCE_DIR).parent_path() / "shared" / "data";
  return std::filesystem::is_directory(beside) ? beside : std::filesystem::path();
}

}  // namespace eventgan::testing

/// At the start of a test that needs the shared data; gives `data`, its folder.
#define EVENTGAN_SHARED_DATA_OR_SKIP(data)                               \
  const std::filesystem::path data = ::eventgan::testing::shared_data(); \
  if (data.empty()) GTEST_SKIP() << "skipped: no ../shared/data"
