#include "server/diagnose/tell/file_doubts_told.h"

#include <algorithm>

#include "server/calibrate/calibrate.h"
#include "server/compensate/file_doubts.h"
#include "server/diagnose/tell/wording.h"
#include "server/measurement/resolution.h"
#include "server/measurement/sessions.h"
#include "server/robot/cell_doubts.h"

namespace trammel::cause_search {

namespace {

/// True if the cause acts at every pose alike, by the angles of the joints alone, as a tilt does.
bool acts_by_angles(const CauseRecord& record) {
  const ContextNeeds& needs = record.needs;
  return record.lasting == causes::Lasting::kAlways && !needs.time && !needs.temperature &&
         !needs.direction && !needs.velocity && !needs.payload && !needs.before && !needs.history;
}

/// The tilt of the axis of `joint` (0-based) against the next one.
Cause tilt_of(int joint) {
  Cause tilt = cause_at(cause_correcting(causes::Part::kLinks));
  tilt.parameter = fmt::format("beta{}", joint + 1);
  return tilt;
}

}  // namespace

void doubt_beside_parallel_axes(const Chain& robot, Diagnosis& diagnosis) {
  for (const int joint : rows_without_hayati(robot)) {
    for (Finding& finding : diagnosis.findings) {
      const Cause& cause = finding.cause;
      if ((cause.joint != joint && cause.joint != joint + 1) || !acts_by_angles(record_of(cause)))
        continue;
      finding.could_also_be.push_back(tilt_of(joint));
      finding.whole = true;  // a possible error of a row of the robot file enters no model
      finding.action = fmt::format(
          "write `hayati: true` in row {} of the robot file and diagnose again: the tilt of its "
          "axis against the next one has no number without it",
          joint + 1);
    }
  }
}

void tell_file_doubts(const std::shared_ptr<const Cell>& cell,
                      const std::vector<std::string>& sources, const MeasurementBatch& batch,
                      Diagnosis& diagnosis) {
  const Result<CalibrationResult> found =
      calibrate(cell, sources, batch, {.held = {}, .weigh_links = true});
  const auto add = [&](std::optional<Note> note) {
    if (note && note->severity != Note::Severity::kInfo)
      diagnosis.notes.push_back(*std::move(note));
  };
  if (found) {
    add(robot_off_drawing(found->model, found->parameters, found->discrepancy));
    if (!has_sessions(batch)) add(base_elsewhere(found->model));
    add(lengths_scaled(found->model, found->parameters, found->covariance));
  }
  if (const auto rounding = coarse_rounding(batch, *cell)) add(measurements_rounded(*rounding));
  for (const CellDoubt& doubt : doubts_of(*cell))
    if (doubt.of_robot_file)
      diagnosis.notes.push_back({doubt.code, Note::Severity::kWarning, doubt.text});
}

std::string file_doubts_said(const Diagnosis& diagnosis) {
  std::string text;
  for (const Note& note : diagnosis.notes) text += as_sentence(note.text) + " ";
  return text;
}

}  // namespace trammel::cause_search
