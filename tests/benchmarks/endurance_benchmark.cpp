// The load that a daemon keeps up for long, with real clients: `endurance_benchmark [--minutes N]
// [--swaps N] [--clients N]
// [--restarts N] [swaps] [restart] [clients] [mixed]`; none named: all of them. Ends with 1 where
// an answer was mixed, lost or wrong.
#include <CLI/CLI.hpp>
#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <thread>

#include "clients/session/session.h"
#include "server/base/units.h"
#include "server/compensate/exchanged.h"
#include "server/store/store.h"
#include "server/tasks/train/train.h"
#include "tests/support/daemon.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"
#include "tests/support/virtual_cell.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using Clock = std::chrono::steady_clock;

struct Wanted {
  int minutes = 10, swaps = 1000, clients = 1000, restarts = 20;
};

client::CallContext cell_7() {
  client::CallContext context;
  context.cell = "cell-7";
  return context;
}

CompensatedModel trained(int poses, std::uint64_t seed) {
  TrainOptions options;
  options.bias = "se";
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  return test::demand(train(robot.truth.cell, test::measured(robot, poses, seed), options));
}

/// A daemon whose cell has two models; the first one is in force.
class TwoModels {
 public:
  TwoModels() {
    {
      const auto store = test::demand(Store::open(daemon_.store_path()));
      for (const std::uint64_t seed : {11, 12}) {
        const int version = test::demand(
            store->add_model("cell-7", trained(200, seed), 0, seed == 11, "benchmark"));
        models_.push_back(test::demand(store->model("cell-7", version)));
      }
    }
    daemon_.start();
  }
  [[nodiscard]] test::Daemon& daemon() { return daemon_; }
  [[nodiscard]] std::unique_ptr<client::Session> session() {
    return test::demand(client::Session::open(daemon_.session_options()));
  }
  /// True if all items are what the model that they name says, bit for bit.
  [[nodiscard]] bool is_right(const std::vector<std::vector<double>>& joints,
                              const exchange::Answer<exchange::Prediction>& answer) const {
    const CompensatedModel& model = models_.at(static_cast<std::size_t>(answer.model.version - 1));
    const auto [tool, payload] = *model.parts().trained_with.begin();
    for (std::size_t i = 0; i < joints.size(); ++i) {
      const JointVector q = Eigen::Map<const Eigen::VectorXd>(joints[i].data(), 6);
      const auto expected = model.predict(q, tool, payload);
      const exchange::Prediction& item = answer.items.at(i);
      const exchange::Prediction right = exchanged(expected);
      if (item.error_mm != right.error_mm || item.stddev_mm != right.stddev_mm) return false;
    }
    return true;
  }

 private:
  std::vector<CompensatedModel> models_;  // versions 1 and 2
  test::Daemon daemon_;
};

// ---- swaps under load
// ----------------------------------------------------------------------------------------------

struct Answers {
  std::atomic<std::int64_t> asked{0}, lost{0}, wrong{0};
  std::array<std::atomic<std::int64_t>, 2> of_version{};
};

void ask_until(const std::stop_token& stop, TwoModels& service, std::uint64_t seed,
               Answers& answers) {
  const auto session = service.session();
  for (std::uint64_t round = 0; !stop.stop_requested(); ++round) {
    const auto joints = test::virtual_joints(8, 1000 * seed + round % 50);
    const auto answer = session->predict_error(cell_7(), joints);
    ++answers.asked;
    if (!answer) {
      ++answers.lost;
      continue;
    }
    ++answers.of_version.at(static_cast<std::size_t>(answer->model.version - 1));
    if (!service.is_right(joints, *answer)) ++answers.wrong;
  }
}

bool swaps(int count) {
  TwoModels service;
  Answers answers;
  int failed = 0;
  {
    std::vector<std::jthread> clients;
    for (std::uint64_t k = 1; k <= 4; ++k)
      clients.emplace_back(
          [&, k](const std::stop_token& stop) { ask_until(stop, service, k, answers); });
    const auto person = service.session();
    for (int i = 0; i < count; ++i) {
      if (!person->activate("cell-7", 2 - i % 2)) ++failed;
    }
  }
  test::tell_figure("swaps under load", count - failed);
  test::tell_figure("swaps under load, answers recomputed", static_cast<double>(answers.asked));
  test::tell_figure(
      "swaps under load, share of the second model",
      static_cast<double>(answers.of_version[1]) / static_cast<double>(answers.asked));
  test::tell_figure("swaps under load, answers lost", static_cast<double>(answers.lost));
  test::tell_figure("swaps under load, answers mixed or wrong", static_cast<double>(answers.wrong));
  return failed == 0 && answers.lost == 0 && answers.wrong == 0;
}

