// The figures that diagnosis answers for, one row each, reached beside aim, and who was taken for
// whom. Every trial hides an effect by the second simulation and shows the diagnosis its three
// files. `diagnose_benchmark [--trials N]
// [--nulls N] [--poses N] [--kinds A,B] [--rows A,B] [--quick] [--jobs N] [--draws N]`;
// `diagnose_benchmark --replay kind,seed,lambda[,position][,ranges]` tells one trial's whole
// verdict.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <map>
#include <mutex>
#include <set>
#include <sstream>
#include <thread>

#include "tests/support/demand.h"
#include "tests/support/diagnosis_trial.h"

namespace trammel {
namespace {

using hidden::HiddenSpec;
using test::Judgement;
using test::Trial;
using test::TrialResult;

/// Columns that a batch need not have.
const std::vector<std::string> kCircumstances = {"dir", "temperature_c", "time_s"};

struct Settings {
  int trials = 40;
  int nulls = 510;
  int poses = 300;
  int jobs = 2;
  int draws = 400;
  double validation = 0;
  bool quick = false;
  std::vector<std::string> kinds, rows;
  std::string replay, without;
};

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> words;
  std::istringstream in(text);
  for (std::string word; std::getline(in, word, ',');) words.push_back(word);
  return words;
}

/// Every second trial sees positions only, every third a smaller range.
HiddenSpec spec_of(const std::string& kind, int seed, double lambda, const Settings& settings) {
  HiddenSpec spec{.kind = kind,
                  .seed = static_cast<std::uint64_t>(seed),
                  .lambda = lambda,
                  .poses = settings.poses};
  spec.orientation = seed % 2 == 1;
  spec.ranges = seed % 3 == 0 ? "6dim-m" : "calibration";
  return spec;
}

class Plan {
 public:
  explicit Plan(const Settings& settings) : settings_(settings) {}

  [[nodiscard]] std::vector<Trial> trials() && {
    decidable();
    nulls();
    for (const std::string& kind : hidden::unknown_kinds())
      add("unknown", kind, 120, settings_.trials);
    for (const std::string& kind : hidden::slow_kinds()) add("slow", kind, 120, settings_.trials);
    for (const std::string& kind : hidden::undecidable_kinds())
      add("undecidable", kind, 120, settings_.trials);
    add("three", "mixture3", 60, settings_.trials);
    add("two", "mixture2", 60, settings_.trials);
    unrecorded();
    held_out();
    next_poses();
    replicas();
    time();
    return std::move(trials_);
  }

