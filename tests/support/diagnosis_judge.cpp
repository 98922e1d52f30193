#include "tests/support/diagnosis_judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace trammel::test {

namespace {

using hidden::HiddenCase;
using hidden::HiddenCause;
using hidden::Question;

/// Row of the batch with that pose id, in the numbering of hidden cases; -1: none.
int row_of(const std::string& pose_id) {
  return pose_id.size() < 2 ? -1 : std::stoi(pose_id.substr(1)) - 1;
}

bool same_place(const Cause& said, const HiddenCause& cause) {
  const bool whole_source = said.joint < 0 && said.parameter.empty();
  if (cause.cause == "geometry" || cause.cause == "compliance") {
    return whole_source || said.parameter == cause.parameter ||
           (cause.joint > 0 && said.joint + 1 == cause.joint);
  }
  return cause.joint == 0 || said.joint + 1 == cause.joint;
}

/// True if `said` means the cause hidden at `place`. A beginning only has to be near enough.
bool means(const Cause& said, const HiddenCase& hidden, std::size_t place) {
  const HiddenCause& cause = hidden.truth.causes[place];
  if (said.cause != cause.cause || !same_place(said, cause)) return false;
  const auto [from, to] = hidden.truth.begins[place];
  const int row = row_of(said.pose_id);
  return from < 0 || row < 0 || (row >= from && row <= to);
}

/// The index of the hidden cause that `said` means.
std::optional<std::size_t> place_of(const Cause& said, const HiddenCase& hidden) {
  for (std::size_t k = 0; k < hidden.truth.causes.size(); ++k) {
    if (means(said, hidden, k)) return k;
  }
  return std::nullopt;
}

/// The candidate causes for a reader: the names and alternatives of the findings or, without a
/// finding, the causes that the batch is said not to separate.
std::vector<Cause> left_open(const Diagnosis& diagnosis) {
  std::vector<Cause> all;
  for (const Finding& finding : diagnosis.findings) {
    all.push_back(finding.cause);
    all.insert(all.end(), finding.could_also_be.begin(), finding.could_also_be.end());
  }
  if (!diagnosis.findings.empty() || diagnosis.unexplained.present) return all;
  for (const Inseparable& set : diagnosis.not_separable)
    all.insert(all.end(), set.causes.begin(), set.causes.end());
  return all;
}

std::string words_for(const Finding& finding) {
  std::string text = to_string(finding.cause);
  if (!finding.cause.pose_id.empty()) text += "@" + finding.cause.pose_id;
  for (const Cause& other : finding.could_also_be) text += "|" + to_string(other);
  return text;
}

std::string words_for(const Diagnosis& diagnosis) {
  std::string text;
  for (const Finding& finding : diagnosis.findings)
    text += (text.empty() ? "" : " + ") + words_for(finding);
  if (diagnosis.unexplained.present) {
    text += (text.empty() ? "" : " + ") + std::string("unknown");
    for (const std::string& on : diagnosis.unexplained.depends_on) text += " " + on;
  }
  return text.empty() ? "nothing" : text;
}

/// Numbers of an effect by the names under which a finding tells them, in its units.
std::vector<std::pair<std::string, double>> true_numbers(const hidden::Effect& effect) {
  const std::string& cause = effect.cause.cause;
  const Eigen::VectorXd& v = effect.values;
  const std::string joint = std::to_string(effect.cause.joint);
  if (cause == "gear_transmission")
    return {{"amplitude", 1e6 * std::hypot(v(0), v(1))}, {"order", v(2)}};
  if (cause == "encoder_eccentricity") return {{"amplitude", 1e6 * v.norm()}};
  if (cause == "joint_slip") return {{"slip" + joint, v(0)}};
  if (cause == "wrist_coupling") return {{"k54", v(0)}, {"k64", v(1)}, {"k65", v(2)}};
  if (cause == "time_lag") return {{"lag", v(0)}};
  if (cause == "geometry" || cause == "compliance") return {{effect.cause.parameter, v(0)}};
  return {};
}

std::vector<NumberFound> numbers_in(const Finding& finding, const hidden::Effect& effect) {
  std::vector<NumberFound> numbers;
  for (const auto& [name, truth] : true_numbers(effect)) {
    for (const Estimate& estimate : finding.parameters) {
      const bool meant = estimate.name == name || estimate.name.starts_with(name + "@");
      if (meant)
        numbers.push_back({effect.cause.cause + " " + name, truth, estimate.value, estimate.u95});
    }
  }
  return numbers;
}

/// The weak ripple of twice the order that every hidden gear has.
bool is_harmonic(const Cause& said, const hidden::Effect& effect) {
  return said.cause == "gear_transmission" && said.order &&
         std::abs(*said.order - 2 * effect.values(2)) < 1;
}

void count_findings(const Diagnosis& diagnosis, const HiddenCase& hidden, Judgement& judgement) {
  std::vector<bool> named(hidden.truth.causes.size(), false);
  std::vector<bool> mentioned(hidden.truth.causes.size(), false);
  for (const Finding& finding : diagnosis.findings) {
    for (std::size_t k = 0; k < mentioned.size(); ++k) {
      const auto is_it = [&](const Cause& cause) { return means(cause, hidden, k); };
      const bool open =
          std::any_of(finding.could_also_be.begin(), finding.could_also_be.end(), is_it);
      if (open || is_it(finding.cause)) mentioned[k] = true;
    }
    const auto place = place_of(finding.cause, hidden);
    if (!finding.could_also_be.empty()) {
      ++judgement.open;
    } else if (place && !named[*place]) {
      named[*place] = true;
      const std::vector<NumberFound> numbers = numbers_in(finding, hidden.world.effects[*place]);
      judgement.numbers.insert(judgement.numbers.end(), numbers.begin(), numbers.end());
    } else if (!place || !is_harmonic(finding.cause, hidden.world.effects[*place])) {
      ++judgement.wrong;
    }
  }
  judgement.right = static_cast<int>(std::count(named.begin(), named.end(), true));
  judgement.right_or_open = static_cast<int>(std::count(mentioned.begin(), mentioned.end(), true));
}

/// The dependence of an effect whose circumstance nobody recorded.
std::string traceable_dependence(const HiddenCause& cause) {
  return cause.joint > 0 ? fmt::format("q{}", cause.joint) : "time";
}

/// `left_open`: the candidate causes for a reader.
bool is_right_of_unrecorded(const Diagnosis& diagnosis, const HiddenCase& hidden,
                            const std::vector<Cause>& left_open) {
  const bool unnamed = diagnosis.findings.empty();
  if (hidden.truth.untraceable && unnamed) return true;
  const std::vector<std::string> on = {traceable_dependence(hidden.truth.causes.front())};
  if (unnamed) return diagnosis.unexplained.present && diagnosis.unexplained.depends_on == on;
  return std::any_of(left_open.begin(), left_open.end(),
                     [&](const Cause& cause) { return means(cause, hidden, 0); });
}

}  // namespace

