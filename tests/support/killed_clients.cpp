#include "tests/support/killed_clients.h"

#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <random>
#include <stop_token>
#include <thread>
#include <vector>

namespace trammel::test {
namespace {

using Clock = std::chrono::steady_clock;

/// A process that does `work` and is killed with its parent.
pid_t fork_child(const std::function<void()>& work) {
  const pid_t parent = ::getpid(), child = ::fork();
  if (child != 0) return child;
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() == parent) work();
  ::_exit(0);
}

void end_child(pid_t child) {
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
}

void call_for_ever(const client::SessionOptions& server) {
  const auto session = client::Session::open(server);
  if (!session) return;
  while (true) static_cast<void>((*session)->models("cell-7"));
}

void be_idle(const client::SessionOptions& server, int sessions) {
  std::vector<std::unique_ptr<client::Session>> open;
  for (int i = 0; i < sessions; ++i) {
    auto session = client::Session::open(server);
    if (session && (*session)->servers()) open.push_back(std::move(*session));
  }
  while (true) ::pause();
}

/// Writes one byte to `killed` for each.
void kill_one_after_another(const KillLoad& load, int killed) {
  struct Living {
    pid_t process;
    Clock::time_point until;
  };
  std::mt19937 random(7);
  std::vector<Living> living;
  for (int begun = 0; begun < load.kills || !living.empty();) {
    while (begun < load.kills && living.size() < static_cast<std::size_t>(load.at_once)) {
      const auto life = std::chrono::milliseconds(30 + random() % 570);
      living.push_back({fork_child([&] {
                          ::close(killed);
                          call_for_ever(load.server);
                        }),
                        Clock::now() + life});
      ++begun;
    }
    const auto first =
        std::min_element(living.begin(), living.end(),
                         [](const Living& a, const Living& b) { return a.until < b.until; });
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(first->until - Clock::now());
    ::poll(nullptr, 0, static_cast<int>(std::max<std::int64_t>(0, left.count())));
    end_child(first->process);
    living.erase(first);
    if (::write(killed, "k", 1) != 1) return;
  }
}

class Honest {
 public:
  void call(const client::SessionOptions& server, const std::stop_token& stop) {
    const auto session = client::Session::open(server);
    if (!session) return;
    while (!stop.stop_requested()) {
      const auto begun = Clock::now();
      const bool answered = (*session)->models("cell-7").has_value();
      note(answered, std::chrono::duration<double>(Clock::now() - begun).count());
      ::poll(nullptr, 0, 50);  // the pace of its calls
    }
  }
  void add_to(KillOutcome& outcome) {
    const std::lock_guard lock(mutex_);
    outcome.calls = calls_;
    outcome.lost = lost_;
    outcome.longest_call_s = longest_s_;
  }

 private:
  void note(bool answered, double took_s) {
    const std::lock_guard lock(mutex_);
    ++calls_;
    lost_ += answered ? 0 : 1;
    longest_s_ = std::max(longest_s_, took_s);
  }

  std::mutex mutex_;
  std::size_t calls_ = 0, lost_ = 0;
  double longest_s_ = 0;
};

}  // namespace

KillOutcome kill_clients(const KillLoad& load) {
  KillOutcome outcome;
  int ends[2];
  if (::pipe(ends) != 0) return outcome;
  const pid_t idle = fork_child([&] {
    ::close(ends[1]);  // it then closes when the killer ends
    be_idle(load.server, load.idle);
  });
  const pid_t killer = fork_child([&] { kill_one_after_another(load, ends[1]); });
  ::close(ends[1]);
  Honest honest;
  {
    std::vector<std::jthread> callers;
    for (int i = 0; i < load.honest; ++i) {
      callers.emplace_back([&](const std::stop_token& stop) { honest.call(load.server, stop); });
    }
    char one = 0;
    while (::read(ends[0], &one, 1) == 1) ++outcome.killed;
  }
  ::close(ends[0]);
  end_child(idle);
  ::waitpid(killer, nullptr, 0);
  honest.add_to(outcome);
  return outcome;
}

}  // namespace trammel::test
