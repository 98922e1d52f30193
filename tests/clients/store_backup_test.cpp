#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <string>

#include "clients/cli/command_line.h"
#include "tests/support/temporary_folder.h"

namespace trammel::cli {
namespace {

TEST(StoreBackup, OfADatabaseSaysInOneLineHowItIsCopiedAndWritesNothing) {
  const test::TemporaryFolder folder;
  for (const char* store : {"postgresql://trammel:s3cret@db-1,db-2/trammel",
                            "host=db-1 dbname=trammel user=trammel password=s3cret"}) {
    const std::string copy = folder.file("copy.db");
    const std::array<const char*, 6> argv = {"trammel", "backup", "--store",
                                             store,     "-o",     copy.c_str()};
    testing::internal::CaptureStderr();
    EXPECT_EQ(run_command_line(static_cast<int>(argv.size()), argv.data()), 3);
    const std::string told = testing::internal::GetCapturedStderr();
    EXPECT_NE(told.find("pg_dump"), std::string::npos) << told;
    EXPECT_NE(told.find("db-1"), std::string::npos) << told;
    EXPECT_EQ(told.find("s3cret"), std::string::npos) << told;
    EXPECT_EQ(std::count(told.begin(), told.end(), '\n'), 1) << told;
    EXPECT_FALSE(std::filesystem::exists(copy));
  }
}

}  // namespace
}  // namespace trammel::cli
