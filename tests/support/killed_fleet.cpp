#include "tests/support/killed_fleet.h"

#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <utility>

#include "server/base/hash.h"
#include "server/base/text_file.h"
#include "tests/support/computing_child.h"
#include "tests/support/demand.h"
#include "tests/support/small_cell.h"
#include "tests/support/virtual_cell.h"

namespace trammel::test {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr int kClients = 4;
constexpr int kServing = 2;  // servers 0 and 1; the one behind them only trains
constexpr seconds kLimit{60};
constexpr milliseconds kPatience{4000};  // of a client's call
constexpr milliseconds kPredictionPatience{5000};
constexpr milliseconds kBetweenPredictions{20};
constexpr milliseconds kKnownAgain{2000};  // a server that is back, before the other one's turn
constexpr std::int64_t kMillisecondUs = 1000;
constexpr std::size_t kLastWords = 600;  // of a server that ended by itself

const std::vector<std::string> kSmallCells = {"small-1", "small-2"};

void pass(milliseconds time) { ::poll(nullptr, 0, static_cast<int>(time.count())); }

double p99(std::vector<double> times) {
  if (times.empty()) return 0;
  const auto at =
      times.begin() + static_cast<std::ptrdiff_t>(static_cast<double>(times.size() - 1) * 0.99);
  std::nth_element(times.begin(), at, times.end());
  return *at;
}

client::SessionOptions options_for(const std::vector<const Daemon*>& daemons,
                                   milliseconds patience) {
  client::SessionOptions options = daemons.front()->session_options();
  options.timeout = patience;
  options.server_ports.clear();
  for (const Daemon* daemon : daemons) options.server_ports.push_back(daemon->port());
  return options;
}

/// Asks for predictions all the time, and notes how long each took.
class Predictor {
 public:
  Predictor(const client::SessionOptions& options, History& history)
      : session_(demand(client::Session::open(options))), history_(history) {
    thread_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
  }
  struct Times {
    std::vector<double> ms;
    int failed = 0;
  };
  /// Since this was called last.
  [[nodiscard]] Times take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(times_, {});
  }

 private:
  void work(const std::stop_token& stop) {
    client::CallContext context;
    context.cell = "cell-7";
    const auto joints = virtual_joints(1, 7);
    while (!stop.stop_requested()) {
      const std::int64_t before = monotonic_us();
      const auto answer = session_->predict_error(context, joints);
      const std::int64_t after = monotonic_us();
      {
        const std::lock_guard lock(mutex_);
        times_.ms.push_back(static_cast<double>(after - before) / kMillisecondUs);
        times_.failed += answer ? 0 : 1;
      }
      note(answer, before, after);
      pass(kBetweenPredictions);
    }
  }
  /// Each model once; and each failure.
  void note(const Result<exchange::Answer<exchange::Prediction>>& answer, std::int64_t before,
            std::int64_t after) {
    json record = {{"op", "predict"}, {"cell", "cell-7"}, {"invoke", before}, {"complete", after}};
    if (!answer) {
      record["answer"] = "unknown";
      record["why"] = answer.error().message;
      history_.add(record);
    } else if (seen_ != answer->model.hash) {
      seen_ = answer->model.hash;
      record["answer"] = "ok";
      record["version"] = answer->model.version;
      record["hash"] = seen_.substr(0, 16);
      history_.add(record);
    }
  }

  const std::unique_ptr<client::Session> session_;
  History& history_;
  std::string seen_;  // of the thread
  std::mutex mutex_;
  Times times_;  // guarded by mutex_
  std::jthread thread_;
};

/// The servers that are killed, stopped and started again.
class Fleet {
 public:
  explicit Fleet(std::uint64_t seed) : random_(seed), url_(database_.new_store()) {
    for (std::size_t i = 0; i < servers_.size(); ++i) {
      configure(servers_[i], i < kServing ? "" : "serves: false\n");
      servers_[i].start();
    }
    cells_ = {{"cell-7", nullptr}};
    for (const std::string& name : kSmallCells) cells_.push_back({name, small_cell(name)});
  }

