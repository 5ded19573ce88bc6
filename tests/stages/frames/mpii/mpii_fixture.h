#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tests/stages/base/archives/mat_writer.h"

/// A small MPII download.
namespace eventgan::testing::mat {

inline matvar_t* image(const std::string& name) { return structure({{"name", text(name)}}); }

/// One image with two persons: a whole one (joints 0, 1, 2, 9 with the four forms of is_visible),
/// and one with nothing but a centre and a scale.
inline matvar_t* two_persons() {
  matvar_t* points = structs({
      {{"x", number(711)}, {"y", number(621)}, {"id", byte(0)}, {"is_visible", byte(1)}},
      {{"x", number(715.5)}, {"y", number(491)}, {"id", byte(1)}, {"is_visible", text("1")}},
      {{"x", number(705)}, {"y", number(371)}, {"id", number(2)}, {"is_visible", empty()}},
      {{"x", number(781)}, {"y", number(365)}, {"id", byte(9)}, {"is_visible", number(0)}},
  });
  return structs({{{"x1", number(706)},
                   {"y1", number(52)},
                   {"x2", number(776)},
                   {"y2", number(164)},
                   {"annopoints", structure({{"point", points}})},
                   {"scale", number(3.05)},
                   {"objpos", structure({{"x", number(742)}, {"y", number(350)}})},
                   {"silhouette", text("kept")}},
                  {{"x1", empty()},
                   {"y1", empty()},
                   {"x2", empty()},
                   {"y2", empty()},
                   {"annopoints", empty()},
                   {"scale", number(1.2)},
                   {"objpos", structure({{"x", number(100)}, {"y", number(120)}})},
                   {"silhouette", empty()}}});
}

inline matvar_t* centre_only() {
  return structure(
      {{"scale", number(2)}, {"objpos", structure({{"x", number(11)}, {"y", number(21)}})}});
}

struct FixtureEntry {
  std::string image;
  matvar_t* annorect;
  bool is_train;
  std::string keyframe;
};

/// Writes both .mat files into `folder`.
inline void write_mpii(const std::filesystem::path& folder,
                       const std::vector<FixtureEntry>& entries,
                       matio_compression compression = MAT_COMPRESSION_ZLIB) {
  std::vector<Fields> annolist, keyframes, act;
  std::vector<matvar_t*> single;
  std::vector<std::uint8_t> train;
  for (const FixtureEntry& entry : entries) {
    annolist.push_back({{"image", image(entry.image)},
                        {"annorect", entry.annorect},
                        {"frame_sec", byte(2)},
                        {"vididx", empty()}});
    keyframes.push_back({{"image", image(entry.keyframe)}});
    act.push_back({{"cat_name", text("sports")}, {"act_name", empty()}, {"act_id", number(-1)}});
    single.push_back(array<double>(MAT_C_DOUBLE, MAT_T_DOUBLE, {1, 2}, 2, 1));
    train.push_back(entry.is_train);
  }
  matvar_t* img_train = array<std::uint8_t>(MAT_C_UINT8, MAT_T_UINT8, train, 1, train.size());
  write_mat(folder / "mpii_human_pose_v1_u12_1.mat", "RELEASE",
            structure({{"annolist", structs(annolist)},
                       {"img_train", img_train},
                       {"version", text("12")},
                       {"single_person", cells(single)},
                       {"act", structs(act)}}),
            compression);
  write_mat(folder / "mpii_human_pose_v1_sequences_keyframes.mat", "annolist_keyframes",
            structs(keyframes), compression);
}

}  // namespace eventgan::testing::mat
