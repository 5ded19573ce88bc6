#include "stages/files/temporary_name.h"

#include <gtest/gtest.h>
#include <unistd.h>

namespace eventgan {
namespace {

TEST(TemporaryName, ThereAndBackFromAnyHost) {
  // Host names can hold digits alone, and targets dots and digits.
  for (const std::string host : {"node7", "node7_cluster_edu-4026531836", "10_0_0_1", "12"}) {
    for (const std::string target : {"a-train-00000-of-00002.h5", "plan", "a.1.2", ".a"}) {
      const TemporaryName name{target, host, 4242, 3};
      EXPECT_EQ(to_string(name), "." + target + "." + host + ".4242.3.tmp");
      EXPECT_EQ(parse_temporary_name(to_string(name)), name);
    }
  }
}

TEST(TemporaryName, NothingElseIsTakenForOne) {
  for (const std::string_view name :
       {"", ".", ".tmp", "a.h5", "a.h5.node.12.0.tmp", ".a.h5.node.12.0", ".a.h5.node.12.0.tmp~",
        ".a.h5.node.12.tmp", ".a.h5.node.x.0.tmp", ".a.h5.node.12.-1.tmp", ".a.h5.node.0.0.tmp",
        ".a.h5.node.-12.0.tmp", ".node.12.0.tmp", "..node.12.0.tmp", ".a..12.0.tmp",
        ".a.h5.node.99999999999999999999.0.tmp", ".12.0.tmp", "....tmp"}) {
    EXPECT_FALSE(parse_temporary_name(name)) << name;
  }
}

TEST(TemporaryName, AHostIsAWordOfAFileName) {
  EXPECT_EQ(without_dots("node7.cluster.edu"), "node7_cluster_edu");
  EXPECT_EQ(without_dots("../x"), "___x");
  EXPECT_EQ(without_dots("node-7"), "node-7");
  EXPECT_FALSE(host_name().empty());
  const TemporaryName name{"a.h5", host_name(), ::getpid(), 0};
  EXPECT_EQ(parse_temporary_name(to_string(name)), name);
}

}  // namespace
}  // namespace eventgan
