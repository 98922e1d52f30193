#include "server/base/text_file.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <filesystem>

#include "server/base/part_file.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

namespace fs = std::filesystem;

std::size_t files_in(const test::TemporaryFolder& folder) {
  return static_cast<std::size_t>(
      std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()));
}

TEST(TextFile, WhatIsWrittenReadsBackAndReplacesWhatWasThere) {
  const test::TemporaryFolder folder;
  const std::string path = folder.file("a.txt");
  for (const std::string& text :
       {std::string("first, longer"), std::string("second"), std::string("\0x", 2)}) {
    ASSERT_TRUE(write_text_file(path, text));
    EXPECT_EQ(read_text_file(path).value(), text);
  }
  EXPECT_EQ(files_in(folder), 1u) << "something was left beside it";
}

TEST(TextFile, TheNextWriteClearsWhatAKilledOneLeftOfTheSameFile) {
  const test::TemporaryFolder folder;
  const std::string path = folder.file("a.model");
  const auto left = [&](const std::string& name, std::chrono::minutes ago) {
    const std::string part = folder.write(name, "half");
    fs::last_write_time(part, fs::file_time_type::clock::now() - ago);
    return part;
  };
  // No process has such a number; process 1 is always there.
  const std::string old = left("a.model.4194399.part", std::chrono::minutes(2));
  const std::vector<std::string> stay = {
      left("a.model.4194398.part", std::chrono::minutes(0)),  // perhaps of another host
      left("a.model.1.part", std::chrono::minutes(2)),
      left("b.model.4194399.part", std::chrono::minutes(2)),
      left("a.model.notes.part", std::chrono::minutes(2))};
  ASSERT_TRUE(write_text_file(path, "text"));
  EXPECT_FALSE(fs::exists(old));
  for (const std::string& part : stay) EXPECT_TRUE(fs::exists(part)) << part;
  EXPECT_EQ(leftover_parts(folder.path()).size(), 2u);
}

TEST(TextFile, AFailedWriteLeavesNothing) {
  const test::TemporaryFolder folder;
  const Status written = write_text_file(folder.file("no/such/a.txt"), "text");
  EXPECT_EQ(refusal_of(written), Refusal(folder.file("no/such/a.txt")));
  EXPECT_FALSE(write_text_file(folder.path().string(), "text")) << "a folder is no file";
  EXPECT_EQ(files_in(folder), 0u);
}

TEST(TextFile, WritesIntoAPipeAndLeavesItAPipe) {
  const test::TemporaryFolder folder;
  const std::string path = folder.file("pipe");
  ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
  const int reader = ::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  ASSERT_GE(reader, 0);
  ASSERT_TRUE(write_text_file(path, "text"));
  std::array<char, 16> text{};
  EXPECT_EQ(::read(reader, text.data(), text.size()), 4);
  ::close(reader);
  EXPECT_TRUE(fs::is_fifo(path));
}

TEST(TextFile, WritesThroughALinkAndLeavesItALink) {
  const test::TemporaryFolder folder;
  const std::string path = folder.write("v3.model", "old");
  fs::create_symlink("v3.model", folder.file("current.model"));
  ASSERT_TRUE(write_text_file(folder.file("current.model"), "new"));
  EXPECT_TRUE(fs::is_symlink(folder.file("current.model")));
  EXPECT_EQ(read_text_file(path).value(), "new");
}

TEST(TextFile, RefusesToReadWhatIsMissingAFolderOrTooLarge) {
  const test::TemporaryFolder folder;
  EXPECT_FALSE(read_text_file(folder.file("missing")));
  EXPECT_FALSE(read_text_file(folder.path().string()));
  const auto large = read_text_file(folder.write("large", "12345"), 4);
  EXPECT_EQ(refusal_of(large), Refusal(folder.file("large")).of(ErrorCode::kTooLarge).beyond(5, 4));
}

}  // namespace
}  // namespace trammel
