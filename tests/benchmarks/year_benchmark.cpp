// A year of a plant in an hour: arms of seven types, one service over DDS, and a truth that nobody
// sees but the score. Every week each arm is checked with twelve poses; what a check calls changed
// is measured, trained from and diagnosed; programs are drilled. Tools are exchanged, payloads
// change, joints lose their zeros and wear, the hall warms up and cools down, trackers are set up
// anew, batches are sent that never should have been, and the server is killed. Beside it an oracle
// that measures a fresh batch whenever the arm is another one, and a Gaussian process without
// physics.
// --weeks N, --cells N, --seed N, --page FILE, --talk.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <condition_variable>
#include <filesystem>
#include <mutex>
#include <thread>

#include "server/base/text_file.h"
#include "tests/benchmarks/year/cell_year.h"
#include "tests/support/daemon.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"

namespace trammel::year {
namespace {

using test::demand;
using test::tell_figure;

constexpr int kBadEvery = 5, kKilledEvery = 7;  // weeks

struct Settings {
  int weeks = kWeeks, cells = 12;
  std::uint64_t seed = 1;
  std::string page;
  bool talk = false;
};

void write(const std::filesystem::path& path, const std::string& text) {
  static_cast<void>(demand(write_text_file(path.string(), text).map([] { return true; })));
}

/// A daemon with the files of all cells.
class Service {
 public:
  explicit Service(const std::vector<Arm>& arms) {
    const auto folder = std::filesystem::path(daemon_.config_path()).parent_path();
    std::string cells;
    for (const Arm& arm : arms) {
      write(folder / (arm.cell()->name + ".yaml"), arm.cell_yaml());
      cells += (cells.empty() ? "" : ", ") + arm.cell()->name + ".yaml";
    }
    write(daemon_.config_path(),
          fmt::format(
              "version: 1\nserver: year\ncells: [{}]\nstore: trammel.db\nlog: {{level: info}}\n",
              cells));
    daemon_.start();
  }
  [[nodiscard]] std::unique_ptr<client::Session> open() const {
    return demand(client::Session::open(daemon_.session_options()));
  }
  void kill_and_start() {
    daemon_.kill();
    daemon_.start();
  }

 private:
  test::Daemon daemon_;
};

/// A CAM computer that asks one question after the other, all year.
class Asker {
 public:
  Asker(std::unique_ptr<client::Session> session, const Arm& arm)
      : session_(std::move(session)),
        thread_([this, &arm](const std::stop_token& stop) { ask(stop, arm); }) {}
  void count(YearScore& score) {
    thread_.request_stop();
    thread_.join();
    score.asked = asked_;
    score.lost = lost_;
  }