  struct Loss {
    std::string what;
    std::int64_t at = 0;
    std::int64_t ready = 0;  ///< the database; 0: it was a server
  };

  /// Kills so many, in any order, and waits until all are there again.
  void kill(int kills, milliseconds longest_pause) {
    int done = 0;
    for (std::int64_t next = 0; done < kills; pass(milliseconds(10))) {
      bring_back(false);
      start_again();
      if (monotonic_us() < next) continue;
      if (!strike()) continue;
      ++done;
      next = monotonic_us() + after(milliseconds(100), longest_pause);
    }
    bring_back(true);
  }
  /// Servers that ended though nobody killed them; they are started again.
  int start_again() {
    for (std::size_t i = 0; i < servers_.size(); ++i) {
      if (away_[i]) continue;
      const auto code = servers_[i].process().wait(milliseconds(0));
      if (!code) continue;
      ++ended_by_themselves_;
      const std::string said = servers_[i].process().standard_error();
      fmt::print(stderr, "server {} ended with code {}: {}\n", i, *code,
                 said.substr(said.size() - std::min(said.size(), kLastWords)));
      servers_[i].start();
    }
    return ended_by_themselves_;
  }
  [[nodiscard]] const std::vector<Loss>& losses() const { return losses_; }
  [[nodiscard]] const std::vector<AskedCell>& cells() const { return cells_; }
  [[nodiscard]] const Daemon& server(std::size_t i) const { return servers_.at(i); }
  [[nodiscard]] const std::string& url() const { return url_; }
  /// Rows of a statement, and their columns.
  [[nodiscard]] std::vector<std::vector<std::string>> rows(const std::string& statement) const {
    std::vector<std::vector<std::string>> all;
    std::istringstream lines(database_.sql(url_, statement));
    for (std::string line; std::getline(lines, line);) {
      std::istringstream columns(line);
      all.emplace_back();
      for (std::string column; std::getline(columns, column, '|');) all.back().push_back(column);
    }
    return all;
  }

 private:
  struct Away {
    std::int64_t until = 0;
    bool frozen = false;
  };

  void configure(Daemon& daemon, const std::string& keys) const {
    const std::filesystem::path folder = std::filesystem::path(daemon.config_path()).parent_path();
    std::string names = "cell-7.yaml";
    demand_written(folder / "robot.yaml", small_robot_yaml());
    for (const std::string& name : kSmallCells) {
      demand_written(folder / (name + ".yaml"), small_cell_yaml(name) + "sessions: {last: 3}\n");
      names += ", " + name + ".yaml";
    }
    demand_written(folder / "cell-7.yaml",
                   read_file(folder / "cell-7.yaml") + "sessions: {last: 3}\n");
    demand_written(
        daemon.config_path(),
        fmt::format("version: 1\nserver: {}\ncells: [{}]\nstore: '{}'\nlog: {{level: info}}\n{}",
                    daemon.name(), names, url_, keys));
  }
  static void demand_written(const std::filesystem::path& path, const std::string& text) {
    if (const Status written = write_text_file(path, text); !written) {
      fmt::print(stderr, "{}\n", sentence(written.error()));
      std::abort();
    }
  }
  /// Microseconds, drawn.
  std::int64_t after(milliseconds least, milliseconds most) {
    return std::uniform_int_distribution<std::int64_t>(least.count(), most.count())(random_) *
           kMillisecondUs;
  }
  std::size_t drawn(std::size_t count) {
    return std::uniform_int_distribution<std::size_t>(0, count - 1)(random_);
  }

