#include "server/tasks/accept/gate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "server/base/units.h"
#include "server/calibrate/one_session.h"
#include "server/compensate/known_rows.h"
#include "server/compensate/world.h"
#include "server/measurement/sessions.h"

namespace trammel {

namespace {

constexpr double kMedianOfChiSquare = 2.366;  // of 3 degrees of freedom
constexpr double kStillFits = 2;              // times the expected deviation, of the median pose
constexpr double kRangeMargin = 0.1;  // of a joint's range: a pose this far outside still counts as
                                      // inside
constexpr int kFewestOutside =
    10;                          // judges beyond the ranges of the model in force, to gain by them
constexpr double kUnclear = -1;  // z: a loss that is smaller may be chance

/// The errors of models at the same rows, all sessions in sequence.
struct Rows {
  Eigen::Matrix3Xd position, rotation;       // m, rad
  Eigen::VectorXd expected, expected_truth;  // m
};

Rows rows_of(const CompensatedModel& model, const std::vector<JudgingSession>& sessions,
             JudgedLevel level = JudgedLevel::kCompensated) {
  Eigen::Index count = 0;
  for (const JudgingSession& session : sessions)
    count += static_cast<Eigen::Index>(session.judges.measurements.size());
  Rows rows{Eigen::Matrix3Xd(3, count), Eigen::Matrix3Xd(3, count), Eigen::VectorXd(count),
            Eigen::VectorXd(count)};
  Eigen::Index at = 0;
  for (const JudgingSession& session : sessions) {
    const LocatedErrors errors = located_errors(model, session, level);
    const Eigen::Index n = errors.position.cols();
    rows.position.middleCols(at, n) = errors.position;
    rows.rotation.middleCols(at, n) = errors.rotation;
    rows.expected.segment(at, n) = errors.expected;
    rows.expected_truth.segment(at, n) = errors.expected_truth;
    at += n;
  }
  return rows;
}

std::vector<const Measurement*> judges_in(const std::vector<JudgingSession>& sessions) {
  std::vector<const Measurement*> all;
  for (const JudgingSession& session : sessions) {
    for (const Measurement& m : session.judges.measurements) all.push_back(&m);
  }
  return all;
}

using Columns = std::vector<Eigen::Index>;

Columns both_finite(const Eigen::Matrix3Xd& a, const Eigen::Matrix3Xd& b, const Columns& among) {
  Columns both;
  std::copy_if(among.begin(), among.end(), std::back_inserter(both),
               [&](Eigen::Index i) { return a.col(i).allFinite() && b.col(i).allFinite(); });
  return both;
}

/// `judges`: of all columns.
PairedGain gain_of(const Eigen::Matrix3Xd& before, const Eigen::Matrix3Xd& after,
                   const Columns& among, const std::vector<const Measurement*>& judges) {
  const Columns both = both_finite(before, after, among);
  if (both.empty()) return {};
  std::vector<JointVector> q;
  for (const Eigen::Index i : both) q.push_back(judges[static_cast<std::size_t>(i)]->context.q);
  return paired_gain(before(Eigen::all, both), after(Eigen::all, both), pose_groups(q));
}

double rms(const Eigen::VectorXd& values, const Columns& among) {
  return std::sqrt(values(among).squaredNorm() / static_cast<double>(among.size()));
}

bool not_worse(const PairedGain& gain, double accept_ratio) {
  if (gain.poses == 0) return true;
  return gain.rms_after <= accept_ratio * gain.rms_before &&
         (gain.z() > kUnclear || gain.rms_after <= gain.rms_before);
}

/// True if orientations are worse although positions gain: beyond chance, or by half. The residual
/// of a turn counts as at least the instrument's own `sigma` per axis.
bool clearly_worse(const PairedGain& turns, double accept_ratio, double sigma) {
  if (turns.poses == 0) return false;
  const double before = std::max(turns.rms_before, std::sqrt(3.0) * sigma);
  const bool beyond_chance = std::min(turns.z_ranks, turns.z_sum) < -PairedGain::kBeyondChance;
  return is_far_worse(before, turns.rms_after) ||
         (beyond_chance && turns.rms_after > accept_ratio * before);
}

/// The number of different poses among these rows.
int distinct(const std::vector<const Measurement*>& judges, const Columns& among) {
  std::vector<JointVector> poses;
  for (const Eigen::Index i : among) {
    const JointVector& q = judges[static_cast<std::size_t>(i)]->context.q;
    const bool known = std::any_of(poses.begin(), poses.end(), [&](const JointVector& other) {
      return (q - other).lpNorm<Eigen::Infinity>() < 1e-4;
    });
    if (!known) poses.push_back(q);
  }
  return static_cast<int>(poses.size());
}

/// `version 3`; a model without a number is the basis of a candidate.
std::string name_of(const ServedModel& model) {
  return model.version > 0 ? fmt::format("version {}", model.version)
                           : "the model without what was found";
}

constexpr const char* kAdvice = "activate it if it is wanted";

GateVerdict yes(std::string why, const GateFigures& figures) {
  return {true, "in force: " + why, false, why, figures};
}

GateVerdict no(const std::string& why, const GateFigures& figures, const std::string& advice = "") {
  return {false, "not in force: " + why + (advice.empty() ? "" : "; " + advice), false, why,
          figures};
}

GateFigures figures_of(const PairedGain& gain) {
  if (gain.poses == 0) return {};
  return {gain.rms_before, gain.rms_after, gain.rms_before};
}

GateFigures without_limit(GateFigures figures) {
  figures.limit.reset();
  return figures;
}

GateFigures with_limit(GateFigures figures, double limit) {
  figures.limit = limit;
  return figures;
}

/// Candidate and model in force on the rows that both know.
class Duel {
 public:
  Duel(const GateQuestion& question, std::vector<JudgingSession> sessions,
       const GateOptions& options)
      : candidate_(question.candidate),
        present_(*question.in_force),
        served_before_(question.served_before),
        sessions_(std::move(sessions)),
        options_(options),
        judges_(judges_in(sessions_)),
        before_(rows_of(present_.model, sessions_)),
        after_(rows_of(candidate_, sessions_)) {
    Columns all;
    for (Eigen::Index i = 0; i < before_.position.cols(); ++i) all.push_back(i);
    shared_ = both_finite(before_.position, after_.position, all);
    for (const Eigen::Index i : shared_) (in_ranges(i) ? inside_ : outside_).push_back(i);
    for (const Eigen::Index i : all) {
      if (!before_.position.col(i).allFinite() && after_.position.col(i).allFinite())
        new_tools_.push_back(i);
    }
  }

