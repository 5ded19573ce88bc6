#include "manifests/documents/report.h"

#include <gtest/gtest.h>

namespace eventgan {
namespace {

TEST(Report, HasTheFiguresInJsonAndTheTextsOfThoseThatSaySomething) {
  const std::vector<std::string> none, notes{"a\tb", "c"};
  const Report report{std::string("begin"),
                      {"pairs", 3, "3 pairs"},
                      {"lost", 0, "0 lost"},
                      {"seconds", 0.0, "no time"},
                      {"stopped", false, "stopped"},
                      {"weights", "", "no weights"},
                      {"unknown", nullptr, "unknown"},
                      {"faults", none, "no fault"},
                      {"notes", notes, listed(notes, "note: {}")},
                      {"bytes", 5},
                      std::string(),
                      std::string("end\n")};
  EXPECT_EQ(text_of(report), "begin\n3 pairs\nnote: a\\tb\nnote: c\nend\n");
  EXPECT_EQ(json_text_of(report),
            R"({"bytes":5,"faults":[],"lost":0,"notes":["a\tb","c"],"pairs":3,"seconds":0.0,)"
            R"("stopped":false,"unknown":null,"weights":""})"
            "\n");
}

TEST(Report, ListsTheFirstAndCountsTheOthers) {
  const std::vector<int> items{4, 5, 6};
  const auto line = [](int item) { return std::to_string(item); };
  EXPECT_EQ(listed(items, 3, " (elsewhere)", line), "4\n5\n6\n");
  EXPECT_EQ(listed(items, 2, " (elsewhere)", line), "4\n5\n... and 1 more (elsewhere)\n");
  EXPECT_EQ(json_list(items, line), (nlohmann::json{"4", "5", "6"}));
  EXPECT_EQ(json_list(std::vector<int>(), line), nlohmann::json::array());
}

}  // namespace
}  // namespace eventgan