  /// Of the serving servers one is always there, and was for a while. False: it is another one's
  /// turn.
  bool strike() {
    const std::size_t kind = drawn(20);
    if (kind < 5) return strike_database(false);
    if (kind < 6) return strike_database(true);
    if (kind < 15) return strike_server(drawn(servers_.size()), kind >= 13);
    return strike_child();
  }
  bool strike_database(bool freezes) {
    if (database_away_) return false;
    losses_.push_back({freezes ? "database stopped" : "database killed", monotonic_us()});
    freezes ? database_.freeze(true) : database_.kill();
    database_away_ = {monotonic_us() + (freezes ? after(seconds(2), seconds(6))
                                                : after(milliseconds(0), seconds(2))),
                      freezes};
    return true;
  }
  bool strike_server(std::size_t which, bool freezes) {
    if (away_[which]) return false;
    const std::size_t other = 1 - std::min<std::size_t>(which, 1);
    const bool is_last = which < kServing && (away_[other] || monotonic_us() < known_at_[other]);
    if (is_last) return false;
    losses_.push_back({fmt::format("{} {}", which < kServing ? "server" : "training host",
                                   freezes ? "stopped" : "killed"),
                       monotonic_us()});
    freezes ? servers_[which].process().signal(SIGSTOP) : servers_[which].kill();
    // Some are away for longer than a claim holds.
    away_[which] = {monotonic_us() + (freezes ? after(seconds(2), seconds(drawn(4) == 0 ? 20 : 6))
                                              : after(milliseconds(0), milliseconds(1500))),
                    freezes};
    return true;
  }
  bool strike_child() {
    for (std::size_t i = 0; i < servers_.size(); ++i) {
      if (away_[i]) continue;
      const auto child = computing_child(servers_[i].process().pid());
      if (!child) continue;
      losses_.push_back({"computing child killed", monotonic_us()});
      ::kill(*child, SIGKILL);
      return true;
    }
    return false;
  }

  void bring_back(bool at_once) {
    const auto is_due = [&](const std::optional<Away>& away) {
      return away && (at_once || monotonic_us() >= away->until);
    };
    if (is_due(database_away_)) {
      const bool was_frozen = database_away_->frozen;
      was_frozen ? database_.freeze(false) : database_.start();
      database_away_.reset();
      for (auto loss = losses_.rbegin(); loss != losses_.rend(); ++loss) {
        if (!loss->what.starts_with("database")) continue;
        loss->ready = monotonic_us();
        break;
      }
    }
    for (std::size_t i = 0; i < servers_.size(); ++i) {
      if (!is_due(away_[i])) continue;
      away_[i]->frozen ? servers_[i].process().signal(SIGCONT) : servers_[i].start();
      away_[i].reset();
      known_at_[i] = monotonic_us() + milliseconds(kKnownAgain).count() * kMillisecondUs;
    }
  }

  std::mt19937_64 random_;
  Postgres database_;
  const std::string url_;
  std::array<Daemon, 3> servers_{Daemon(0), Daemon(1), Daemon(2)};
  std::vector<AskedCell> cells_;
  std::optional<Away> database_away_;
  std::array<std::optional<Away>, 3> away_;
  std::array<std::int64_t, 3> known_at_{};  // when clients know a server again that was away
  std::vector<Loss> losses_;
  int ended_by_themselves_ = 0;
};

/// When changes were acknowledged, from the history. In order.
std::vector<std::int64_t> acknowledged(const std::string& history) {
  std::vector<std::int64_t> times;
  std::ifstream lines(history);
  for (std::string line; std::getline(lines, line);) {
    const json record = json::parse(line);
    const std::string operation = record["op"];
    const bool changes = operation == "submit" || record.contains("id");
    if (changes && record.value("answer", "") == "ok") times.push_back(record["complete"]);
  }
  std::sort(times.begin(), times.end());
  return times;
}

