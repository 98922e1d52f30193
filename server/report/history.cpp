#include "server/report/history.h"

#include <cmath>

#include "server/base/coverage.h"
#include "server/base/units.h"
#include "server/compensate/model_notes.h"
#include "server/compensate/session_changes.h"
#include "server/report/note_json.h"

namespace trammel {

namespace {

using nlohmann::ordered_json;

bool is_same(const ParameterOnRecord& one, const ParameterOnRecord& other) {
  return one.cause == other.cause && one.name == other.name && one.unit == other.unit;
}

ordered_json optional_mm(const std::optional<double>& m) {
  return m ? ordered_json(to_mm(*m)) : ordered_json(nullptr);
}

ordered_json parameter_json(const ParameterOnRecord& one) {
  return {{"cause", one.cause},        {"parameter", one.name},
          {"value", one.value},        {"u95", one.u95},
          {"unit", one.unit},          {"identified", one.identified},
          {"of_set_up", one.of_set_up}};
}

ordered_json version_json(const VersionOnRecord& one) {
  ordered_json parameters = ordered_json::array();
  for (const ParameterOnRecord& parameter : one.parameters)
    parameters.push_back(parameter_json(parameter));
  return {{"version", one.version},
          {"model", one.id},
          {"batches", one.batches},
          {"trained_at", one.trained_at},
          {"poses", one.poses},
          {"validation_rms_mm", optional_mm(one.validation_rms)},
          {"in_force", one.in_force},
          {"parameters", std::move(parameters)},
          {"notes", notes_json(one.notes)}};
}

ordered_json training_json(const TrainingOnRecord& one) {
  return {{"at", one.at},
          {"batches", one.batches},
          {"verdict", one.verdict},
          {"before_mm", optional_mm(one.before)},
          {"after_mm", optional_mm(one.after)},
          {"why", one.why}};
}

ordered_json moved_json(const Moved& one) {
  return {{"cause", one.cause},
          {"parameter", one.parameter},
          {"unit", one.unit},
          {"from_version", one.from_version},
          {"to_version", one.to_version},
          {"from", one.from},
          {"to", one.to},
          {"u95", one.u95}};
}

}  // namespace

void put_on_record(const CompensatedModel& model, VersionOnRecord& version) {
  const CompensatedModel::Parts& parts = model.parts();
  version.notes = notes_of(model);
  version.papers = papers_of(model.cell()).value_or(CellPapers());
  version.parameters.clear();
  std::size_t next = 0;
  for (const ErrorSourcePtr& source : parts.physics.sources) {
    for (std::size_t k = 0; k < source->parameters().size(); ++k) {
      const IdentifiedParameter& one = parts.parameters[next++];
      version.parameters.push_back({cause_in_words(source->name()), one.parameter.name,
                                    one.parameter.unit, one.parameter.scale * one.value,
                                    kExpanded * one.parameter.scale * one.stddev, one.identified,
                                    source->cause().part == causes::Part::kBase});
    }
  }
}

VersionOnRecord on_record(const CompensatedModel& model, int version) {
  const ModelProvenance& made = model.provenance();
  const auto& judged = model.parts().validation;
  VersionOnRecord one{version,
                      made.id,
                      made.batch_id,
                      made.trained_at,
                      made.training_poses,
                      judged ? std::optional(judged->compensated.rms) : std::nullopt};
  put_on_record(model, one);
  return one;
}

std::vector<Moved> moved_parameters(const CellHistory& history) {
  std::vector<Moved> moved;
  const VersionOnRecord* before = nullptr;
  for (const VersionOnRecord& now : history.versions) {
    if (now.parameters.empty()) continue;
    for (const ParameterOnRecord& one : now.parameters) {
      if (before == nullptr || one.of_set_up || !one.identified) continue;
      for (const ParameterOnRecord& was : before->parameters) {
        if (!was.identified || !is_same(one, was)) continue;
        const double u95 = std::hypot(one.u95, was.u95);
        if (std::abs(one.value - was.value) > u95)
          moved.push_back({one.cause, one.name, one.unit, before->version, now.version, was.value,
                           one.value, u95});
      }
    }
    before = &now;
  }
  return moved;
}

ordered_json history_json(const CellHistory& history) {
  ordered_json json = {{"cell", history.cell},
                       {"versions", ordered_json::array()},
                       {"trainings", ordered_json::array()},
                       {"moved", ordered_json::array()},
                       {"events", ordered_json::array()}};
  for (const VersionOnRecord& one : history.versions) json["versions"].push_back(version_json(one));
  for (const TrainingOnRecord& one : history.trainings)
    json["trainings"].push_back(training_json(one));
  for (const Moved& one : moved_parameters(history)) json["moved"].push_back(moved_json(one));
  for (const EventOnRecord& one : history.events) {
    json["events"].push_back({{"at", one.at},
                              {"what", one.what},
                              {"subject", one.subject},
                              {"from", one.before},
                              {"to", one.after},
                              {"why", one.why},
                              {"who", one.who}});
  }
  return json;
}

}  // namespace trammel
