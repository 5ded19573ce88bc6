#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "tests/testing/hdf5_file.h"

namespace eventgan {

/// An annot.h5 of two joints, one row for each (camera, frame). In row r, joint j lies at
/// (100 r + 10 j + 0.25, 100 r + 10 j + 1.25) px, and in 3-D, 5000 mm deep, where intrinsics/7
/// projects it onto that.
inline std::map<std::string, testing::Hdf5Dataset> fetch_annotations(
    const std::vector<std::pair<std::int64_t, std::int64_t>>& rows) {
  std::vector<double> joints;
  std::vector<double> joints3d;
  std::vector<std::int64_t> cameras;
  std::vector<std::int64_t> frames;
  for (std::size_t r = 0; r < rows.size(); ++r) {
    for (int j = 0; j < 2; ++j) {
      const double x = 100.0 * static_cast<double>(r) + 10 * j + 0.25;
      joints.insert(joints.end(), {x, x + 1});
      joints3d.insert(joints3d.end(), {4 * (x - 512.5), 5 * (x + 1 - 515.5), 5000});
    }
    cameras.push_back(rows[r].first);
    frames.push_back(rows[r].second);
  }
  const std::uint64_t count = rows.size();
  return {{"pose/2d", {{count, 2, 2}, joints}},
          {"pose/3d-univ", {{count, 2, 3}, joints3d}},
          {"camera", {{count}, cameras}},
          {"frame", {{count}, frames}},
          {"intrinsics/7", {{4}, std::vector<double>{1250, 512.5, 1000, 515.5}}}};
}

/// A pickled numpy array of bytes, shape [n].
inline std::string pickled_bytes(const std::string& bytes) {
  using namespace std::string_literals;
  const std::string count(1, static_cast<char>(bytes.size()));
  return "cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x00\x85U\x01"s +
         "b\x87R(K\x01K" + count + "\x85" +
         "cnumpy\ndtype\nU\x02u1K\x00K\x01\x87R(K\x03U\x01|tb\x89U"s + count + bytes + "tb";
}

/// A field of a camera: a name of one letter, and bytes.
inline std::string pickled_field(const std::string& name, const std::string& bytes) {
  return "U\x01" + name + pickled_bytes(bytes);
}

/// A cameras.pkl: {("S1", CAMERA): {CONTENT}}.
inline std::string camera_pickle(const std::string& content, const std::string& camera = "7") {
  return "}U\x02S1U" + std::string(1, static_cast<char>(camera.size())) + camera + "\x86}(" +
         content + "us.";
}

}  // namespace eventgan