/// Adds the time from a loss until a change was acknowledged that was made afterwards.
void add_losses(const std::vector<Fleet::Loss>& losses, const std::string& history,
                KilledFleetOutcome& outcome) {
  const auto times = acknowledged(history);
  for (const Fleet::Loss& loss : losses) {
    ++outcome.kills[loss.what];
    const bool of_database = loss.ready != 0;
    const auto first =
        std::lower_bound(times.begin(), times.end(), of_database ? loss.ready : loss.at);
    if (first == times.end()) continue;
    const double passed_s = static_cast<double>(*first - loss.at) / 1e6;
    if (of_database) {
      outcome.after_database_s.push_back(passed_s);
      outcome.after_ready_s.push_back(static_cast<double>(*first - loss.ready) / 1e6);
    } else if (loss.what.starts_with("server")) {
      outcome.after_server_s.push_back(passed_s);
    }
  }
}

/// Adds changes in the record that no client requested: models, and quarantines. They are not
/// before the second in the trail.
void add_inner_changes(const Fleet& fleet, History& history) {
  const auto since_unix = std::chrono::system_clock::now().time_since_epoch();
  const std::int64_t offset =
      std::chrono::duration_cast<std::chrono::microseconds>(since_unix).count() - monotonic_us();
  const auto invoked = [&](const std::string& at) { return 1'000'000 * std::stoll(at) - offset; };
  for (const auto& row : fleet.rows(
           "SELECT m.cell, m.version, substr(m.hash, 1, 16), COALESCE(o.verdict, '') = 'in_force', "
           "a.at FROM models AS m JOIN audit AS a ON a.cell = m.cell AND a.what = 'model' AND "
           "a.subject = 'version ' || m.version JOIN jobs AS j ON j.cell = m.cell AND "
           "j.model_version = m.version LEFT JOIN job_outcomes AS o ON o.job = j.id ORDER BY 1, 2"))
    history.add({{"op", "made"},
                 {"cell", row.at(0)},
                 {"version", std::stoi(row.at(1))},
                 {"hash", row.at(2)},
                 {"in_force", row.at(3) == "t"},
                 {"invoke", invoked(row.at(4))}});
  for (const auto& row :
       fleet.rows("SELECT cell, substr(subject, 7), at FROM audit WHERE what = 'quarantine'"))
    history.add({{"op", "quarantined"},
                 {"cell", row.at(0)},
                 {"batch", row.at(1)},
                 {"invoke", invoked(row.at(2))}});
}

/// The state of one cell in the end, as the record says.
json end_of(const Fleet& fleet, const std::string& cell) {
  json end = {{"op", "end"},
              {"cell", cell},
              {"batches", json::object()},
              {"jobs", json::object()},
              {"changes", json::array()},
              {"twice", json::array()},
              {"order", json::array()}};
  const std::string of_cell = fmt::format(" WHERE cell = '{}' ", cell);
  for (const auto& row : fleet.rows("SELECT id, hash FROM batches" + of_cell))
    end["batches"][row.at(0)] = {{"hash", row.at(1)}};
  for (const auto& row : fleet.rows("SELECT id, state FROM jobs" + of_cell))
    end["jobs"][row.at(0)] = row.at(1);
  for (const auto& row : fleet.rows("SELECT id FROM changes")) end["changes"].push_back(row.at(0));
  for (const auto& row : fleet.rows("SELECT what, subject, request FROM audit" + of_cell +
                                    "AND request <> '' GROUP BY 1, 2, 3 HAVING COUNT(*) > 1"))
    end["twice"].push_back(fmt::format("{}", fmt::join(row, " ")));
  for (const auto& row : fleet.rows("SELECT subject FROM audit" + of_cell +
                                    "AND what = 'batch' GROUP BY 1 HAVING COUNT(*) > 1"))
    end["twice"].push_back(row.at(0));
  for (const auto& row : fleet.rows("SELECT substring(after FROM 'of job [0-9]+') FROM audit" +
                                    of_cell + "AND what = 'model' GROUP BY 1 HAVING COUNT(*) > 1"))
    end["twice"].push_back(row.at(0));
  for (const auto& row :
       fleet.rows("SELECT CASE WHEN what = 'model' THEN subject ELSE request END FROM audit" +
                  of_cell + "AND what IN ('model', 'activate', 'rollback') ORDER BY number"))
    end["order"].push_back(row.at(0));
  return end;
}

