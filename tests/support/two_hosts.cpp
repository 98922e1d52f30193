#include "tests/support/two_hosts.h"

#include <fcntl.h>
#include <linux/if.h>
#include <linux/if_tun.h>
#include <poll.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <deque>
#include <map>
#include <random>
#include <thread>

#include "tests/support/process.h"

namespace trammel::test {

namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr const char* kInterface = "cable";
constexpr std::size_t kLargestFrame = 65536;
constexpr std::size_t kRemembered = 20000;  // frames
constexpr int kIdleMs = 20;  // the longest wait, after which it is seen whether to stop

bool ip(std::vector<std::string> words) {
  words.insert(words.begin(), "/usr/sbin/ip");
  return run(words).exit_code == 0;
}

/// The end of an interface in this process's network namespace, for reading and writing its frames.
/// -1: none.
int open_interface() {
  const int end = ::open("/dev/net/tun", O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (end < 0) return -1;
  ifreq asked{};
  asked.ifr_flags = IFF_TAP | IFF_NO_PI;
  std::strncpy(asked.ifr_name, kInterface, IFNAMSIZ - 1);
  if (::ioctl(end, TUNSETIFF, &asked) == 0) return end;
  ::close(end);
  return -1;
}

/// Opens an interface in the namespace of that name, by a thread that enters it and ends.
int open_interface_in(const std::string& name) {
  int end = -1;
  std::thread([&] {
    const int space = ::open(("/run/netns/" + name).c_str(), O_RDONLY | O_CLOEXEC);
    if (space >= 0 && ::setns(space, CLONE_NEWNET) == 0) end = open_interface();
    if (space >= 0) ::close(space);
  }).join();
  return end;
}

}  // namespace

/// Carries frames between two interfaces, with the given faults.
class TwoHosts::Line {
 public:
  Line(std::array<int, 2> ends, const LineFaults& faults)
      : ends_(ends),
        faults_(faults),
        thread_([this](const std::stop_token& stop) { carry(stop); }) {}
  ~Line() {
    thread_.request_stop();
    thread_.join();
    for (const int end : ends_) ::close(end);
  }
  Line(const Line&) = delete;
  Line& operator=(const Line&) = delete;

  Clock::time_point cut_for(milliseconds time) {
    const auto until = Clock::now() + time;
    cut_until_ = until.time_since_epoch().count();
    return until;
  }
  std::size_t repeat_to(std::size_t end) {
    to_repeat_ = static_cast<int>(end);
    to_repeat_.wait(static_cast<int>(end));
    return repeated_;
  }
  [[nodiscard]] std::uint64_t carried() const { return carried_; }
  void wait_until_carried(std::uint64_t frames) const {
    for (std::uint64_t seen = carried_; seen < frames; seen = carried_) carried_.wait(seen);
  }

 private:
  struct Frame {
    int to = -1;
    std::vector<char> bytes;
  };

  void carry(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      std::array<pollfd, 2> ready = {pollfd{ends_[0], POLLIN, 0}, pollfd{ends_[1], POLLIN, 0}};
      ::poll(ready.data(), ready.size(), until_next());
      for (std::size_t i = 0; i < 2; ++i) {
        if (ready.at(i).revents != 0) take_from(ends_.at(i), ends_.at(1 - i));
      }
      deliver();
      if (to_repeat_ >= 0) repeat();
    }
  }

  [[nodiscard]] int until_next() const {
    if (underway_.empty()) return kIdleMs;
    const auto left =
        std::chrono::ceil<milliseconds>(underway_.begin()->first - Clock::now()).count();
    return static_cast<int>(std::clamp<std::int64_t>(left, 0, kIdleMs));
  }

  void take_from(int from, int to) {
    for (;;) {
      const ssize_t size = ::read(from, buffer_.data(), buffer_.size());
      if (size <= 0) return;
      const auto now = Clock::now();
      if (now.time_since_epoch().count() < cut_until_ || uniform_(random_) < faults_.lost) continue;
      const auto more =
          std::chrono::duration_cast<Clock::duration>(faults_.scatter * uniform_(random_));
      underway_.emplace(now + faults_.delay + more,
                        Frame{to, {buffer_.begin(), buffer_.begin() + size}});
    }
  }

