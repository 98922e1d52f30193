#include "clients/cli/terminal/output.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "tests/support/refusal.h"
#include "tests/support/temporary_folder.h"

namespace trammel::cli {
namespace {

using test::Refusal;
using test::refusal_of;

class OutputsTest : public testing::Test {
 protected:
  std::string file(const std::string& name) const { return folder_.file(name); }
  /// The code with which outputs of these paths are refused; empty where they are not.
  std::optional<ErrorCode> refused_with(const std::string& a, const std::string& b) const {
    Outputs outputs;
    outputs.add("--report", a);
    outputs.add("--json", b);
    const Status fine = outputs.check({{"--cell", file("cell.yaml")}, {"--batch", ""}});
    if (fine) return std::nullopt;
    return fine.error().code;
  }
  test::TemporaryFolder folder_;
};

TEST_F(OutputsTest, GoToFilesOfTheirOwn) {
  EXPECT_EQ(refused_with(file("a"), file("b")), std::nullopt);
  EXPECT_EQ(refused_with(file("a"), "-"), std::nullopt);
  EXPECT_EQ(refused_with("", ""), std::nullopt);
  EXPECT_EQ(refused_with("/dev/null", "/dev/null"), std::nullopt);
  EXPECT_EQ(refused_with("-", "-"), ErrorCode::kUsage);
  EXPECT_EQ(refused_with("-", "/dev/stdout"), ErrorCode::kUsage);
  EXPECT_EQ(refused_with(file("a"), folder_.path() / "." / "a"), ErrorCode::kUsage);
  folder_.write("here", "");
  std::filesystem::create_symlink(file("here"), file("there"));
  EXPECT_EQ(refused_with(file("here"), file("there")), ErrorCode::kUsage);
  std::filesystem::create_hard_link(file("here"), file("hard"));
  EXPECT_EQ(refused_with(file("here"), file("hard")), ErrorCode::kUsage);
}

TEST_F(OutputsTest, DoNotOverwriteAnInputUnlessTheyAreItsNewState) {
  folder_.write("cell.yaml", "old");
  EXPECT_EQ(refused_with(file("cell.yaml"), file("b")), ErrorCode::kUsage);
  Outputs outputs;
  outputs.add("--cell-out", file("cell.yaml"), "--cell");
  EXPECT_TRUE(outputs.check({{"--cell", file("cell.yaml")}}));
}

TEST_F(OutputsTest, AreRefusedBeforeTheWorkWhereTheyCannotBeWritten) {
  EXPECT_EQ(refused_with(file("a"), file("no/such/folder/b")), ErrorCode::kRefused);
  EXPECT_EQ(refused_with(file("a"), folder_.path()), ErrorCode::kRefused);
}

TEST_F(OutputsTest, AreWrittenAllOrNone) {
  folder_.write("a", "old");
  std::filesystem::create_directory(file("later"));
  Outputs outputs;
  outputs.add("--report", file("a"));
  outputs.add("--json", file("later/b"));
  outputs.add("--model", file("c"));
  outputs.put("--report", "new");
  outputs.put("--json", "new");
  ASSERT_TRUE(outputs.check({}));
  std::filesystem::remove(file("later"));
  const Status written = outputs.write();
  ASSERT_FALSE(written);
  EXPECT_EQ(refusal_of(written), Refusal(file("later/b")));
  EXPECT_EQ(test::read_file(file("a")), "old");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_.path()), {}), 1)
      << "a part was left";

  std::filesystem::create_directory(file("later"));
  ASSERT_TRUE(outputs.write());
  EXPECT_EQ(test::read_file(file("a")), "new");
  EXPECT_EQ(test::read_file(file("later/b")), "new");
  EXPECT_FALSE(std::filesystem::exists(file("c"))) << "it was given no text";
}

}  // namespace
}  // namespace trammel::cli