 private:
  bool wanted(const std::string& row, const std::string& kind) const {
    const auto has = [](const std::vector<std::string>& list, const std::string& word) {
      return list.empty() || std::find(list.begin(), list.end(), word) != list.end();
    };
    return has(settings_.rows, row) && has(settings_.kinds, kind);
  }
  void add(const Trial& trial) {
    if (wanted(trial.row, trial.spec.kind)) trials_.push_back(trial);
  }
  void add(const std::string& row, const std::string& kind, double lambda, int count,
           int first_seed = 1) {
    for (int seed = first_seed; seed < first_seed + count; ++seed)
      add({row, spec_of(kind, seed, lambda, settings_)});
  }
  void decidable() {
    for (const std::string& kind : hidden::decidable_kinds()) {
      add("named60", kind, 60, settings_.trials);
      add("named120", kind, 120, settings_.trials, 1001);
    }
  }
  void nulls() {
    for (const std::string& kind : hidden::null_kinds()) {
      for (int seed = 1; seed <= (settings_.nulls + 2) / 3; ++seed) {
        Trial trial{
            "null",
            spec_of(kind, seed, kind == "null_permuted" ? 100 : 20 + 20 * (seed % 3), settings_)};
        add(trial);
        trial.row = "null_unrecorded";
        trial.spec.withheld = kCircumstances;
        add(trial);
      }
    }
  }
  /// Every second cell or so is approached from sides drawn at random, which no order of the rows
  /// tells.
  void unrecorded() {
    for (const auto& [kind, column] : {std::pair{"backlash", "dir"},
                                       {"thermal_growth", "temperature_c"},
                                       {"tracker_drift", "time_s"},
                                       {"time_lag", "time_s"}}) {
      for (int seed = 1; seed <= settings_.trials; ++seed) {
        Trial trial{"unrecorded", spec_of(kind, 300 + seed, 120, settings_)};
        trial.spec.withheld = {column};
        add(trial);
      }
    }
  }
  void held_out() {
    for (const char* kind : {"gear_transmission", "backlash", "encoder_eccentricity", "joint_slip",
                             "wrist_coupling", "thermal_growth", "joint_map", "null_white"}) {
      for (int seed = 1; seed <= std::max(2, settings_.trials / 4); ++seed) {
        Trial trial{"heldout", spec_of(kind, 500 + seed, 200, settings_)};
        trial.spec.validation_share = 0.4;
        trial.compare_with_oracle = true;
        add(trial);
      }
    }
  }
  void next_poses() {
    for (const char* kind :
         {"encoder_eccentricity", "geometry", "compliance", "payload_changed", "joint_slip"}) {
      for (int seed = 1; seed <= std::max(2, settings_.trials / 4); ++seed) {
        Trial trial{"next", spec_of(kind, 700 + seed, 60, settings_)};
        trial.spec.ranges = seed % 2 == 0 ? "6dim-m" : "6dim-l";
        trial.spec.cell_ranges = "calibration";
        trial.compare_next_poses = true;
        add(trial);
      }
    }
  }
  void replicas() {
    for (const std::string& kind : hidden::replica_kinds()) {
      for (int seed = 1; seed <= std::min(20, settings_.trials); ++seed) {
        Trial trial{kind, spec_of(kind, seed, 0, settings_)};
        trial.spec.orientation = true;
        trial.spec.poses = kind == "replica_ripple_1dim" ? 100 : settings_.poses;
        add(trial);
      }
    }
  }
  void time() {
    for (const int poses : {300, 1000}) {
      Trial trial{fmt::format("time{}", poses), spec_of("gear_transmission", 1, 120, settings_)};
      trial.spec.poses = poses;
      add(trial);
    }
  }