// ---- killed and started again
// --------------------------------------------------------------------------------------

bool restart(int count) {
  TwoModels service;
  const auto joints = test::virtual_joints(8, 3);
  double worst = 0;
  bool right = true;
  for (int i = 0; i < count; ++i) {
    service.daemon().kill();
    const auto begun = Clock::now();
    service.daemon().start();
    const auto answer = service.session()->predict_error(cell_7(), joints);
    worst = std::max(worst, std::chrono::duration<double>(Clock::now() - begun).count());
    right = right && answer && answer->model.version == 1 && service.is_right(joints, *answer);
  }
  test::tell_figure("killed, first right answer of a new client after a restart, worst, s", worst);
  return right;
}

// ---- what the daemon holds
// -----------------------------------------------------------------------------------------

struct Holding {
  double memory_mb = 0;
  int descriptors = 0, threads = 0;
};

Holding holding(pid_t pid) {
  const auto count = [&](const char* what) {
    const std::filesystem::directory_iterator entries(fmt::format("/proc/{}/{}", pid, what));
    return static_cast<int>(std::distance(begin(entries), end(entries)));
  };
  std::ifstream pages(fmt::format("/proc/{}/statm", pid));
  double all = 0, resident = 0;
  pages >> all >> resident;
  return {resident * 4096 / 1e6, count("fd"), count("task")};
}

/// Waits for a time; nobody wakes it.
void pause(std::chrono::milliseconds time) {
  std::mutex mutex;
  std::condition_variable never;
  std::unique_lock lock(mutex);
  never.wait_for(lock, time, [] { return false; });
}

bool come_and_vanish(TwoModels& service, int count) {
  std::atomic<int> left = count, lost = 0;
  std::vector<std::jthread> askers;
  for (int k = 0; k < 4; ++k) {
    askers.emplace_back([&] {
      while (left-- > 0) {
        if (!service.session()->predict_error(cell_7(), test::virtual_joints(2, 9))) ++lost;
      }
    });
  }
  askers.clear();
  test::tell_figure("clients that come and vanish, lost", lost);
  return lost == 0;
}

bool clients(int count) {
  TwoModels service;
  const pid_t pid = service.daemon().process().pid();
  bool good = come_and_vanish(service, 20);  // whatever the first ones leave behind
  pause(std::chrono::seconds(3));
  const Holding before = holding(pid);
  good = come_and_vanish(service, count) && good;
  // The lease of a client that said farewell is over at once; give the deleted endpoints time to
  // go.
  Holding after = holding(pid);
  for (int i = 0;
       i < 30 && (after.descriptors > before.descriptors || after.threads > before.threads); ++i) {
    pause(std::chrono::seconds(1));
    after = holding(pid);
  }
  std::printf("clients: %d; memory %.1f to %.1f MB\n", count, before.memory_mb, after.memory_mb);
  test::tell_figure("clients that come and vanish, more memory, MB",
                    after.memory_mb - before.memory_mb);
  test::tell_figure("clients that come and vanish, more descriptors",
                    after.descriptors - before.descriptors);
  test::tell_figure("clients that come and vanish, more threads", after.threads - before.threads);
  return good && after.descriptors <= before.descriptors && after.threads <= before.threads;
}

// ---- everything at once
// --------------------------------------------------------------------------------------------

/// Calls `work` with a session and a counter, `each` apart, until it is stopped; counts what fails.
std::jthread repeated(TwoModels& service, std::chrono::milliseconds each,
                      std::atomic<std::int64_t>& done, std::atomic<std::int64_t>& lost,
                      std::function<bool(client::Session&, std::uint64_t)> work) {
  return std::jthread(
      [&service, each, &done, &lost, work = std::move(work)](const std::stop_token& stop) {
        const auto session = service.session();
        for (std::uint64_t i = 0; !stop.stop_requested(); ++i) {
          ++(work(*session, i) ? done : lost);
          pause(each);
        }
      });
}

