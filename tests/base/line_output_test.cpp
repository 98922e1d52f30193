#include "server/base/line_output.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <fstream>
#include <sstream>
#include <string>

#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

/// Both ends of a pipe or of a pair of sockets, whose writing end waits where it is full.
class Ends {
 public:
  explicit Ends(bool sockets) {
    const int made = sockets ? ::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, both_.data())
                             : ::pipe2(both_.data(), O_CLOEXEC);
    if (made != 0) ADD_FAILURE() << "no pipe";
  }
  ~Ends() {
    close_reader();
    ::close(writer());
  }
  Ends(const Ends&) = delete;
  Ends& operator=(const Ends&) = delete;

  [[nodiscard]] int writer() const { return both_[1]; }
  void close_reader() {
    if (both_[0] >= 0) ::close(both_[0]);
    both_[0] = -1;
  }
  /// All that is there now.
  [[nodiscard]] std::string read() const {
    std::string all;
    std::array<char, 4096> part{};
    ::fcntl(both_[0], F_SETFL, O_NONBLOCK);
    for (ssize_t n = 0; (n = ::read(both_[0], part.data(), part.size())) > 0;)
      all.append(part.data(), static_cast<std::size_t>(n));
    return all;
  }

 private:
  std::array<int, 2> both_{-1, -1};
};

class LineOutputTo : public testing::TestWithParam<bool> {};

TEST_P(LineOutputTo, AReaderThatStoppedDropsLinesAndSaysHowManyOnceItReadsAgain) {
  const Ends ends(GetParam());
  LineOutput output(ends.writer());
  const std::string line = "a line of the log\n";
  const int flags = ::fcntl(ends.writer(), F_GETFL);
  std::uint64_t written = 0;
  while (output.dropped() < 500) {  // with a reader that waits, this never ends
    output.write(line);
    ++written;
  }
  EXPECT_EQ(::fcntl(ends.writer(), F_GETFL), flags) << "others share them";
  const std::uint64_t lost = output.dropped();
  std::string first = ends.read();
  EXPECT_GE(first.size(), (written - lost) * line.size());
  output.write("the last\n");
  std::istringstream then(first + ends.read());
  std::uint64_t whole = 0;
  std::string text;
  while (std::getline(then, text) && text + "\n" == line) ++whole;
  EXPECT_EQ(whole, written - lost);
  if (!text.ends_with("are lost")) std::getline(then, text);  // after the part of a line that went
  EXPECT_EQ(text, std::to_string(lost) + " lines could not be written here and are lost");
  EXPECT_TRUE(std::getline(then, text));
  EXPECT_EQ(text, "the last");
  EXPECT_EQ(output.dropped(), 0u);
}

TEST_P(LineOutputTo, AReaderThatIsGoneNeitherWaitsNorEndsTheProcess) {
  struct sigaction ignored {};
  struct sigaction before {};
  ignored.sa_handler = SIG_IGN;
  ::sigaction(SIGPIPE, &ignored, &before);
  Ends ends(GetParam());
  LineOutput output(ends.writer());
  output.write("there\n");
  ends.close_reader();
  for (int i = 0; i < 10; ++i) output.write("gone\n");
  EXPECT_EQ(output.dropped(), 10u);
  ::sigaction(SIGPIPE, &before, nullptr);
}

INSTANTIATE_TEST_SUITE_P(PipeAndSocket, LineOutputTo, testing::Bool());

TEST(LineOutput, ToAFileGoesBehindWhatIsThere) {
  const test::TemporaryFolder folder;
  const std::string path = folder.file("log");
  std::ofstream(path) << "before\n";
  const int file = ::open(path.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
  {
    LineOutput output(file);
    output.write("first\n");
    output.write(std::string(20000, 'x') + "\n");
  }
  ::close(file);
  EXPECT_EQ(test::read_file(path), "before\nfirst\n" + std::string(20000, 'x') + "\n");
}

}  // namespace
}  // namespace trammel