bool wait_until(const std::function<bool()>& holds, seconds limit) {
  const auto until = std::chrono::steady_clock::now() + limit;
  while (!holds()) {
    if (std::chrono::steady_clock::now() > until) return false;
    pass(milliseconds(200));
  }
  return true;
}

/// The number of servers that at the end do not serve the version in force, though they had time.
int served_otherwise(const Fleet& fleet) {
  int others = 0;
  for (std::size_t i = 0; i < kServing; ++i) {
    const auto session = demand(client::Session::open(options_for({&fleet.server(i)}, kLimit)));
    for (const AskedCell& cell : fleet.cells()) {
      client::CallContext context;
      context.cell = cell.name;
      const bool same = wait_until(
          [&] {
            const auto rows = fleet.rows(fmt::format(
                "SELECT version FROM activations WHERE cell = '{}' ORDER BY number DESC LIMIT 1",
                cell.name));
            if (rows.empty()) return true;
            const auto answer = session->predict_error(context, virtual_joints(1, 7));
            return answer && std::to_string(answer->model.version) == rows.front().front();
          },
          seconds(20));
      others += same ? 0 : 1;
    }
  }
  return others;
}

class Load {
 public:
  Load(const Fleet& fleet, const KillPlan& plan, History& history) : batches_(plan.batches) {
    const std::vector<const Daemon*> both = {&fleet.server(0), &fleet.server(1)};
    const std::array<std::vector<const Daemon*>, kClients> firsts = {both, std::vector{both[0]},
                                                                     std::vector{both[1]}, both};
    for (int i = 0; i < kClients; ++i) {
      const auto at = static_cast<std::size_t>(i);
      clients_.push_back(std::make_unique<FleetClient>(
          i + 1, options_for(firsts[at], kPatience), options_for({both[at % 2]}, kPatience),
          fleet.cells(), batches_, history, plan.seed * 100 + at));
    }
  }
  void start() {
    for (const auto& client : clients_)
      threads_.emplace_back(
          [&client = *client](const std::stop_token& stop) { client.work(stop); });
  }
  void stop() { threads_.clear(); }
  [[nodiscard]] FleetClient& client(std::size_t i) { return *clients_.at(i); }

 private:
  SharedBatches batches_;
  std::vector<std::unique_ptr<FleetClient>> clients_;
  std::vector<std::jthread> threads_;
};

/// Since the last call, of all.
Predictor::Times times_of(std::deque<Predictor>& predictors) {
  Predictor::Times all;
  for (Predictor& one : predictors) {
    const Predictor::Times its = one.take();
    all.ms.insert(all.ms.end(), its.ms.begin(), its.ms.end());
    all.failed += its.failed;
  }
  return all;
}