std::vector<std::jthread> everybody(TwoModels& service, std::atomic<std::int64_t>& done,
                                    std::atomic<std::int64_t>& lost) {
  using std::chrono::milliseconds;
  std::vector<std::jthread> all;
  for (int k = 0; k < 3; ++k) {
    all.push_back(repeated(
        service, milliseconds(20), done, lost,
        [&service](client::Session& session, std::uint64_t i) {
          const auto joints = test::virtual_joints(1 + static_cast<int>(i % 40), i % 97);
          const auto answer = session.predict_error(cell_7(), joints);
          return answer && (answer->model.version > 2 || service.is_right(joints, *answer));
        }));
  }
  all.push_back(repeated(service, milliseconds(50), done, lost,
                         [](client::Session& session, std::uint64_t i) {
                           std::vector<exchange::AskedTarget> targets;
                           for (const auto& joints : test::virtual_joints(50, i % 89)) {
                             exchange::AskedTarget target;
                             target.seed_rad = joints;
                             target.joint_target = true;
                             targets.push_back(target);
                           }
                           return session.correct_targets(cell_7(), targets).has_value();
                         }));
  all.push_back(repeated(
      service, milliseconds(5000), done, lost, [](client::Session& session, std::uint64_t i) {
        return session
            .submit_measurements("cell-7", fmt::format("b{}", i), test::virtual_batch_csv(40, i))
            .has_value();
      }));
  all.push_back(
      repeated(service, milliseconds(500), done, lost, [](client::Session& session, std::uint64_t) {
        return session.models("cell-7").has_value() && session.jobs("cell-7").has_value();
      }));
  all.push_back(repeated(
      service, milliseconds(1000), done, lost, [](client::Session& session, std::uint64_t i) {
        return session.activate("cell-7", 1 + static_cast<int>(i % 2)).has_value();
      }));
  all.push_back(repeated(
      service, milliseconds(1000), done, lost, [&service](client::Session&, std::uint64_t) {
        return service.session()->predict_error(cell_7(), test::virtual_joints(1, 4)).has_value();
      }));
  return all;
}

bool mixed(int minutes) {
  TwoModels service;
  const pid_t pid = service.daemon().process().pid();
  std::atomic<std::int64_t> done = 0, lost = 0;
  std::vector<Holding> at_minute;
  {
    const auto all = everybody(service, done, lost);
    for (int minute = 1; minute <= minutes; ++minute) {
      pause(std::chrono::minutes(1));
      at_minute.push_back(holding(pid));
      const Holding& now = at_minute.back();
      std::printf("minute %d: %.1f MB, %d descriptors, %d threads, %lld calls, %lld lost\n", minute,
                  now.memory_mb, now.descriptors, now.threads, static_cast<long long>(done),
                  static_cast<long long>(lost));
      std::fflush(stdout);
    }
  }
  const Holding& early = at_minute.at(std::min<std::size_t>(1, at_minute.size() - 1));
  const Holding& late = at_minute.back();
  test::tell_figure("mixed load, calls", static_cast<double>(done));
  test::tell_figure("mixed load, calls lost or wrong", static_cast<double>(lost));
  test::tell_figure("mixed load, more memory from minute 2 on, MB",
                    late.memory_mb - early.memory_mb);
  test::tell_figure("mixed load, more descriptors", late.descriptors - early.descriptors);
  test::tell_figure("mixed load, more threads", late.threads - early.threads);
  return lost == 0;
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  CLI::App app("What a daemon keeps up for long.");
  trammel::Wanted wanted;
  std::vector<std::string> parts;
  app.add_option("--minutes", wanted.minutes)->check(CLI::Range(1, 600));
  app.add_option("--swaps", wanted.swaps)->check(CLI::Range(1, 100000));
  app.add_option("--clients", wanted.clients)->check(CLI::Range(1, 10000));
  app.add_option("--restarts", wanted.restarts)->check(CLI::Range(1, 1000));
  app.add_option("parts", parts)->check(CLI::IsMember({"swaps", "restart", "clients", "mixed"}));
  CLI11_PARSE(app, argc, argv);
  if (parts.empty()) parts = {"swaps", "restart", "clients", "mixed"};
  bool good = true;
  for (const std::string& part : parts) {
    if (part == "swaps") good = trammel::swaps(wanted.swaps) && good;
    if (part == "restart") good = trammel::restart(wanted.restarts) && good;
    if (part == "clients") good = trammel::clients(wanted.clients) && good;
    if (part == "mixed") good = trammel::mixed(wanted.minutes) && good;
  }
  return good ? 0 : 1;
}
