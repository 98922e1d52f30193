#include "server/diagnose/tell/more_than_noise.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/base/units.h"
#include "server/diagnose/evidence/bounds.h"
#include "server/diagnose/families/candidates.h"
#include "server/diagnose/tell/between_sessions.h"
#include "server/diagnose/tell/wording.h"
#include "server/diagnose/thresholds.h"

namespace trammel::cause_search {

namespace {

constexpr double kCut = 3;  // standard deviations, beyond which the size of a row no longer counts

double ratio_of(const LeftOver& left) { return left.freedom > 0 ? left.left / left.stated : 1; }

/// Standard deviation, by chance alone, of the logarithm of the residual over the stated noise.
double by_chance(const LeftOver& left) { return 1 / std::sqrt(2 * left.freedom); }

/// The excess of the residual over the stated noise, in standard uncertainties of sigma and of
/// chance.
double deviations(const LeftOver& left) {
  return std::log(ratio_of(left)) / std::hypot(thresholds::kSigmaKnownTo, by_chance(left));
}

LeftOver left_of(const LinearProblem::Spread& spread) {
  return {spread.noise, spread.stated, spread.freedom};
}

/// The residual in position with the model's numbers within their bounds. The spread of a problem
/// ignores the bounds, so there a gearbox that lifts its load would explain the residual away.
LeftOver left_within_bounds(const LinearProblem& served) {
  LeftOver left = left_of(served.position_spread());
  double square = 0;
  for (Eigen::Index i = 0; i < served.poses(); ++i)
    square +=
        served.residual().segment<3>(served.first_row(i)).cwiseAbs2().cwiseMin(kCut * kCut).sum();
  if (left.freedom > 0) left.left *= std::sqrt(std::max(1.0, square / left.freedom));
  return left;
}

/// The residual in positions. A nameless function is reported by itself, so the model is not judged
/// by the residual without it.
LeftOver left_in_position(const Explained& explained) {
  return explained.found.unnamed.empty() ? left_within_bounds(explained.served)
                                         : left_of(explained.after.position_spread());
}

NoiseVerdict worst_of(const Explained& explained) {
  return std::max(judge_noise(left_in_position(explained)),
                  judge_noise(left_of(explained.after.rotation_spread())));
}

/// The causes of the model whose numbers would have to be beyond their bounds.
std::vector<WrongSign> wrong_signs_of(const LinearProblem& served) {
  const Background all(served.nuisance());
  const Eigen::VectorXd change = all.estimate(served.residual());
  const Eigen::MatrixXd covariance = all.covariance();
  std::vector<WrongSign> wrong;
  for (const ErrorSourcePtr& source : served.model().sources) {
    WrongSign sign = wrong_sign_of(served, source->name(), cause_of(*source, served.batch()),
                                   change, covariance);
    if (!sign.numbers.empty() && sign.is_beyond_chance()) wrong.push_back(std::move(sign));
  }
  return wrong;
}

std::string micrometres(double m) { return fmt::format("{:.3g} um", 1e6 * m); }

/// "1.7 times the stated noise in position and 1.6 times in orientation".
std::string figures(const LeftOver& position, const LeftOver& rotation, NoiseVerdict least) {
  std::string text;
  const auto add = [&](const LeftOver& left, const char* of) {
    if (judge_noise(left) < least) return;
    text += text.empty() ? fmt::format("{:.1f} times the stated noise in {}", ratio_of(left), of)
                         : fmt::format(" and {:.1f} times in {}", ratio_of(left), of);
  };
  add(position, "position");
  add(rotation, "orientation");
  return text;
}

/// ", with times and approach directions,"; empty where all was recorded.
std::string with_what_was_not_recorded(const Surrogates& unrecorded) {
  std::vector<std::string> all;
  if (unrecorded.time) all.emplace_back("times");
  if (unrecorded.temperature) all.emplace_back("temperatures");
  if (unrecorded.direction) all.emplace_back("approach directions");
  return all.empty() ? "" : fmt::format(", with {},", fmt::join(all, " and "));
}

/// True if repeated poses scatter by more than they vouch for.
bool scatter_beyond_noise(const RepeatStatistics& repeats) {
  return repeats.sigma_factor > thresholds::kRepeatsVouch;
}

/// The measurement that would show more, given the scatter of repeated poses.
std::string what_shows_more(const PreparedBatch& prepared) {
  if (prepared.repeats.degrees_of_freedom == 0)
    return "measure some poses repeatedly, which tells a noisy measurement from something that the "
           "simulation lacks, and check the tracker's sigma in the cell file";
  if (scatter_beyond_noise(prepared.repeats))
    return "find first what moves between poses measured repeatedly";
  return fmt::format(
      "poses measured repeatedly scatter by {} an axis only: the simulation lacks something that "
      "more poses{} may show",
      micrometres(prepared.repeats.sigma), with_what_was_not_recorded(prepared.surrogates));
}

/// The sessions that leave more than noise.
std::vector<LeftBySession> sessions_beyond_noise(const Explained& explained,
                                                 const PreparedBatch& prepared) {
  std::vector<LeftBySession> sessions =
      left_by_session(explained.after, explained.all, prepared.sessions);
  std::erase_if(sessions, [](const LeftBySession& one) {
    return judge_noise(one.left) != NoiseVerdict::kMoreThanNoise;
  });
  return sessions;
}

/// "session day-2 leaves 1.8 times the stated noise": the sentences about several sessions. Empty
/// if no session leaves more noise.
std::string said_of_sessions(const std::vector<LeftBySession>& beyond) {
  std::vector<std::string> all;
  for (const LeftBySession& one : beyond)
    all.push_back(
        fmt::format("session {} leaves {:.1f} times the stated noise", one.id, ratio_of(one.left)));
  return fmt::format("{}", fmt::join(all, ", "));
}

/// m, of the three axes: the residual beyond the stated noise.
double rms_beyond(const LeftOver& left) {
  return std::sqrt(3 * std::max(0.0, left.left * left.left - left.stated * left.stated));
}

/// Reports the scatter of repeated poses if it is more than noise.
void tell_scatter(const PreparedBatch& prepared, Diagnosis& diagnosis) {
  const RepeatStatistics& repeats = prepared.repeats;
  if (!scatter_beyond_noise(repeats)) return;
  const std::string hint = fmt::format(
      "poses measured repeatedly scatter by {} an axis, {:.0f} times the stated noise: that is no "
      "noise of the instrument; {}",
      micrometres(repeats.sigma), repeats.sigma_factor,
      prepared.surrogates.direction ? "were they approached from different sides (record dir "
                                      "columns), or did something move between them?"
                                    : "did something move between them?");
  Unexplained& unexplained = diagnosis.unexplained;
  if (unexplained.present) {
    diagnosis.limits.push_back(hint);
    return;
  }
  const LeftOver scatter{repeats.sigma, repeats.sigma / repeats.sigma_factor,
                         static_cast<double>(repeats.degrees_of_freedom)};
  unexplained = {true, {}, rms_beyond(scatter), chance_of_noise(scatter), as_sentence(hint)};
}

/// True if some joint came to the poses from one side only, by the record.
bool has_unseen_side(const MeasurementBatch& recorded) {
  const auto& rows = recorded.measurements;
  const auto comes_from = [&](std::size_t joint, int side) {
    return std::any_of(rows.begin(), rows.end(), [&](const Measurement& m) {
      return joint < m.context.direction.size() && m.context.direction[joint] == side;
    });
  };
  const auto joints = static_cast<std::size_t>(rows.front().context.q.size());
  for (std::size_t joint = 0; joint < joints; ++joint)
    if (!comes_from(joint, 1) || !comes_from(joint, -1)) return true;
  return false;
}

/// Adds the quantities that change the effect of the model's own causes with a wrong sign. Returns
/// the meaning of these signs and the next measurement.
std::optional<std::string> tell_wrong_signs(const LinearProblem& served,
                                            const MeasurementBatch& recorded,
                                            Unexplained& unexplained) {
  std::string text;
  bool gives_way = false;
  for (const WrongSign& one : wrong_signs_of(served)) {
    text += as_sentence(what_wrong_sign_means(one)) + " ";
    gives_way = gives_way || record_of(one.cause).gives_way;
    for (const std::string& on : one.depends_on) {
      auto& list = unexplained.depends_on;
      if (std::find(list.begin(), list.end(), on) == list.end()) list.push_back(on);
    }
  }
  if (text.empty()) return std::nullopt;
  text +=
      gives_way && has_unseen_side(recorded)
          ? "Play that grows with the load does this where every pose comes from one side: "
            "approach the poses from both sides of each joint, and record the sides (dir columns)."
          : "Measure with another known payload, or without any, which tells what goes with the "
            "load.";
  return text;
}

bool is_worse_held_out(const PreparedBatch& prepared, const Diagnosis& diagnosis) {
  if (!diagnosis.held_out_before || !diagnosis.held_out_after) return false;
  const std::size_t rows = prepared.validation.measurements.size();
  if (rows > 0 && rows < thresholds::kFewestHeldOut) return false;
  if (diagnosis.held_out_before_without && diagnosis.held_out_after_without)
    return diagnosis.held_out_after_without->rms > diagnosis.held_out_before_without->rms;
  return diagnosis.held_out_after->rms > diagnosis.held_out_before->rms;
}

}  // namespace

NoiseVerdict judge_noise(const LeftOver& left) {
  if (left.freedom <= 0 ||
      std::log(ratio_of(left)) <= thresholds::kNoiseDeviations * by_chance(left))
    return NoiseVerdict::kAsStated;
  return deviations(left) > thresholds::kNoiseDeviations ? NoiseVerdict::kMoreThanNoise
                                                         : NoiseVerdict::kLarger;
}

double chance_of_noise(const LeftOver& left) {
  if (left.freedom <= 0) return 1;
  return std::max(kLeastPValue, 0.5 * std::erfc(deviations(left) / std::sqrt(2.0)));
}

double vouched_by(const RepeatStatistics& repeats) {
  return scatter_beyond_noise(repeats) ? 1 : repeats.sigma_factor;
}

bool leaves_more_than_noise(const Explained& explained, const PreparedBatch& prepared) {
  return worst_of(explained) == NoiseVerdict::kMoreThanNoise ||
         scatter_beyond_noise(prepared.repeats) ||
         !sessions_beyond_noise(explained, prepared).empty();
}

Remainder remainder_of(const Explained& explained, const PreparedBatch& prepared,
                       const Diagnosis& diagnosis) {
  const bool more = !explained.found.unnamed.empty() ||
                    leaves_more_than_noise(explained, prepared) ||
                    is_worse_held_out(prepared, diagnosis);
  const bool larger = worst_of(explained) >= NoiseVerdict::kLarger;
  return {more, more || larger ? rms_beyond(left_in_position(explained)) : 0, larger};
}

void tell_noise(const Explained& explained, const PreparedBatch& prepared, Diagnosis& diagnosis) {
  const LeftOver position = diagnosis.left_position = left_in_position(explained);
  const LeftOver rotation = diagnosis.left_rotation = left_of(explained.after.rotation_spread());
  const std::vector<LeftBySession> beyond = sessions_beyond_noise(explained, prepared);
  tell_scatter(prepared, diagnosis);
  const NoiseVerdict worst = std::max(judge_noise(position), judge_noise(rotation));
  if (worst == NoiseVerdict::kAsStated && beyond.empty()) return;
  const std::string more = what_shows_more(prepared);
  if (worst != NoiseVerdict::kMoreThanNoise && beyond.empty()) {
    diagnosis.limits.push_back(fmt::format("a little more than noise: what is left is {}; {}",
                                           figures(position, rotation, NoiseVerdict::kLarger),
                                           more));
    return;
  }
  std::string what = figures(position, rotation, NoiseVerdict::kMoreThanNoise);
  if (!beyond.empty()) what += (what.empty() ? "" : "; ") + said_of_sessions(beyond);
  Unexplained& unexplained = diagnosis.unexplained;
  if (unexplained.present) {
    diagnosis.limits.push_back(
        fmt::format("more than noise, what is unexplained included: {}; {}", what, more));
    return;
  }
  unexplained.present = true;
  unexplained.rms = rms_beyond(position);
  unexplained.p_value = std::min(chance_of_noise(position), chance_of_noise(rotation));
  for (const LeftBySession& one : beyond) {
    unexplained.rms = std::max(unexplained.rms, rms_beyond(one.left));
    unexplained.p_value = std::min(unexplained.p_value, chance_of_noise(one.left));
  }
  unexplained.hint = fmt::format("more than noise is left: {}. ", what);
  unexplained.hint +=
      tell_wrong_signs(explained.served, diagnosis.batch, unexplained).value_or(as_sentence(more));
}

}  // namespace trammel::cause_search
