#include "stages/frames/dataset/full_rank.h"

#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <utility>

namespace eventgan {
namespace {

TEST(HasFullRank, WhateverTheUnitOfARow) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(has_full_rank(std::array<double, 9>{1e9, 0, 0, 0, 1e-9, 0, 0, 0, 1}));
  // KITTI's P2, and a camera of 10000 px focal length that looks along (1, 1, 1).
  EXPECT_TRUE(
      has_full_rank(std::array{721.5, 0., 609.6, 44.9, 0., 721.5, 172.9, 0.2, 0., 0., 1., 0.}));
  EXPECT_TRUE(has_full_rank(std::array<double, 9>{8000, 100, -7000, -4000, 9000, -3000, 1, 1, 1}));
  EXPECT_FALSE(has_full_rank(std::array<double, 9>{1, 2, 3, 2, 4, 6, 0, 0, 1})) << "equal rows";
  EXPECT_FALSE(has_full_rank(std::array<double, 9>{1, 2, 3, 4, 5, 6, 7, 8, 9}));
  EXPECT_FALSE(has_full_rank(std::array<double, 9>{}));
  std::array<double, 12> one{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  for (const double bad : {kNan, std::numeric_limits<double>::infinity(), 1e308}) {
    for (double& number : one) {
      const double good = std::exchange(number, bad);
      EXPECT_FALSE(has_full_rank(one)) << bad;
      number = good;
    }
  }
}

}  // namespace
}  // namespace eventgan
