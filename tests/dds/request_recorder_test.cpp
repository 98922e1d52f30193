#include "server/dds/records/request_recorder.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>

#include <chrono>
#include <thread>

#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kRoom = std::size_t{1} << 20;

class RequestRecorderTest : public testing::Test {
 protected:
  [[nodiscard]] std::unique_ptr<RequestRecorder> open() const {
    auto recorder = RequestRecorder::open({folder_.path().string(), 1});
    EXPECT_TRUE(recorder);
    return std::move(*recorder);
  }
  /// One life of a server that is asked this once.
  void live_once(const std::string& line) const { record(*open(), line); }
  static void record(RequestRecorder& recorder, const std::string& line) {
    recorder.record([line] { return line; }, line.size());
  }
  [[nodiscard]] static bool drops(const RequestRecorder& recorder, std::uint64_t number) {
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (recorder.dropped() < number && std::chrono::steady_clock::now() < until)
      std::this_thread::yield();
    return recorder.dropped() == number;
  }
  [[nodiscard]] std::size_t bytes() const {
    std::size_t all = 0;
    for (const auto& entry : fs::directory_iterator(folder_.path())) all += entry.file_size();
    return all;
  }
  [[nodiscard]] bool has(const std::string& line) const {
    for (const auto& entry : fs::directory_iterator(folder_.path())) {
      if (test::read_file(entry.path()).find(line + "\n") != std::string::npos) return true;
    }
    return false;
  }

  test::TemporaryFolder folder_;
};

TEST_F(RequestRecorderTest, LongRequestsTakeNoMoreThanTheRoomTheyHave) {
  {
    const auto recorder = open();
    for (int i = 0; i < 20; ++i) record(*recorder, fmt::format("{:0300000}", i));
  }
  EXPECT_LE(bytes(), kRoom);
  EXPECT_TRUE(has(fmt::format("{:0300000}", 19))) << "the last one is there";
  EXPECT_FALSE(has(fmt::format("{:0300000}", 0)));
}

TEST_F(RequestRecorderTest, ARequestThatIsLongerThanTheRoomIsCountedAndCostsNoOther) {
  const auto recorder = open();
  record(*recorder, "first");
  record(*recorder, std::string(2 * kRoom, 'x'));
  EXPECT_TRUE(drops(*recorder, 1)) << recorder->dropped();
  EXPECT_LE(bytes(), kRoom);
  EXPECT_TRUE(has("first"));
}

TEST_F(RequestRecorderTest, AServerThatStartsAgainAndAgainKeepsWhatItHasRecorded) {
  live_once("first");
  for (int i = 0; i < 20; ++i) static_cast<void>(open());
  for (int i = 0; i < 20; ++i) live_once("later");
  EXPECT_TRUE(has("first"));
}

TEST_F(RequestRecorderTest, SmallFilesOfManyLivesAreBoundedToo) {
  for (int i = 0; i < 400; ++i) live_once(fmt::format("life {}", i));
  std::size_t files = 0;
  for ([[maybe_unused]] const auto& entry : fs::directory_iterator(folder_.path())) ++files;
  EXPECT_LE(files * 4096, kRoom) << "each takes a block of the disk";
  EXPECT_TRUE(has("life 399"));
}

/// No file of this process grows while this lives.
class FullDisk {
 public:
  FullDisk() {
    ::signal(SIGXFSZ, SIG_IGN);
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit none{0, before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &none);
  }
  ~FullDisk() { ::setrlimit(RLIMIT_FSIZE, &before_); }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  rlimit before_{};
};

TEST_F(RequestRecorderTest,
       ADiskThatIsFullCostsNothingThatWasRecordedAndLaterRequestsAreRecordedAgain) {
  const std::string large(100'000, 'x');
  for (int i = 0; i < 8; ++i) live_once(fmt::format("{}{}", large, i));
  const auto recorder = open();
  record(*recorder, "before");
  {
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (!has("before") && std::chrono::steady_clock::now() < until) std::this_thread::yield();
    const FullDisk full;
    for (int i = 0; i < 30; ++i) record(*recorder, "lost");
    EXPECT_TRUE(drops(*recorder, 30)) << recorder->dropped();
  }
  EXPECT_TRUE(has("before"));
  for (int i = 1; i < 8; ++i) EXPECT_TRUE(has(fmt::format("{}{}", large, i))) << i;
  record(*recorder, "after");
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (!has("after") && std::chrono::steady_clock::now() < until) std::this_thread::yield();
  EXPECT_TRUE(has("after"));
  EXPECT_FALSE(has("lost"));
}

}  // namespace
}  // namespace trammel
