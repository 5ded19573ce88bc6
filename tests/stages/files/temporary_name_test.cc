#include "stages/files/temporary_name.h"

#include <gtest/gtest.h>

namespace eventgan {
namespace {

TEST(TemporaryName, ThereAndBack) {
  // Host names and targets can hold dots and digits.
  for (const std::string host : {"node7", "node7.cluster.edu", "10.0.0.1"}) {
    const TemporaryName name{"a-train-00000-of-00002.h5", host, 4242, 3};
    EXPECT_EQ(to_string(name), ".a-train-00000-of-00002.h5." + host + ".4242.3.tmp");
    EXPECT_EQ(parse_temporary_name(to_string(name), host), name);
  }
}

TEST(TemporaryName, NothingElseIsTakenForOne) {
  for (const std::string_view name :
       {"", ".", ".tmp", "a.h5", "a.h5.node.12.0.tmp", ".a.h5.node.12.0", ".a.h5.node.12.0.tmp~",
        ".a.h5.node.12.tmp", ".a.h5.node.x.0.tmp", ".a.h5.node.12.-1.tmp", ".a.h5.node.0.0.tmp",
        ".a.h5.node.-12.0.tmp", ".a.h5.node2.12.0.tmp", ".a.h5.xnode.12.0.tmp", ".node.12.0.tmp",
        "..node.12.0.tmp", ".a.h5.node.99999999999999999999.0.tmp"}) {
    EXPECT_FALSE(parse_temporary_name(name, "node")) << name;
  }
}

TEST(TemporaryName, ThisHostHasAName) { EXPECT_FALSE(host_name().empty()); }

}  // namespace
}  // namespace eventgan