  [[nodiscard]] GateVerdict verdict() const {
    if (const std::string lost = lost_tools(); !lost.empty())
      return stays(fmt::format("it does not know {}, which {} knows", lost, name_of(present_)));
    if (const double covered = covered_by_candidate(); covered < GateOptions::kLeastCoverage)
      return stays(
          fmt::format("it was trained on {:.0f} % of the joint ranges of {}, limit {:.0f} %",
                      100 * covered, name_of(present_), 100 * GateOptions::kLeastCoverage));
    if (!shared_.empty() && apart() < GateOptions::kSame) return of_the_same();
    if (const std::string few = too_few(); !few.empty()) {
      GateVerdict undecided = stays(few, without_limit(figures_of(shared_gain())));
      undecided.undecided = true;
      undecided.held_back = HeldBack::kFewJudges;
      return undecided;
    }
    return of_another();
  }

 private:
  [[nodiscard]] bool in_ranges(Eigen::Index i) const {
    const CompensatedModel::Parts& parts = present_.model.parts();
    const JointVector margin = kRangeMargin * (parts.q_max - parts.q_min);
    const JointVector& q = judges_[static_cast<std::size_t>(i)]->context.q;
    return ((q - parts.q_min + margin).array() >= 0).all() &&
           ((parts.q_max + margin - q).array() >= 0).all();
  }
  [[nodiscard]] GateVerdict stays(const std::string& why, const GateFigures& figures = {}) const {
    return no(
        why, figures,
        fmt::format("{} stays in force; activate the new one if it is wanted", name_of(present_)));
  }
  [[nodiscard]] std::string lost_tools() const {
    std::string lost;
    for (const auto& [tool, payload] : present_.model.parts().trained_with) {
      const bool gone = !candidate_.cell().tools.contains(tool);
      if (gone || candidate_.parts().trained_with.contains({tool, payload})) continue;
      lost += fmt::format("{}tool '{}' with payload '{}'", lost.empty() ? "" : ", ", tool, payload);
    }
    return lost;
  }
  [[nodiscard]] double covered_by_candidate() const {
    const CompensatedModel::Parts& before = present_.model.parts();
    const CompensatedModel::Parts& after = candidate_.parts();
    double least = 1;
    for (Eigen::Index j = 0; j < before.q_min.size(); ++j) {
      const double range = before.q_max(j) - before.q_min(j);
      const double both =
          std::min(before.q_max(j), after.q_max(j)) - std::max(before.q_min(j), after.q_min(j));
      if (range > 1e-3) least = std::min(least, std::max(0.0, both) / range);
    }
    return least;
  }
  /// m rms, of the two predictions.
  [[nodiscard]] double apart() const {
    return rms((before_.position - after_.position).colwise().norm().transpose(), shared_);
  }
  [[nodiscard]] std::string too_few() const {
    const int poses = distinct(judges_, inside_);
    std::vector<JointVector> q;
    for (const Eigen::Index i : inside_)
      q.push_back(judges_[static_cast<std::size_t>(i)]->context.q);
    const CompensatedModel::Parts& parts = present_.model.parts();
    const double covered = coverage(q, parts.q_min, parts.q_max);
    if (poses >= GateOptions::kFewestJudges && covered >= GateOptions::kLeastCoverage) return "";
    if (poses >= GateOptions::kFewestJudges) {
      return fmt::format(
          "the {} poses held out to judge by spread over {:.0f} % of the joint ranges of {}, limit "
          "{:.0f} %",
          poses, 100 * covered, name_of(present_), 100 * GateOptions::kLeastCoverage);
    }
    return fmt::format(
        "{} poses are held out to judge by in the joint ranges of {}, {} are needed{}", poses,
        name_of(present_), GateOptions::kFewestJudges, figures());
  }
  [[nodiscard]] PairedGain shared_gain() const {
    return gain_of(before_.position, after_.position, shared_, judges_);
  }
  [[nodiscard]] std::string figures() const {
    const PairedGain gain = shared_gain();
    if (gain.poses == 0) return "";
    return fmt::format(" (held-out rms {:.4f} mm before, {:.4f} mm after)", to_mm(gain.rms_before),
                       to_mm(gain.rms_after));
  }

