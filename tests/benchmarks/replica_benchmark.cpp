// Two servers of one cell: the one that writes is killed (SIGKILL) while four clients ask 100 times a second each and a
// fifth one activates models. How long a client has no answer, whether a request is lost, whether a change happens
// twice, and whether both serve the same when the old writer is back.
// --runs N, --seconds S of load after the kill. The clients are this program again: --ask, --change.
#include <poll.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <iostream>
#include <map>
#include <sstream>

#include "clients/session/session.h"
#include "server/base/text_file.h"
#include "server/store/audit.h"
#include "tests/support/daemon.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr seconds kLimit{120};
constexpr int kClients = 4;

struct Arguments {
  std::vector<std::uint16_t> ports;
  std::uint32_t domain = 0;
  double load_s = 0;
  int runs = 20;
  double after_s = 4;
};

client::SessionOptions options_of(const Arguments& arguments) {
  client::SessionOptions options;
  options.domain = arguments.domain;
  options.server_ports = arguments.ports;
  return options;
}

/// 100 times a second. Prints how many were asked and answered, the longest time from the moment that one was due to
/// its answer, and the longest time between two answers, ms.
int ask(const Arguments& arguments) {
  const auto session = test::demand(client::Session::open(options_of(arguments)));
  client::CallContext context;
  context.cell = "cell-7";
  const auto joints = test::virtual_joints(1, 7);
  static_cast<void>(test::demand(session->predict_error(context, joints)));
  std::cout << "ready" << std::endl;
  const auto begin = Clock::now();
  auto answered_at = begin;
  int asked = 0, answered = 0;
  double longest = 0, silence = 0;
  const auto ms = [](Clock::duration time) { return std::chrono::duration<double, std::milli>(time).count(); };
  for (; Clock::now() - begin < std::chrono::duration<double>(arguments.load_s); ++asked) {
    const auto due = begin + asked * milliseconds(10);
    const auto left = std::chrono::ceil<milliseconds>(due - Clock::now());
    ::poll(nullptr, 0, static_cast<int>(std::max<std::int64_t>(0, left.count())));
    const bool is_answered = session->predict_error(context, joints).has_value();
    const auto now = Clock::now();
    answered += is_answered ? 1 : 0;
    if (!is_answered) continue;
    longest = std::max(longest, ms(now - due));
    silence = std::max(silence, ms(now - answered_at));
    answered_at = now;
  }
  std::cout << asked << ' ' << answered << ' ' << longest << ' ' << silence << std::endl;
  return 0;
}

/// Activates versions 2 and 1 by turns, ten times a second. Prints the id of each change and whether it was
/// acknowledged.
int change(const Arguments& arguments) {
  const auto session = test::demand(client::Session::open(options_of(arguments)));
  static_cast<void>(test::demand(session->servers()));
  std::cout << "ready" << std::endl;
  const auto begin = Clock::now();
  for (int i = 0; Clock::now() - begin < std::chrono::duration<double>(arguments.load_s); ++i) {
    client::ChangeOptions change;
    change.id = fmt::format("change-{}-{}", ::getpid(), i);
    const auto done = session->activate("cell-7", 2 - i % 2, change);
    std::cout << change.id << ' ' << (done ? 1 : 0) << std::endl;
    ::poll(nullptr, 0, 100);
  }
  return 0;
}

class Pair {
 public:
  Pair() {
    give(0, "role: writer");
    give(1, fmt::format("role: follower, of: {}", daemons_[0].name()));
    for (test::Daemon& daemon : daemons_) daemon.start();
    arguments_.ports = {daemons_[0].port(), daemons_[1].port()};
    arguments_.domain = daemons_[0].domain();
    session_ = test::demand(client::Session::open(options_of(arguments_)));
    for (const std::uint64_t seed : {1, 2}) {
      const auto job = test::demand(
          session_->submit_measurements("cell-7", fmt::format("b{}", seed), test::virtual_batch_csv(60, seed)));
      static_cast<void>(test::demand(session_->wait_for_job(job, kLimit, nullptr)));
    }
    if (!wait_until_same()) std::cerr << "they are not the same before the first run" << std::endl;
  }

  /// What one kill did.
  struct Outcome {
    int asked = 0, lost = 0;
    double longest_ms = 0, silence_ms = 0;
    int changes = 0, twice = 0;
    bool same = false;
  };
  Outcome run(double after_s) {
    const int writer = writes(0) ? 0 : 1, follower = 1 - writer;
    give(follower, fmt::format("role: follower, of: {}", daemons_[writer].name()));
    daemons_[follower].process().signal(SIGHUP);
    Arguments arguments = arguments_;
    arguments.load_s = 1 + after_s;
    std::vector<std::unique_ptr<test::Process>> clients;
    for (int i = 0; i < kClients; ++i) clients.push_back(client("--ask", arguments));
    clients.push_back(client("--change", arguments));
    ::poll(nullptr, 0, 1000);  // under load
    daemons_[writer].kill();
    promote(follower);
    Outcome outcome;
    for (int i = 0; i <= kClients; ++i) {
      test::Process& client = *clients[static_cast<std::size_t>(i)];
      static_cast<void>(client.wait(kLimit));
      i < kClients ? count(client.standard_output(), outcome) : count_changes(client.standard_output());
    }
    daemons_[writer].start();
    outcome.same = wait_until_same();
    judge_changes(outcome);
    return outcome;
  }

