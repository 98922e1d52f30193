#include "server/report/history_json.h"

#include <optional>

#include "server/report/note_json.h"

namespace trammel {
namespace {

using nlohmann::ordered_json;

template <typename Number>
ordered_json if_told(const std::optional<Number>& number) {
  return number ? ordered_json(*number) : ordered_json(nullptr);
}

}  // namespace

ordered_json model_json(const exchange::ModelInfo& model) {
  return {{"cell", model.cell},
          {"version", model.version},
          {"in_force", model.in_force},
          {"id", model.id},
          {"hash", model.hash},
          {"level", model.level},
          {"batch", model.batch_id},
          {"batch_hash", model.batch_hash},
          {"trained_at_unix_s", model.trained_at_unix_s},
          {"training_age_s", model.training_age_s},
          {"measured_at_unix_s", if_told(model.measured_at_unix_s)},
          {"data_age_s", if_told(model.data_age_s)},
          {"training_poses", model.training_poses},
          {"validation_rms_mm", if_told(model.validation_rms_mm)},
          {"notes", notes_json(model.notes)},
          {"budget", {{"sentences", model.budget}}}};
}

ordered_json job_json(const exchange::JobStatus& job) {
  return {{"job", job.job},
          {"cell", job.cell},
          {"stage", job.stage},
          {"what", job.what},
          {"share", job.share},
          {"model_version", job.model_version},
          {"in_force", job.in_force},
          {"verdict", job.verdict},
          {"held_back", job.held_back},
          {"before_mm", if_told(job.before_mm)},
          {"after_mm", if_told(job.after_mm)},
          {"limit_mm", if_told(job.limit_mm)},
          {"u95_mm", if_told(job.u95_mm)},
          {"why", job.why},
          {"next", job.next}};
}

ordered_json jobs_json(const std::vector<exchange::DatedJob>& jobs) {
  ordered_json list = ordered_json::array();
  for (const exchange::DatedJob& job : jobs) {
    ordered_json one = job_json(job.status);
    one.update({{"server", job.worker.empty() ? job.server : job.worker},
                {"kind", job.kind},
                {"batches", job.batches},
                {"created_unix_s", job.created_unix_s},
                {"started_unix_s", if_told(job.started_unix_s)},
                {"finished_unix_s", if_told(job.finished_unix_s)}});
    list.push_back(std::move(one));
  }
  return list;
}

ordered_json models_json(const std::vector<exchange::ModelInfo>& models) {
  ordered_json json = ordered_json::array();
  for (const exchange::ModelInfo& model : models) json.push_back(model_json(model));
  return json;
}

}  // namespace trammel