  /// The verdict on a candidate whose predictions equal those of the one in force; it may know one
  /// more tool.
  [[nodiscard]] GateVerdict of_the_same() const {
    const std::string same = fmt::format("it predicts what {} predicts, within {:.4f} mm",
                                         name_of(present_), to_mm(apart()));
    if (new_tools_.empty()) return of_the_base(same);
    const PairedGain gain = gain_of(rows_of(candidate_, sessions_, JudgedLevel::kNominal).position,
                                    after_.position, new_tools_, judges_);
    const std::string text = fmt::format(
        "{}, and of the tools that {} does not know: held-out rms {:.4f} mm, nominal {:.4f} mm, {} "
        "poses",
        same, name_of(present_), to_mm(gain.rms_after), to_mm(gain.rms_before), gain.poses);
    const double limit = options_.accept_ratio * gain.rms_before;
    const GateFigures figures = with_limit(figures_of(gain), limit);
    return gain.rms_after > limit ? stays(text, figures) : yes(text, figures);
  }

  /// The verdict on a candidate that differs only in the place of the base.
  [[nodiscard]] GateVerdict of_the_base(const std::string& same) const {
    MeasurementBatch newest = sessions_.back().judges;
    std::erase_if(newest.measurements, [&](const Measurement& m) {
      return !knows(candidate_, m) || !knows(present_.model, m);
    });
    if (newest.measurements.empty()) return stays(same);
    const PairedGain gain = paired_gain(present_.model, candidate_, newest);
    if (!gain.beyond_chance()) return stays(same, figures_of(gain));
    return yes(fmt::format("{}, and it knows better where the base stands: held-out rms {:.4f} mm, "
                           "before {:.4f} mm, {} poses",
                           same, to_mm(gain.rms_after), to_mm(gain.rms_before), gain.poses),
               figures_of(gain));
  }

