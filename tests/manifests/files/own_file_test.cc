#include "manifests/files/own_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "manifests/values/faults.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using namespace std::string_literals;
using ::testing::HasSubstr;
using testing::TemporaryFolder;
using testing::write_file;

const std::string kHdf5 = "\x89HDF\r\n\x1a\n";

struct OwnFileCase {
  OwnFile kind;
  const char* name;
  std::string own, foreign;
};

class OwnFiles : public ::testing::TestWithParam<OwnFileCase> {
 protected:
  TemporaryFolder folder_;
};

TEST_P(OwnFiles, AreToldFromAPersonsByTheirContent) {
  const auto& [kind, name, own, foreign] = GetParam();
  const auto file = folder_ / name;
  EXPECT_TRUE(is_replaceable(file, kind)) << "nothing is there";
  write_file(file, own);
  EXPECT_TRUE(is_replaceable(file, kind)) << own;
  EXPECT_NO_THROW(require_replaceable(file, kind));
  EXPECT_TRUE(has_own_mark(own)) << own;
  EXPECT_FALSE(has_own_mark(foreign)) << foreign;
  write_file(file, foreign);
  EXPECT_FALSE(is_replaceable(file, kind)) << foreign;
  try {
    require_replaceable(file, kind);
    FAIL() << "expected UsageError";
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), HasSubstr("or no file, got another one, in " + file.string()));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, OwnFiles,
    ::testing::Values(
        OwnFileCase{OwnFile::kPlan, "plan.json", R"({"format":"eventgan-plan","version":1,)",
                    R"({"format":"other","version":1})"},
        OwnFileCase{OwnFile::kRunRecord, "run.json", "{\n  \"manifest_folder\": \"/data\"\n}\n",
                    R"({"my":1})"},
        OwnFileCase{OwnFile::kAmendments, "amendments.json", R"({"format": "eventgan-amendments"})",
                    "[1]"},
        OwnFileCase{OwnFile::kDescription, "dataset.json",
                    "{\n  \"format\": \"eventgan-dataset\"\n}",
                    R"({"images": [{"file_name": "eventgan-dataset.png"}], "annotations": []})"},
        OwnFileCase{OwnFile::kView, "dataset.h5", kHdf5 + "...eventgan-view...", kHdf5 + "mine"},
        OwnFileCase{OwnFile::kShard, "a.h5", kHdf5 + "eventgan-shard", "eventgan-shard"},
        OwnFileCase{OwnFile::kReport, "report.html",
                    "<!DOCTYPE html>\n<title>a – eventgan report</title>",
                    "<!DOCTYPE html>\n<title>notes</title>"},
        OwnFileCase{OwnFile::kWeights, "w.safetensors",
                    "\x40\0\0\0\0\0\0\0{\"__metadata__\":{\"format\":\"eventgan-generator\"}}"s,
                    "\x40\0\0\0\0\0\0\0{\"a\":{}}"s},
        OwnFileCase{OwnFile::kTrainingTable, "training.csv", "phase,step,seconds,flow\n",
                    "phase,energy\n"},
        OwnFileCase{OwnFile::kChart, "curves.svg",
                    "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"chart\" width=\"9\"></svg>",
                    "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"9\"></svg>"},
        OwnFileCase{OwnFile::kSensor, "sensor.json", R"({"format": "eventgan-sensor"})",
                    R"({"format": "eventgan-manifest"})"},
        OwnFileCase{OwnFile::kPicture, "a.png", "\x89PNG\r\n\x1a\ntEXtSoftware\0eventgan"s,
                    "\x89PNG\r\n\x1a\ntEXtSoftware\0GIMP"s},
        OwnFileCase{OwnFile::kTrace, "trace.json", "{\"traceEvents\":[\n", "{\"events\":[\n"}));

TEST(OwnFile, AFolderOfResultsAloneIsTheProgramsOwn) {
  const TemporaryFolder folder;
  const auto is_own = [&] { return is_own_output(folder / "out"); };
  EXPECT_FALSE(is_own()) << "nothing is there";
  write_file(folder / "out/plan.json", R"({"format":"other"})");
  EXPECT_FALSE(is_own()) << "a person's plan";
  write_file(folder / "out/plan.json", R"({"format":"eventgan-plan"})");
  write_file(folder / "out/a-train-00000-of-00001.h5", "");
  EXPECT_FALSE(is_own()) << "a recording, or a shard that is not done";
  write_file(folder / "out/a-train-00000-of-00001.json", "{}");
  EXPECT_FALSE(is_own()) << "a recording with labels";
  write_file(folder / "out/a-train-00000-of-00001.json", R"({"format":"eventgan-commit-record"})");
  EXPECT_TRUE(is_own());
  write_file(folder / "out/manifest.json", R"({"format":"eventgan-manifest"})");
  EXPECT_TRUE(is_own());
  write_file(folder / "out/more/plan.json", R"({"format":"eventgan-plan"})");
  EXPECT_TRUE(is_own()) << "with a folder of the same kind";
  for (const char* mine : {"out/1.png", "out/notes/1.png"}) {
    write_file(folder / mine, "");
    EXPECT_FALSE(is_own()) << mine;
    std::filesystem::remove(folder / mine);
  }
  write_file(folder / "export/.export/export.txt", "");
  write_file(folder / "export/images/1.png", "");
  EXPECT_TRUE(is_own_output(folder / "export"));
}

TEST(OwnFile, AMarkMayLieAnywhere) {
  const TemporaryFolder folder;
  const auto file = folder / "a.h5";
  // Across the end of a block of 1 MiB, in which the file is read, and far behind it.
  for (const std::size_t place :
       {std::size_t{8}, (std::size_t{1} << 20) - 5, std::size_t{5} << 20}) {
    std::string bytes(place, '.');
    bytes.replace(0, kHdf5.size(), kHdf5);
    write_file(file, bytes);
    EXPECT_FALSE(is_replaceable(file, OwnFile::kShard)) << place;
    write_file(file, bytes + "eventgan-shard");
    EXPECT_TRUE(is_replaceable(file, OwnFile::kShard)) << place;
  }
}

TEST(OwnFile, NothingIsLostInAnEmptyFile) {
  const TemporaryFolder folder;
  write_file(folder / "plan.json", "");
  EXPECT_TRUE(is_replaceable(folder / "plan.json", OwnFile::kPlan));
}

TEST(OwnFile, AFolderIsNobodysToReplace) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "plan.json");
  EXPECT_FALSE(is_replaceable(folder / "plan.json", OwnFile::kPlan));
}

}  // namespace
}  // namespace eventgan