/// A model of the cell that predictions are asked of.
void train_first(const Fleet& fleet, History& history) {
  const auto session =
      demand(client::Session::open(options_for({&fleet.server(0), &fleet.server(1)}, kLimit)));
  for (const AskedCell& cell : fleet.cells()) {
    json record = {{"op", "submit"}, {"cell", cell.name}, {"client", 0}, {"batch", "first"}};
    const std::string text = text_of(cell, 1'000);
    record["hash"] = sha256_hex(text);
    std::int64_t job = 0;
    history.ask(record, [&]() -> Result<json> {
      job = demand(session->submit_measurements(cell.name, "first", text));
      return json{{"value", job}};
    });
    static_cast<void>(demand(session->wait_for_job(job, kLimit, nullptr)));
  }
}

/// Adds the time since then (Unix time, s) that jobs of a cell waited while nobody worked for it.
void add_idle_times(const Fleet& fleet, std::int64_t since, KilledFleetOutcome& outcome) {
  const auto rows = fleet.rows(fmt::format(
      "WITH gaps AS (SELECT cell, started_at - GREATEST(created_at, {0}, COALESCE(MAX(finished_at) "
      "OVER (PARTITION BY cell ORDER BY started_at, id ROWS BETWEEN UNBOUNDED PRECEDING AND 1 "
      "PRECEDING), 0)) AS gap FROM jobs JOIN job_times ON job_times.job = jobs.id WHERE started_at "
      ">= {0}) SELECT MAX(GREATEST(gap, 0)), SUM(GREATEST(gap, 0)) FROM gaps GROUP BY cell",
      since));
  for (const auto& row : rows) {
    outcome.longest_idle_s = std::max(outcome.longest_idle_s, std::stod(row.at(0)));
    outcome.idle_s = std::max(outcome.idle_s, std::stod(row.at(1)));
  }
}

void wait_for_jobs(const Fleet& fleet, const KillPlan& plan, KilledFleetOutcome& outcome) {
  const std::int64_t since = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  const std::int64_t begin = monotonic_us();
  const auto open_jobs = [&] {
    return static_cast<int>(
        fleet.rows("SELECT 1 FROM jobs WHERE state NOT IN ('done', 'failed')").size());
  };
  outcome.jobs = static_cast<int>(fleet.rows("SELECT 1 FROM jobs").size());
  outcome.left_over = open_jobs();
  static_cast<void>(wait_until([&] { return open_jobs() == 0; }, plan.until_jobs_end));
  outcome.open = open_jobs();
  outcome.jobs_ended_s = static_cast<double>(monotonic_us() - begin) / 1e6;
  add_idle_times(fleet, since, outcome);
}

void end(Fleet& fleet, const KillPlan& plan, Load& load, History& history,
         KilledFleetOutcome& outcome) {
  wait_for_jobs(fleet, plan, outcome);
  for (const AskedCell& cell : fleet.cells()) {
    for (const std::size_t client : {std::size_t{1}, std::size_t{2}})
      load.client(client).read_models(cell.name);
    history.add(end_of(fleet, cell.name));
  }
  add_inner_changes(fleet, history);
  outcome.given_up =
      static_cast<int>(fleet.rows("SELECT 1 FROM job_outcomes WHERE verdict = 'broken'").size());
  outcome.served_otherwise = served_otherwise(fleet);
  outcome.ended_by_themselves = fleet.start_again();
  outcome.trail_whole =
      run({TRAMMEL_BINARY_DIR "/clients/trammel", "audit", "--store", fleet.url()}).exit_code == 0;
}

}  // namespace

KilledFleetOutcome kill_a_fleet(const KillPlan& plan, const std::string& path) {
  KilledFleetOutcome outcome;
  Fleet fleet(plan.seed);
  {
    History history(path);
    train_first(fleet, history);
    Load load(fleet, plan, history);
    std::deque<Predictor> predictors;
    for (int i = 0; i < 2; ++i)
      predictors.emplace_back(
          options_for({&fleet.server(0), &fleet.server(1)}, kPredictionPatience), history);
    pass(seconds(2));  // so that they find their servers
    static_cast<void>(times_of(predictors));
    pass(plan.quiet);
    outcome.p99_quiet_ms = p99(times_of(predictors).ms);
    load.start();
    pass(plan.quiet);
    outcome.p99_load_ms = p99(times_of(predictors).ms);
    fleet.kill(plan.kills, plan.longest_pause);
    pass(seconds(2));  // so that the last kill has an effect, too
    const Predictor::Times times = times_of(predictors);
    load.stop();
    outcome.p99_kills_ms = p99(times.ms);
    outcome.predictions = static_cast<int>(times.ms.size());
    outcome.failed = times.failed;
    history.add(
        {{"op", "predictions"}, {"asked", outcome.predictions}, {"failed", outcome.failed}});
    end(fleet, plan, load, history, outcome);
  }
  add_losses(fleet.losses(), path, outcome);
  return outcome;
}

Finished check_history(const std::string& history) {
  return run(
      {"/usr/bin/python3", TRAMMEL_SOURCE_DIR "/tests/faults/history/history_check.py", history},
      std::chrono::minutes(20));
}

}  // namespace trammel::test
