#include "server/tasks/accept/verdict.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/base/units.h"
#include "server/compensate/model_notes.h"

namespace trammel {

namespace {

/// The first session that came after the training of `model`: behind its own batches or, if none of
/// these is in `sessions`, behind all that were measured before it.
std::size_t first_new(const std::vector<JudgingSession>& sessions, const CompensatedModel& model) {
  const ModelProvenance& provenance = model.provenance();
  const auto behind = [&](const auto& is_old) {
    return static_cast<std::size_t>(sessions.rend() -
                                    std::find_if(sessions.rbegin(), sessions.rend(), is_old));
  };
  const std::size_t own =
      behind([&](const JudgingSession& one) { return one.batch_id == provenance.batch_id; });
  if (own > 0) return own;
  const std::string several = "+" + provenance.batch_id + "+";  // joined by plus signs
  const std::size_t last = behind([&](const JudgingSession& one) {
    return several.find("+" + one.batch_id + "+") != std::string::npos;
  });
  if (last > 0) return last;
  const std::int64_t made_at = provenance.measured_at.value_or(provenance.trained_at);
  return behind([&](const JudgingSession& session) {
    return session.training.measured_at.value_or(0) <= made_at;
  });
}

/// Judges against the record of the version marked in force, if that version cannot be loaded: by
/// the held-out poses from its training.
GateVerdict judge_by_record(const CompensatedModel& candidate, const RecordInForce& record,
                            const std::vector<JudgingSession>& sessions, double accept_ratio,
                            GateVerdict otherwise) {
  double sum = 0;
  Eigen::Index count = 0;
  for (const JudgingSession& session : sessions) {
    const LocatedErrors errors = located_errors(candidate, session);
    for (Eigen::Index i = 0; i < errors.position.cols(); ++i) {
      if (!errors.position.col(i).allFinite()) continue;
      sum += errors.position.col(i).squaredNorm();
      ++count;
    }
  }
  const double rms = count > 0 ? std::sqrt(sum / static_cast<double>(count)) : 0;
  if (record.validation_rms == 0 || rms <= accept_ratio * record.validation_rms) return otherwise;
  const std::string why = fmt::format(
      "held-out rms {:.4f} mm, limit {} x {:.4f} mm that version {} had on its own, which is "
      "marked in force but cannot be loaded",
      to_mm(rms), accept_ratio, to_mm(record.validation_rms), record.version);
  const double limit = accept_ratio * record.validation_rms;
  return {false,
          "not in force: " + why + "; activate it if it is wanted",
          false,
          why,
          {{}, rms, limit}};
}

/// The verdict if the notes of the candidate keep it from being put in force automatically,
/// whatever the judges say.
GateVerdict left_to_a_person(const Note& stop, GateFigures figures) {
  return {false,
          "not in force: " + stop.text + "; activate it if it is right",
          true,
          stop.text,
          std::move(figures),
          HeldBack::kStopNote};
}

}  // namespace

GateVerdict verdict_on(const CompensatedModel& candidate, const ServedModel* in_force,
                       std::vector<ServedModel> served_before,
                       const std::optional<RecordInForce>& record,
                       const std::vector<JudgingSession>& sessions, const GateOptions& options) {
  GateQuestion question{candidate, in_force, std::move(served_before), sessions, 0};
  if (in_force != nullptr) question.first_new = first_new(sessions, in_force->model);
  GateVerdict verdict = judge(question, options);
  const auto stop = stop_of(candidate);
  if (stop) verdict.held_back = HeldBack::kStopNote;
  if (!verdict.put_in_force) return verdict;
  if (stop) return left_to_a_person(*stop, std::move(verdict.figures));
  if (!record) return verdict;
  return judge_by_record(candidate, *record, sessions, options.accept_ratio, std::move(verdict));
}

}  // namespace trammel