  [[nodiscard]] bool better_by_own_account(const PairedGain& gain) const {
    if (options_.bar == Bar::kBetterBeyondChance) return false;
    return gain.z_sum > 0 && gain.rms_after < gain.rms_before &&
           rms(after_.expected_truth, inside_) <=
               GateOptions::kClaimedGain * rms(before_.expected_truth, inside_);
  }

  [[nodiscard]] GateVerdict of_another() const {
    const PairedGain gain = gain_of(before_.position, after_.position, inside_, judges_);
    const PairedGain beyond = gain_of(before_.position, after_.position, outside_, judges_);
    const PairedGain turns = gain_of(before_.rotation, after_.rotation, shared_, judges_);
    const bool kept = not_worse(gain, options_.accept_ratio);
    std::string why;
    if (gain.beyond_chance()) {
      why = fmt::format("better beyond chance (z {:.2f}, limit {:.2f})", gain.z(),
                        PairedGain::kBeyondChance);
    } else if (better_by_own_account(gain)) {
      why = fmt::format("better, and its own uncertainty is {:.4f} mm against {:.4f} mm",
                        to_mm(rms(after_.expected_truth, inside_)),
                        to_mm(rms(before_.expected_truth, inside_)));
    } else if (kept && beyond.poses >= kFewestOutside && beyond.beyond_chance()) {
      why = fmt::format(
          "not worse, and better beyond chance outside its ranges ({:.4f} mm, before {:.4f} mm, {} "
          "poses)",
          to_mm(beyond.rms_after), to_mm(beyond.rms_before), beyond.poses);
    } else if (kept && turns.beyond_chance()) {
      why = fmt::format("not worse, and its orientations are better beyond chance ({})",
                        in_words(turns));
    }
    const std::string text =
        fmt::format("held-out rms {:.4f} mm before ({}), {:.4f} mm after, on the same {} poses",
                    to_mm(gain.rms_before), name_of(present_), to_mm(gain.rms_after), gain.poses);
    GateFigures figures = figures_of(gain);
    if (why.empty()) {
      return stays(fmt::format("{}: not better beyond chance (z {:.2f}, limit {:.2f})", text,
                               gain.z(), PairedGain::kBeyondChance),
                   figures);
    }
    if (clearly_worse(turns, options_.accept_ratio, candidate_.cell().tracker.sigma_rotation))
      return stays(
          fmt::format("{}: {}, but its orientations are worse ({})", text, why, in_words(turns)),
          figures);
    if (const std::string better = better_before(figures); !better.empty())
      return stays(text + ": " + better, figures);
    return yes(fmt::format("{}: {}", text, why), figures);
  }

  static std::string in_words(const PairedGain& turns) {
    return fmt::format("{:.4f} deg, before {:.4f} deg", to_deg(turns.rms_after),
                       to_deg(turns.rms_before));
  }

  /// The name of a formerly served model that is better than the candidate on the same poses; empty
  /// if there is none. Sets the resulting limit.
  [[nodiscard]] std::string better_before(GateFigures& figures) const {
    for (const ServedModel& other : served_before_) {
      const PairedGain gain =
          gain_of(rows_of(other.model, sessions_).position, after_.position, inside_, judges_);
      if (gain.poses > 0 && gain.rms_after > options_.accept_ratio * gain.rms_before) {
        figures.limit = options_.accept_ratio * gain.rms_before;
        return fmt::format("{} has {:.4f} mm on them, limit {} x that", name_of(other),
                           to_mm(gain.rms_before), options_.accept_ratio);
      }
    }
    return "";
  }