Judgement judge(const Diagnosis& diagnosis, const HiddenCase& hidden) {
  Judgement judgement;
  judgement.said = words_for(diagnosis);
  judgement.detected = !diagnosis.findings.empty() || diagnosis.unexplained.present;
  count_findings(diagnosis, hidden, judgement);
  judgement.exact = diagnosis.verdict == Verdict::kNamed && judgement.wrong == 0 &&
                    judgement.open == 0 && !diagnosis.unexplained.present &&
                    judgement.right == static_cast<int>(hidden.truth.causes.size());
  const std::vector<Cause> mentioned = left_open(diagnosis);
  judgement.set_holds_truth = std::any_of(
      mentioned.begin(), mentioned.end(),
      [&](const Cause& cause) { return !hidden.truth.causes.empty() && means(cause, hidden, 0); });
  judgement.unrecorded_rightly =
      !hidden.truth.causes.empty() && is_right_of_unrecorded(diagnosis, hidden, mentioned);
  judgement.over_confident = judgement.right + judgement.wrong > 0;
  if (hidden.truth.question == Question::kUnknown) {
    std::vector<std::string> on = diagnosis.unexplained.depends_on;
    std::sort(on.begin(), on.end());
    judgement.unknown_rightly =
        diagnosis.verdict == Verdict::kUnknown && on == hidden.truth.causes.front().depends_on;
  }
  return judgement;
}

}  // namespace trammel::test