 private:
  std::unique_ptr<test::Process> client(const std::string& mode, const Arguments& arguments) const {
    auto process = std::make_unique<test::Process>(
        std::vector<std::string>{"/proc/self/exe", mode, "--port", std::to_string(arguments.ports[0]), "--port",
                                 std::to_string(arguments.ports[1]), "--domain", std::to_string(arguments.domain),
                                 "--load", std::to_string(arguments.load_s)});
    if (!process->wait_for_line("ready", kLimit)) std::cerr << process->standard_error() << std::endl;
    return process;
  }
  void give(int which, const std::string& part) {
    const test::Daemon& daemon = daemons_[which];
    if (files_[which].empty()) files_[which] = test::read_file(daemon.config_path());
    const Status written = write_text_file(
        daemon.config_path(),
        fmt::format("{}replica: {{{}}}\ndds: {{peer_ports: [{}]}}\n", files_[which], part, daemons_[1 - which].port()));
    if (!written) std::cerr << sentence(written.error()) << std::endl;
  }
  /// As a person does: its file says so, and it is told to read it. The file of the other one says what it said.
  void promote(int which) {
    give(which, "role: writer");
    daemons_[which].process().signal(SIGHUP);
  }
  std::vector<client::ServerStatus> statuses() const {
    return session_->servers().value_or(std::vector<client::ServerStatus>());
  }
  bool writes(int which) const {
    for (const client::ServerStatus& status : statuses())
      if (status.server_id == daemons_[which].name()) return status.replica && status.replica->writes;
    return false;
  }
  [[nodiscard]] bool wait_until_same() const {
    const auto same = [](const std::vector<client::ServerStatus>& all) {
      return all.size() == 2 && all[0].replica && all[1].replica && all[0].replica->epoch == all[1].replica->epoch &&
             all[0].replica->writes != all[1].replica->writes &&
             all[0].replica->cells.at(0).hash == all[1].replica->cells.at(0).hash;
    };
    return same(session_->servers_when(same, seconds(30)).value_or(std::vector<client::ServerStatus>()));
  }
  static void count(const std::string& text, Outcome& outcome) {
    std::istringstream lines(text);
    std::string ready;
    int asked = 0, answered = 0;
    double longest = 0, silence = 0;
    lines >> ready >> asked >> answered >> longest >> silence;
    outcome.asked += asked;
    outcome.lost += asked - answered;
    outcome.longest_ms = std::max(outcome.longest_ms, asked == 0 ? INFINITY : longest);
    outcome.silence_ms = std::max(outcome.silence_ms, silence);
  }
  void count_changes(const std::string& text) {
    std::istringstream lines(text);
    std::string id;
    int acknowledged = 0;
    lines >> id;  // ready
    acknowledged_.clear();
    while (lines >> id >> acknowledged) acknowledged_[id] = acknowledged != 0;
  }
  /// By the audit trails of both stores.
  void judge_changes(Outcome& outcome) const {
    std::map<std::string, int> made;
    for (const test::Daemon& daemon : daemons_) {
      for (const AuditRow& row : test::demand(read_audit(daemon.store_path(), {})).rows)
        if (row.what == "activate" && acknowledged_.contains(row.request)) ++made[row.request];
    }
    for (const auto& [id, is_acknowledged] : acknowledged_) {
      outcome.changes += is_acknowledged ? 1 : 0;
      outcome.twice += made[id] > 1 ? 1 : 0;
    }
  }

  test::Daemon daemons_[2] = {test::Daemon(0), test::Daemon(1)};
  std::string files_[2];
  Arguments arguments_;
  std::unique_ptr<client::Session> session_;
  std::map<std::string, bool> acknowledged_;
};

int measure(const Arguments& arguments) {
  Pair pair;
  int good = 0, lost = 0, twice = 0, divergent = 0;
  double silence_ms = 0;
  for (int i = 0; i < arguments.runs; ++i) {
    const Pair::Outcome outcome = pair.run(arguments.after_s);
    const bool is_good = outcome.lost == 0 && outcome.silence_ms <= 500 && outcome.twice == 0 && outcome.same;
    good += is_good ? 1 : 0;
    lost += outcome.lost;
    twice += outcome.twice;
    divergent += outcome.same ? 0 : 1;
    silence_ms = std::max(silence_ms, outcome.silence_ms);
    std::cout << fmt::format(
                     "run {:2}: {} asked, {} lost, {:.0f} ms without an answer, slowest {:.0f} ms; {} changes, {} "
                     "twice; {} afterwards",
                     i + 1, outcome.asked, outcome.lost, outcome.silence_ms, outcome.longest_ms, outcome.changes,
                     outcome.twice, outcome.same ? "the same" : "DIVERGENT")
              << std::endl;
  }
  std::cout << fmt::format("{} of {} runs good", good, arguments.runs) << std::endl;
  test::tell_figure("writer killed: longest without an answer, ms", silence_ms);
  test::tell_figure("writer killed: requests lost", lost);
  test::tell_figure("writer killed: changes that happened twice", twice);
  test::tell_figure("writer killed: divergent afterwards", divergent);
  return good == arguments.runs ? 0 : 1;
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  trammel::Arguments arguments;
  bool asks = false, changes = false;
  CLI::App app("The writer of two servers is killed under load");
  app.add_flag("--ask", asks);
  app.add_flag("--change", changes);
  app.add_option("--port", arguments.ports);
  app.add_option("--domain", arguments.domain);
  app.add_option("--load", arguments.load_s);
  app.add_option("--runs", arguments.runs);
  app.add_option("--seconds", arguments.after_s);
  CLI11_PARSE(app, argc, argv);
  if (asks) return trammel::ask(arguments);
  if (changes) return trammel::change(arguments);
  return trammel::measure(arguments);
}