 private:
  void ask(const std::stop_token& stop, const Arm& arm) {
    const Eigen::VectorXd q = arm.poses(1, 9).row(0);
    client::CallContext context;
    context.cell = arm.cell()->name;
    const std::vector<std::vector<double>> joints{{q.begin(), q.end()}};
    while (!stop.stop_requested()) {
      ++asked_;
      if (!session_->predict_error(context, joints)) ++lost_;
      std::unique_lock lock(mutex_);
      wake_.wait_for(lock, stop, std::chrono::milliseconds(200), [] { return false; });
    }
  }
  std::unique_ptr<client::Session> session_;
  std::atomic<int> asked_{0}, lost_{0};
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::jthread thread_;
};

/// The server is killed while it trains from a batch that it has acknowledged.
void kill_in_a_training(Service& service, CellYear& cell, int week, YearScore& score) {
  const auto seed = static_cast<std::uint64_t>(9000 + week);
  const MeasurementBatch batch = cell.arm().measured(cell.arm().poses(40, seed), week, seed, false);
  const auto session = service.open();
  const auto job = session->submit_measurements(cell.arm().cell()->name,
                                                fmt::format("kill-{}", week), to_csv(batch));
  service.kill_and_start();
  ++score.kills;
  if (!job || cell.metrologist().follow(*job).verdict.starts_with("no ")) ++score.jobs_lost;
}

YearScore year(const Settings& settings) {
  const std::vector<Arm> arms = plant(settings.cells, settings.seed);
  Service service(arms);
  const auto session = service.open();
  std::vector<std::unique_ptr<CellYear>> cells;
  for (const Arm& arm : arms)
    cells.push_back(std::make_unique<CellYear>(arm, *session, settings.talk));
  for (const auto& cell : cells) cell->begin();
  Asker asker(service.open(), arms.front());
  YearScore score;
  for (int week = 1; week < settings.weeks; ++week) {
    for (std::size_t i = 0; i < cells.size(); ++i) {
      cells[i]->live(week, score);
      const int turn = week + static_cast<int>(i);
      if (turn % (kBadEvery * settings.cells) == 0)
        cells[i]->take(
            bad_batch(arms[i], week, turn / (kBadEvery * settings.cells) + static_cast<int>(i),
                      static_cast<std::uint64_t>(7000 + week)),
            week, score);
    }
    if (week % kKilledEvery == 0)
      kill_in_a_training(service, *cells[static_cast<std::size_t>(week) % cells.size()], week,
                         score);
  }
  asker.count(score);
  for (const auto& cell : cells) cell->finish(score);
  return score;
}

double rms(const std::vector<WeekOfArm>& weeks, double WeekOfArm::*error) {
  double sum = 0;
  for (const WeekOfArm& week : weeks) sum += week.*error * (week.*error);
  return std::sqrt(sum / static_cast<double>(weeks.size()));
}

double percent(int count, int of) { return of == 0 ? 0 : 100.0 * count / of; }

void tell(const YearScore& score) {
  std::vector<double> ratios;
  std::vector<WeekOfArm> relied_on;
  for (const WeekOfArm& week : score.weeks) {
    if (week.warned || week.holes == 0) continue;
    relied_on.push_back(week);
    ratios.push_back(week.holes / week.oracle);
  }
  std::sort(ratios.begin(), ratios.end());
  const auto told = [&](Told how) {
    return static_cast<int>(
        std::count_if(score.events.begin(), score.events.end(),
                      [&](const EventOfYear& event) { return event.told == how; }));
  };
  const auto events = static_cast<int>(score.events.size());
  tell_figure("year_hole_error_over_oracle_median", ratios[ratios.size() / 2]);
  tell_figure("year_hole_error_over_oracle",
              rms(relied_on, &WeekOfArm::holes) / rms(relied_on, &WeekOfArm::oracle));
  tell_figure("year_hole_error_over_oracle_with_warned_weeks",
              rms(score.weeks, &WeekOfArm::holes) / rms(score.weeks, &WeekOfArm::oracle));
  tell_figure("year_without_physics_over_oracle",
              rms(score.weeks, &WeekOfArm::without_physics) / rms(score.weeks, &WeekOfArm::oracle));
  tell_figure("year_holes_warned_percent", percent(score.holes_warned, score.holes));
  tell_figure("year_holes_out_without_warning_percent",
              percent(score.out_without_warning, score.holes));
  tell_figure("year_events", events);
  tell_figure("year_events_named_percent", percent(told(Told::kNamed), events));
  tell_figure("year_events_open_percent", percent(told(Told::kOpen), events));
  tell_figure("year_wrong_names_percent", percent(score.wrong_names, score.changes_told));
  tell_figure("year_false_alarms_percent", percent(score.false_alarms, score.checks));
  tell_figure("year_models_worse_than_1.15", score.worse);
  tell_figure("year_models", score.steps);
  tell_figure("year_bad_batches_in_force", score.bad_in_force);
  tell_figure("year_jobs_lost_by_kills", score.jobs_lost);
  tell_figure("year_questions", score.asked);
  tell_figure("year_questions_lost", score.lost);
}

}  // namespace
}  // namespace trammel::year

int main(int argc, char** argv) {
  CLI::App app("A year of a plant, scored by the truth");
  trammel::year::Settings settings;
  app.add_option("--weeks", settings.weeks, "of the year");
  app.add_option("--cells", settings.cells, "arms");
  app.add_option("--seed", settings.seed, "what the arms are like, and what happens to them");
  app.add_option("--page", settings.page, "HTML file that shows the year");
  app.add_flag("--talk", settings.talk, "what is said week by week");
  CLI11_PARSE(app, argc, argv);
  const trammel::year::YearScore score = trammel::year::year(settings);
  trammel::year::tell(score);
  if (!settings.page.empty()) trammel::year::write(settings.page, year_page(score));
}