  const Settings& settings_;
  std::vector<Trial> trials_;
};

std::string replay_of(const HiddenSpec& spec) {
  return fmt::format(
      "--replay {},{},{:g}{}{} --poses {}{}", spec.kind, spec.seed, spec.lambda,
      spec.orientation ? "" : ",position", spec.ranges == "calibration" ? "" : "," + spec.ranges,
      spec.poses,
      (spec.validation_share > 0 ? fmt::format(" --validation {}", spec.validation_share) : "") +
          (spec.withheld.empty() ? ""
                                 : fmt::format(" --without {}", fmt::join(spec.withheld, ","))));
}

DiagnoseOptions options_of(const Settings& settings) {
  DiagnoseOptions options;
  options.draws = settings.draws;
  options.recovery = false;
  return options;
}

/// Not what was asked for, so that somebody should look at it.
bool is_bad(const TrialResult& r) {
  const Judgement& j = r.judgement;
  const std::string& row = r.trial.row;
  if (!r.error.empty()) return true;
  if (row.starts_with("null")) return j.wrong + j.open > 0;
  if (row == "unrecorded") return !j.unrecorded_rightly || j.wrong > 0;
  if (row == "unknown") return !j.unknown_rightly;
  if (row == "undecidable" || row == "replica_tool")
    return !j.set_holds_truth || (row == "undecidable" ? j.over_confident : j.wrong > 0);
  if (row == "heldout" && r.oracle_mm && r.held_out_after_mm > 1.05 * *r.oracle_mm) return true;
  if (row == "two" || row == "three" || row == "heldout" || row == "next") return j.wrong > 0;
  return !j.exact;
}

std::vector<TrialResult> run_all(const std::vector<Trial>& trials, const Settings& settings) {
  std::vector<TrialResult> results(trials.size());
  std::atomic<std::size_t> next = 0;
  std::mutex printing;
  const auto work = [&] {
    for (std::size_t k = next++; k < trials.size(); k = next++) {
      results[k] = run_trial(trials[k], options_of(settings));
      const std::lock_guard lock(printing);
      const TrialResult& r = results[k];
      std::fprintf(stderr, "%zu/%zu %s %.1f s: %s -> %s%s\n", k + 1, trials.size(),
                   r.trial.row.c_str(), r.seconds, r.truth.c_str(), r.judgement.said.c_str(),
                   is_bad(r) ? ("   " + replay_of(r.trial.spec)).c_str() : "");
    }
  };
  {
    std::vector<std::jthread> workers;
    for (int k = 1; k < settings.jobs; ++k) workers.emplace_back(work);
    work();
  }
  return results;
}

/// How many of the results of some rows are as asked.
struct Share {
  int yes = 0, all = 0;
  [[nodiscard]] double percent() const { return all == 0 ? 0 : 100.0 * yes / all; }
};

using Results = std::vector<TrialResult>;

Results of_rows(const Results& results, const std::set<std::string>& rows) {
  Results some;
  std::copy_if(results.begin(), results.end(), std::back_inserter(some),
               [&](const TrialResult& r) { return rows.contains(r.trial.row); });
  return some;
}

template <typename Asked>
Share share(const Results& results, Asked asked) {
  Share share;
  for (const TrialResult& r : results) {
    ++share.all;
    share.yes += asked(r) ? 1 : 0;
  }
  return share;
}

void print(const std::string& what, const Share& share, const char* aim) {
  if (share.all == 0) return;
  std::printf("%-72s %7.2f %%  (%d of %d)  aim %s\n", what.c_str(), share.percent(), share.yes,
              share.all, aim);
}

bool is_wrong(const TrialResult& r) { return r.judgement.wrong > 0; }

Results apart_from_rivals(const Results& results) {
  Results some;
  std::copy_if(results.begin(), results.end(), std::back_inserter(some),
               [](const TrialResult& r) { return r.beside_rival.value_or(0) >= 15; });
  return some;
}

void print_named(const Results& results) {
  const auto exact = [](const TrialResult& r) { return r.judgement.exact; };
  for (const auto& [row, aim] : {std::pair{"60", "95"}, {"120", "99"}}) {
    const Results some = of_rows(results, {std::string("named") + row});
    print(fmt::format("named exactly, lambda {}", row), share(some, exact), aim);
    print(fmt::format("  of these, {} with 15 or more beside the closest imitator", row),
          share(apart_from_rivals(some), exact), aim);
  }
  Results detected = of_rows(results, {"named60", "named120"});
  std::erase_if(detected, [](const TrialResult& r) { return !r.judgement.detected; });
  print("wrong name, given a detection", share(detected, is_wrong), "<= 2");
}

void print_abstaining(const Results& results) {
  for (const auto& [row, how] :
       {std::pair{"null", ""}, {"null_unrecorded", ", no circumstances recorded"}}) {
    for (const std::string& kind : hidden::null_kinds()) {
      Results some = of_rows(results, {row});
      std::erase_if(some, [&](const TrialResult& r) { return r.trial.spec.kind != kind; });
      print("false names, " + kind + how,
            share(some,
                  [](const TrialResult& r) { return r.judgement.wrong + r.judgement.open > 0; }),
            "<= 1");
    }
  }
  print("false names, all nulls",
        share(of_rows(results, {"null", "null_unrecorded"}),
              [](const TrialResult& r) { return r.judgement.wrong + r.judgement.open > 0; }),
        "<= 1");
  const Results unrecorded = of_rows(results, {"unrecorded"});
  print("column not recorded: the truth among what is found, lambda 120",
        share(unrecorded, [](const TrialResult& r) { return r.judgement.unrecorded_rightly; }),
        ">= 90");
  print("column not recorded: a wrong name for certain", share(unrecorded, is_wrong), "<= 2");
  const Results unknown = of_rows(results, {"unknown"});
  print("unknown effects: unknown, of the right joints, lambda 120",
        share(unknown, [](const TrialResult& r) { return r.judgement.unknown_rightly; }), ">= 90");
  print(
      "unknown effects: a false name",
      share(unknown, [](const TrialResult& r) { return r.judgement.wrong + r.judgement.open > 0; }),
      "<= 3");
  Results slow = of_rows(results, {"slow"});
  print("something slow: unknown of what it depends on, or left open",
        share(slow,
              [](const TrialResult& r) { return r.judgement.detected && r.judgement.wrong == 0; }),
        ">= 90");
  const auto walks = [](const TrialResult& r) { return r.trial.spec.kind == "slow_walk"; };
  Results walk;
  std::copy_if(slow.begin(), slow.end(), std::back_inserter(walk), walks);
  std::erase_if(slow, walks);
  print("something slow and smooth: a sure wrong name", share(slow, is_wrong), "<= 3");
  print("a zero that wanders at random: a sure wrong name", share(walk, is_wrong), "<= 3");
  const Results undecidable = of_rows(results, {"undecidable"});
  print("undecidable: the set holds the truth",
        share(undecidable, [](const TrialResult& r) { return r.judgement.set_holds_truth; }),
        ">= 98");
  print("undecidable: a single, over-confident name",
        share(undecidable, [](const TrialResult& r) { return r.judgement.over_confident; }),
        "<= 5");
}

void print_mixtures(const Results& results) {
  for (const auto& [row, size] : {std::pair{"three", 3}, {"two", 2}}) {
    int right = 0, open = 0, wrong = 0;
    const Results some = of_rows(results, {row});
    for (const TrialResult& r : some) {
      right += r.judgement.right;
      open += r.judgement.right_or_open;
      wrong += r.judgement.wrong;
    }
    print(fmt::format("{} causes at once, lambda 60 each: recall", row),
          {right, size * static_cast<int>(some.size())}, ">= 95");
    print(fmt::format("{} causes at once: named, or among what is left open", row),
          {open, size * static_cast<int>(some.size())}, "");
    print(fmt::format("{} causes at once, lambda 60 each: precision", row), {right, right + wrong},
          ">= 98");
  }
}

/// Errors of the orders found, in cycles a turn and over the standard deviation stated with them.
void print_orders(const Results& results) {
  std::vector<double> errors;
  Share near;
  double square = 0;
  for (const TrialResult& r : of_rows(results, {"named120"})) {
    for (const test::NumberFound& number : r.judgement.numbers) {
      if (!number.name.ends_with(" order")) continue;
      const double error = std::abs(number.value - number.truth);
      errors.push_back(error);
      square += std::pow(2 * error / number.u95, 2);
      ++near.all;
      near.yes += error <= 0.1 ? 1 : 0;
    }
  }
  if (errors.empty()) return;
  std::sort(errors.begin(), errors.end());
  print(fmt::format("order within 0.1 cycle a turn, lambda 120 (median error {:.3f}, rms {:.2f} "
                    "stated sigma)",
                    errors[errors.size() / 2], std::sqrt(square / near.all)),
        near, "100");
}

void print_numbers(const Results& results) {
  std::map<std::string, Share> inside;
  Share all;
  for (const TrialResult& r : of_rows(results, {"named60", "named120"})) {
    for (const test::NumberFound& number : r.judgement.numbers) {
      const std::string cause = number.name.substr(0, number.name.find_last_of(" "));
      const int is_inside = number.inside() ? 1 : 0;
      for (Share* one : {&all, &inside[number.name.ends_with(" order") ? number.name : cause]}) {
        ++one->all;
        one->yes += is_inside;
      }
    }
  }
  print("numbers inside U(k=2)", all, "93 to 98");
  for (const auto& [name, one] : inside) print("  " + name, one, "");
  print_orders(results);
}

void print_held_out(const Results& results) {
  Share near, no_worse;
  double worst = 0, sum = 0;
  for (const TrialResult& r : of_rows(results, {"heldout"})) {
    if (!r.oracle_mm || r.held_out_after_mm == 0) continue;
    const double ratio = r.held_out_after_mm / *r.oracle_mm;
    worst = std::max(worst, ratio);
    sum += ratio;
    ++near.all;
    near.yes += ratio <= 1.05 ? 1 : 0;
    ++no_worse.all;
    no_worse.yes += r.held_out_after_mm <= 1.01 * r.held_out_before_mm ? 1 : 0;
  }
  if (near.all == 0) return;
  print(fmt::format("held-out rms within 5 % of the oracle's (mean ratio {:.4f}, worst {:.4f})",
                    sum / near.all, worst),
        near, "100");
  print("held-out rms not worse than before by more than 1 %", no_worse, "100");
}

void print_next_poses(const Results& results) {
  using Worth = test::NextPosesWorth;
  const auto line = [](const std::string& what, std::vector<double> values) {
    if (values.empty()) return;
    std::sort(values.begin(), values.end());
    std::printf("%-72s median %.2f, least %.2f, of %zu  aim >= 1.3\n", what.c_str(),
                values[values.size() / 2], values.front(), values.size());
  };
  for (const auto& [by, which] :
       {std::pair{"as claimed", &TrialResult::next_poses_claimed},
        {"by the second simulation", &TrialResult::next_poses_measured}}) {
    std::vector<double> ratio, reduction;
    for (const TrialResult& r : of_rows(results, {"next"})) {
      const std::optional<Worth>& worth = r.*which;
      if (!worth) continue;
      ratio.push_back(worth->random_over_suggested());
      reduction.push_back(worth->reduction());
    }
    line(fmt::format("ten random poses' stddev over ten suggested ones', {}", by), ratio);
    line(fmt::format("stddev taken off by ten suggested poses over ten random ones, {}", by),
         reduction);
  }
}

void print_replicas(const Results& results) {
  for (const std::string& kind : hidden::replica_kinds()) {
    const bool tool = kind == "replica_tool";
    print(kind + (tool ? ": the tool among what is named, nothing else named" : ": named exactly"),
          share(of_rows(results, {kind}),
                [&](const TrialResult& r) {
                  return tool ? r.judgement.set_holds_truth && !is_wrong(r) : r.judgement.exact;
                }),
          "100");
  }
}

void print_times(const Results& results) {
  for (const auto& [row, aim] : {std::pair{"time300", 20}, {"time1000", 60}}) {
    for (const TrialResult& r : of_rows(results, {row})) {
      std::printf("%-72s %7.1f s  aim <= %d\n",
                  fmt::format("time for {} poses", r.trial.spec.poses).c_str(), r.seconds, aim);
    }
  }
}

/// What was hidden, by kind, and how often each thing was said of it.
void print_confusion(const Results& results) {
  std::printf(
      "\nwho was taken for whom (row: kind, truth's cause; then what was said, how often)\n");
  std::map<std::string, std::map<std::string, int>> said;
  std::map<std::string, Share> exact;
  for (const TrialResult& r : results) {
    const std::string key = r.trial.row + " " + r.trial.spec.kind;
    ++exact[key].all;
    exact[key].yes += r.judgement.exact ? 1 : 0;
    std::string words;
    if (r.judgement.exact) continue;
    for (const char c : r.judgement.said) words += c;
    ++said[key][words];
  }
  for (const auto& [key, one] : exact) {
    std::printf("%-40s exact %3d of %3d", key.c_str(), one.yes, one.all);
    std::vector<std::pair<int, std::string>> sorted;
    for (const auto& [words, count] : said[key]) sorted.emplace_back(count, words);
    std::sort(sorted.rbegin(), sorted.rend());
    for (const auto& [count, words] : sorted) std::printf("; %d x %s", count, words.c_str());
    std::printf("\n");
  }
}

std::string circumstances(const TrialResult& r) {
  std::string text = r.error.empty() ? "" : " " + r.error;
  if (r.beside_rival) {
    text += fmt::format(" (closest imitator {} leaves lambda {:.1f})", r.rival, *r.beside_rival);
  }
  if (r.oracle_mm) {
    text += fmt::format(" (held out {:.4f} -> {:.4f} mm, the oracle {:.4f})", r.held_out_before_mm,
                        r.held_out_after_mm, *r.oracle_mm);
  }
  return text;
}

void print_failures(const Results& results) {
  std::printf("\nreplays of what went wrong\n");
  for (const TrialResult& r : results) {
    if (!is_bad(r)) continue;
    std::printf("%s: %s -> %s%s\n", replay_of(r.trial.spec).c_str(), r.truth.c_str(),
                r.judgement.said.c_str(), circumstances(r).c_str());
  }
}

void print_all(const Results& results) {
  print_named(results);
  print_abstaining(results);
  print_numbers(results);
  print_held_out(results);
  print_mixtures(results);
  print_next_poses(results);
  print_replicas(results);
  print_times(results);
  print_confusion(results);
  print_failures(results);
}

int replay(const Settings& settings) {
  const std::vector<std::string> words = split(settings.replay);
  if (words.size() < 3) {
    std::fprintf(stderr, "--replay kind,seed,lambda[,position][,ranges]\n");
    return 2;
  }
  HiddenSpec spec{.kind = words[0],
                  .seed = std::stoull(words[1]),
                  .lambda = std::stod(words[2]),
                  .poses = settings.poses};
  for (std::size_t k = 3; k < words.size(); ++k) {
    if (words[k] == "position") {
      spec.orientation = false;
    } else {
      spec.ranges = words[k];
    }
  }
  spec.validation_share = settings.validation;
  spec.withheld = split(settings.without);
  const hidden::HiddenCase hidden = hidden::hide(spec);
  std::printf("%s", to_json(hidden.truth, hidden.world).c_str());
  const Diagnosis diagnosis = test::demand(test::diagnose_files(hidden, options_of(settings)));
  std::printf("%s", test::told(diagnosis).c_str());
  const TrialResult result =
      test::run_trial({"replay", spec, settings.validation > 0}, options_of(settings));
  std::printf("judged: %s%s; %.1f s", result.judgement.exact ? "exact, " : "",
              result.judgement.said.c_str(), result.seconds);
  std::printf("%s", circumstances(result).c_str());
  std::printf("\n");
  return 0;
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  trammel::Settings settings;
  std::string kinds, rows;
  CLI::App app("Figures of diagnosis.");
  app.add_option("--trials", settings.trials, "a kind and strength");
  app.add_option("--nulls", settings.nulls, "in all");
  app.add_option("--poses", settings.poses);
  app.add_option("--jobs", settings.jobs);
  app.add_option("--draws", settings.draws, "of the null, a diagnosis");
  app.add_option("--kinds", kinds, "only these, joined by ','");
  app.add_option("--rows", rows,
                 "only these: named60, named120, null, null_unrecorded, unrecorded, unknown, "
                 "undecidable, three, two, heldout, next, replica_..., time300, time1000");
  app.add_flag("--quick", settings.quick, "few trials of few poses");
  app.add_option("--validation", settings.validation, "share of the poses set aside in a replay");
  app.add_option("--without", settings.without, "columns withheld in a replay, joined by ','");
  app.add_option("--replay", settings.replay, "kind,seed,lambda[,position][,ranges]");
  CLI11_PARSE(app, argc, argv);
  if (settings.quick) {
    settings.trials = std::min(settings.trials, 4);
    settings.nulls = std::min(settings.nulls, 12);
    settings.poses = std::min(settings.poses, 200);
  }
  settings.kinds = trammel::split(kinds);
  settings.rows = trammel::split(rows);
  if (!settings.replay.empty()) return trammel::replay(settings);
  trammel::print_all(trammel::run_all(trammel::Plan(settings).trials(), settings));
  return 0;
}
