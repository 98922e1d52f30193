#include "tests/benchmarks/year/cell_year.h"

#include <algorithm>
#include <cmath>
#include <iostream>

#include "server/base/units.h"
#include "server/measurement/checked_batch.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"

namespace trammel::year {
namespace {

using test::demand;

constexpr double kTolerance = 2e-4;  // m, of a hole
constexpr int kFirstPoses = 120, kPosesAfterAChange = 100, kPosesOfAQuarter = 60;
constexpr int kHoles = 25;
constexpr int kToldWithin = 2;  // weeks
constexpr int kQuarter = 13;    // weeks

bool is(const Event& event, const Named& name) {
  const bool kind =
      std::find(event.names.begin(), event.names.end(), name.cause) != event.names.end();
  return kind && (event.joint == 0 || name.joint == event.joint);
}

/// True if every arm has the cause from the first day on, and no cell file lists it.
bool is_of_every_arm(const Named& name) {
  return name.cause == "gear_transmission" && name.joint <= 4;
}

bool is(const Event& event, const std::vector<Named>& names) {
  return std::any_of(names.begin(), names.end(),
                     [&](const Named& name) { return is(event, name); });
}

bool is_open(const std::vector<Named>& names) {
  return names.empty() || std::any_of(names.begin(), names.end(),
                                      [](const Named& name) { return name.cause == "unknown"; });
}

std::optional<CompensatedModel> trained(const Arm& arm, const MeasurementBatch& batch,
                                        const TrainOptions& options) {
  const auto checked = check_against_cell(batch, *arm.cell(), drawn(0.2, 1));
  if (!checked) return std::nullopt;
  const auto model = train(arm.cell(), *checked, options);
  return model ? std::optional(*model) : std::nullopt;
}

}  // namespace

CellYear::CellYear(const Arm& arm, client::Session& session, bool talk)
    : arm_(arm), talk_(talk), metrologist_(arm, session), driller_(arm, session, kTolerance) {
  for (const Event& event : arm.events())
    told_[event.what] = {arm.cell()->name, event.week, 0, event.what, event.slow, Told::kMissed};
}

void CellYear::tell(int week, const std::string& what) const {
  if (!talk_) return;
  fmt::print("  week {:2} {}: {}\n", week, arm_.cell()->name, what);
  std::cout.flush();
}

void CellYear::measure(int week, int poses) {
  Taken taken = metrologist_.measure(week, poses);
  tell(week, fmt::format("{} poses: {}", poses, taken.verdict));
  if (taken.quarantined && poses == kPosesAfterAChange) {
    taken = metrologist_.release();
    tell(week, "released: " + taken.verdict);
  }
  if (taken.in_force) modelled_ = week;
  trusted_ = taken.in_force || (trusted_ && poses < kPosesAfterAChange);
  TrainOptions options;
  options.level = "M1";  // the drawing, and where the tracker stood
  options.bias = "se";
  if (auto model = trained(arm_, metrologist_.last(), options)) without_physics_ = std::move(model);
}

void CellYear::begin() { measure(0, kFirstPoses); }

void CellYear::live(int week, YearScore& score) {
  lived_ = week;
  for (const Event& event : arm_.events())
    if (event.week == week) tell(week, "(truth) " + event.what);
  const Said said = metrologist_.check(week);
  judge(said, week, score);
  trusted_ = !said.changed && !said.cannot_tell;
  if (said.changed || week % kQuarter == 0) {
    const double before = driller_.error_in_force(week).value_or(0);
    const int version = metrologist_.in_force();
    measure(week, said.changed ? kPosesAfterAChange : kPosesOfAQuarter);
    const Said found = metrologist_.diagnose();
    tell(week, "diagnosis: " + found.sentence);
    for (const std::vector<Named>& names : found.seen) judge_name(names, week, score);
    trusted_ = trusted_ || found.in_force;
    if (found.in_force) modelled_ = week;
    count_step(before, version, week, score);
  }
  drill(week, score);
}

void CellYear::take(const BadBatch& bad, int week, YearScore& score) {
  const double before = driller_.error_in_force(week).value_or(0);
  const int version = metrologist_.in_force();
  const Taken taken = metrologist_.submit(fmt::format("bad-{}", week), bad.batch);
  tell(week, fmt::format("a batch {}: {}", bad.what, taken.verdict));
  ++score.bad_batches;
  score.bad_in_force += taken.in_force ? 1 : 0;
  count_step(before, version, week, score);
}

bool CellYear::is_as_modelled(int week) const {
  return std::none_of(arm_.events().begin(), arm_.events().end(), [&](const Event& event) {
    return event.week <= week && (event.week > modelled_ || event.slow || event.week == 0);
  });
}

void CellYear::judge(const Said& said, int week, YearScore& score) {
  ++score.checks;
  if (said.changed || said.cannot_tell) tell(week, "check: " + said.sentence);
  if (said.changed && is_as_modelled(week)) {
    ++score.false_alarms;
    tell(week, "FALSE ALARM");
    return;
  }
  for (const std::vector<Named>& names : said.seen) judge_name(names, week, score);
  if (!said.changed && !said.cannot_tell) return;
  for (const Event& event : arm_.events()) {
    EventOfYear& told = told_[event.what];
    const bool now =
        event.week <= week && (event.slow || event.week == 0 || week - event.week <= kToldWithin);
    if (!now || told.told != Told::kMissed) continue;
    told.told = Told::kOpen;
    told.told_in = week;
  }
}

/// One thing that was said to have changed: right, open, or wrong.
void CellYear::judge_name(const std::vector<Named>& names, int week, YearScore& score) {
  ++score.changes_told;
  bool right = std::any_of(names.begin(), names.end(), is_of_every_arm);
  for (const Event& event : arm_.events()) {
    if (event.week > week || !is(event, names)) continue;
    right = true;
    EventOfYear& told = told_[event.what];
    const bool late = !event.slow && event.week > 0 && week - event.week > kToldWithin;
    if (told.told == Told::kNamed || late) continue;
    told.told = Told::kNamed;
    told.told_in = week;
  }
  if (right || is_open(names)) return;
  ++score.wrong_names;
  tell(week, fmt::format("WRONG NAME {}:{}", names.front().cause, names.front().joint));
}

void CellYear::count_step(double before, int version_before, int week, YearScore& score) {
  if (metrologist_.in_force() == version_before || before <= 0) return;
  const double after = driller_.error_in_force(week).value_or(before);
  ++score.steps;
  score.worse += after > 1.15 * before ? 1 : 0;
  tell(week, fmt::format("true error {:.4f} -> {:.4f} mm{}", to_mm(before), to_mm(after),
                         after > 1.15 * before ? " WORSE" : ""));
}

double CellYear::oracle_error(int week) {
  const auto now = [&](const Event& event) {
    return event.slow ? event.week <= week && week % 4 == 0 : event.week == week;
  };
  if (!oracle_ || std::any_of(arm_.events().begin(), arm_.events().end(), now)) {
    const auto seed = static_cast<std::uint64_t>(5000 + week);
    oracle_ = trained(arm_, arm_.measured(arm_.poses(kFirstPoses, seed), week, seed, false), {});
  }
  return driller_.error_of(*oracle_, week);
}

void CellYear::drill(int week, YearScore& score) {
  const std::vector<Hole> holes =
      driller_.drill(week, kHoles, static_cast<std::uint64_t>(300 + week));
  double sum = 0;
  int drilled = 0;
  for (const Hole& hole : holes) {
    const bool warned = hole.warned || !trusted_, out = hole.error > kTolerance;
    ++score.holes;
    score.holes_warned += warned ? 1 : 0;
    score.out += out ? 1 : 0;
    score.out_without_warning += out && !warned ? 1 : 0;
    if (hole.warned) continue;
    sum += hole.error * hole.error;
    ++drilled;
  }
  const double rms = std::sqrt(sum / std::max(1, drilled));
  score.weeks.push_back(
      {arm_.cell()->name, week, rms, driller_.error_in_force(week).value_or(0), oracle_error(week),
       without_physics_ ? driller_.error_of(*without_physics_, week) : 0, !trusted_});
}

void CellYear::finish(YearScore& score) const {
  for (const auto& [what, event] : told_)
    if (event.week <= lived_) score.events.push_back(event);
}

}  // namespace trammel::year