  void deliver() {
    while (!underway_.empty() && underway_.begin()->first <= Clock::now()) {
      Frame& frame = underway_.begin()->second;
      // An interface that is down takes nothing: such a frame is lost.
      if (::write(frame.to, frame.bytes.data(), frame.bytes.size()) > 0) {
        ++carried_;
        carried_.notify_all();
        past_.push_back(std::move(frame));
        if (past_.size() > kRemembered) past_.pop_front();
      }
      underway_.erase(underway_.begin());
    }
  }

  void repeat() {
    const int to = ends_.at(static_cast<std::size_t>(to_repeat_.load()));
    repeated_ = 0;
    for (const Frame& frame : past_)
      if (frame.to == to && ::write(to, frame.bytes.data(), frame.bytes.size()) > 0) ++repeated_;
    to_repeat_ = -1;
    to_repeat_.notify_all();
  }

  std::array<int, 2> ends_;
  const LineFaults faults_;
  std::atomic<int> to_repeat_{-1};  // the end that is to receive its frames again; -1: none
  std::atomic<std::size_t> repeated_{0};
  std::atomic<Clock::rep> cut_until_{0};
  std::atomic<std::uint64_t> carried_{0};
  std::multimap<Clock::time_point, Frame>
      underway_;  // by arrival time; used by the line's thread alone, like the members below
  std::deque<Frame> past_;  // in the order in which they were carried
  std::vector<char> buffer_ = std::vector<char>(kLargestFrame);
  std::mt19937_64 random_{1};
  std::uniform_real_distribution<double> uniform_{0, 1};
  std::jthread thread_;
};

TwoHosts::TwoHosts(const LineFaults& faults) {
  const auto number = std::to_string(::getpid() % 250);
  for (std::size_t i = 0; i < 2; ++i) {
    names_.at(i) = "trammel-" + std::to_string(::getpid()) + "-" + std::to_string(i);
    addresses_.at(i) = "10.88." + number + "." + std::to_string(i + 1);
  }
  why_not_ = set_up(faults);
}

TwoHosts::~TwoHosts() {
  line_.reset();
  for (const std::string& name : names_) static_cast<void>(ip({"netns", "del", name}));
}

std::string TwoHosts::set_up(const LineFaults& faults) {
  if (::access("/usr/sbin/ip", X_OK) != 0) return "iproute2 is not installed";
  std::array<int, 2> ends{-1, -1};
  for (std::size_t i = 0; i < 2; ++i) {
    if (!ip({"netns", "add", names_.at(i)}))
      return "network namespaces cannot be made here: that takes root";
    ends.at(i) = open_interface_in(names_.at(i));
    if (ends.at(i) < 0) return "/dev/net/tun makes no interfaces here";
  }
  line_ = std::make_unique<Line>(ends, faults);
  for (std::size_t i = 0; i < 2; ++i) {
    const std::string& name = names_.at(i);
    if (!ip({"-n", name, "addr", "add", addresses_.at(i) + "/24", "dev", kInterface}) ||
        !ip({"-n", name, "link", "set", "lo", "up"}) || !set_interface(i, true))
      return "the interfaces of the namespaces cannot be set up";
  }
  return "";
}

bool TwoHosts::set_interface(std::size_t host, bool up) const {
  return ip({"-n", names_.at(host), "link", "set", kInterface, up ? "up" : "down"});
}

Clock::time_point TwoHosts::cut_for(milliseconds time) { return line_->cut_for(time); }

std::size_t TwoHosts::repeat_from(std::size_t host) { return line_->repeat_to(1 - host); }

std::uint64_t TwoHosts::carried() const { return line_->carried(); }

void TwoHosts::wait_until_carried(std::uint64_t frames) const { line_->wait_until_carried(frames); }

std::vector<std::string> TwoHosts::on(std::size_t host, std::vector<std::string> argv) const {
  argv.insert(argv.begin(), {"/usr/sbin/ip", "netns", "exec", names_.at(host)});
  return argv;
}

}  // namespace trammel::test