  const CompensatedModel& candidate_;
  const ServedModel& present_;
  const std::vector<ServedModel>& served_before_;
  const std::vector<JudgingSession> sessions_;
  const GateOptions& options_;
  const std::vector<const Measurement*> judges_;
  const Rows before_, after_;
  Columns shared_, inside_, outside_, new_tools_;
};

/// The judging rows whose tools the candidate knows, in its world: each set-up of the instrument is
/// placed where the candidate found it.
MeasurementBatch judges_in_world(const GateQuestion& question) {
  MeasurementBatch all = question.sessions.back().judges;
  all.measurements.clear();
  all.sessions.clear();
  for (const JudgingSession& session : question.sessions) {
    const Result<InWorld> here = in_world_of(question.candidate, session.judges);
    if (!here) continue;
    for (const Measurement& m : here->batch.measurements) {
      if (!knows(question.candidate, m)) continue;
      all.measurements.push_back(m);
      all.measurements.back().session = 0;
    }
  }
  return all;
}

/// Judges the first model of a cell: it must beat the cell file's nominal model, and must not be
/// worse than the nominal arm placed by the same rows.
GateVerdict judge_first(const GateQuestion& question, const GateOptions& options) {
  const MeasurementBatch all = judges_in_world(question);
  if (all.measurements.empty()) return no("no pose that was held out has its tools", {}, kAdvice);
  const CompensatedModel::LevelErrors errors = question.candidate.errors_B(all);
  const PairedGain gain = paired_gain(errors.nominal, errors.compensated, pose_groups(all));
  const Rows nominal = rows_of(question.candidate, question.sessions, JudgedLevel::kNominal);
  const Rows compensated = rows_of(question.candidate, question.sessions);
  const std::vector<const Measurement*> judges = judges_in(question.sessions);
  Columns columns;
  for (Eigen::Index i = 0; i < nominal.position.cols(); ++i) columns.push_back(i);
  const PairedGain arm = gain_of(nominal.position, compensated.position, columns, judges);
  const PairedGain turns = gain_of(nominal.rotation, compensated.rotation, columns, judges);
  const bool better = options.bar == Bar::kBetterBeyondChance ? gain.beyond_chance()
                                                              : gain.rms_after < gain.rms_before;
  const std::string text = fmt::format("held-out rms {:.4f} mm, nominal {:.4f} mm, {} poses",
                                       to_mm(gain.rms_after), to_mm(gain.rms_before), gain.poses);
  const GateFigures figures = figures_of(gain);
  if (!better) return no(text + ": not better", figures, kAdvice);
  if (arm.rms_after > options.accept_ratio * arm.rms_before && arm.z() < kUnclear) {
    return no(
        fmt::format(
            "{}: it only moves the base, the arm itself is worse ({:.4f} mm, nominal {:.4f} mm)",
            text, to_mm(arm.rms_after), to_mm(arm.rms_before)),
        figures);
  }
  if (clearly_worse(turns, options.accept_ratio, question.candidate.cell().tracker.sigma_rotation))
    return no(fmt::format("{}: its orientations are worse ({:.4f} deg, nominal {:.4f} deg)", text,
                          to_deg(turns.rms_after), to_deg(turns.rms_before)),
              figures);
  return yes(text, figures);
}

/// The ratio of actual to expected error for the median judging row of the session; not a number if
/// the model knows none of them.
double misfit(const CompensatedModel& model, const JudgingSession& session) {
  const LocatedErrors errors = located_errors(model, session);
  std::vector<double> squares;
  for (Eigen::Index i = 0; i < errors.position.cols(); ++i) {
    if (errors.position.col(i).allFinite())
      squares.push_back(3 * errors.position.col(i).squaredNorm() / std::pow(errors.expected(i), 2));
  }
  if (squares.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::nth_element(squares.begin(),
                   squares.begin() + static_cast<std::ptrdiff_t>(squares.size() / 2),
                   squares.end());
  return std::sqrt(squares[squares.size() / 2] / kMedianOfChiSquare);
}

}  // namespace

namespace {

/// The names of the sessions before the last change that the model knows; empty without such a
/// change.
std::set<std::string> before_last_change(const CompensatedModel& model) {
  const CompensatedModel::Parts& parts = model.parts();
  std::size_t last = 0;
  for (const Change& change : parts.changes)
    last = std::max(last, is_of_one_session(change) ? 0 : change.session);
  std::set<std::string> names;
  for (std::size_t s = 0; s < last; ++s) names.insert(parts.sessions[s].id);
  return names;
}

/// The names of the sessions in which the reflector sat elsewhere for that day.
std::set<std::string> measured_apart(const CompensatedModel& model) {
  std::set<std::string> names;
  for (const Change& change : model.parts().changes)
    if (is_of_one_session(change)) names.insert(model.parts().sessions[change.session].id);
  return names;
}

/// `session` without rows of those sessions.
JudgingSession without(const std::set<std::string>& names, JudgingSession session) {
  const bool divided = has_sessions(session.judges);
  std::erase_if(session.judges.measurements, [&](const Measurement& m) {
    const std::string& name =
        divided ? session.judges.sessions[static_cast<std::size_t>(m.session)] : session.batch_id;
    return names.contains(name) || names.contains(session.batch_id + "/" + name);
  });
  return session;
}

/// The sessions measured since the last change of the arm, according to either model. Earlier rows
/// do not judge, and neither do sessions with a displaced reflector.
std::vector<JudgingSession> since_last_change(const GateQuestion& question) {
  std::set<std::string> before = before_last_change(question.candidate);
  std::set<std::string> apart = measured_apart(question.candidate);
  if (question.in_force != nullptr) {
    before.merge(before_last_change(question.in_force->model));
    apart.merge(measured_apart(question.in_force->model));
  }
  std::vector<JudgingSession> since;
  for (const JudgingSession& session : question.sessions) {
    JudgingSession later = without(apart, session);
    if (later.judges.measurements.empty() && !session.judges.measurements.empty()) continue;
    const auto is_before = [&](const std::string& name) {
      return before.contains(name) || before.contains(session.batch_id + "/" + name);
    };
    if (!has_sessions(session.judges)) {
      if (is_before(session.batch_id)) {
        since.clear();  // earlier sessions are older still
        continue;
      }
    } else {
      std::erase_if(later.judges.measurements, [&](const Measurement& m) {
        return is_before(session.judges.sessions[static_cast<std::size_t>(m.session)]);
      });
      if (later.judges.measurements.empty()) {
        since.clear();
        continue;
      }
    }
    since.push_back(std::move(later));
  }
  return since.empty() ? question.sessions : since;
}

}  // namespace

std::vector<JudgingSession> sessions_of_today(const GateQuestion& question) {
  const std::vector<JudgingSession> since = since_last_change(question);
  if (since.size() < question.sessions.size() || question.in_force == nullptr) return since;
  const std::vector<JudgingSession>& all = since;
  std::vector<bool> strange;
  for (const JudgingSession& s : all)
    strange.push_back(misfit(question.in_force->model, s) > kStillFits);
  std::size_t first = all.size();
  while (first > question.first_new && strange[first - 1]) --first;
  std::vector<JudgingSession> today(all.begin() + static_cast<std::ptrdiff_t>(first), all.end());
  if (!today.empty()) return today;
  for (std::size_t s = all.size(); s-- > 0;) {
    if (strange[s] && s < question.first_new) break;
    if (!strange[s]) today.insert(today.begin(), all[s]);
  }
  return today;
}

GateVerdict judge(const GateQuestion& question, const GateOptions& options) {
  const std::vector<const Measurement*> judges = judges_in(question.sessions);
  if (judges.empty()) return no("no pose was held out to judge it", {}, kAdvice);
  const Rows rows = rows_of(question.candidate, question.sessions);
  const bool overflows = std::any_of(
      judges.begin(), judges.end(), [&, i = Eigen::Index{0}](const Measurement* m) mutable {
        const Eigen::Index at = i++;
        return knows(question.candidate, *m) && !rows.position.col(at).allFinite();
      });
  if (overflows) return no("its held-out rms is not finite", {});
  if (question.in_force == nullptr) return judge_first(question, options);
  return Duel(question, sessions_of_today(question), options).verdict();
}

}  // namespace trammel
