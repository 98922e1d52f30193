#include <algorithm>
#include <utility>

#include "server/base/text_file.h"
#include "server/base/unix_time.h"
#include "server/compensate/model_file.h"
#include "server/store/audit_rows.h"
#include "server/store/cell_rows.h"
#include "server/store/changes.h"
#include "server/store/connection.h"
#include "server/store/job_rows.h"
#include "server/store/pruned.h"
#include "server/store/store.h"

// Models, and the history of the versions in force.

namespace trammel {
namespace {

constexpr std::size_t kMostToServe = 100;  // versions that are tried to serve a cell
constexpr std::size_t kWholeWay = 1'000'000;

/// A row of the cell's history of models in force.
struct Activation {
  std::int64_t number = 0;
  int version = 0;
  std::optional<std::int64_t> back;
};

std::optional<Activation> next_activation(Rows& rows) {
  if (!rows.next()) return std::nullopt;
  return Activation{rows.integer64(0), rows.integer(1), optional_integer(rows, 2)};
}

std::optional<Activation> activation_of(Rows row) { return next_activation(row); }

std::optional<Activation> present_activation(Database& database, const std::string& cell) {
  return activation_of(prepare(
      database,
      "SELECT number, version, back FROM activations WHERE cell = $1 ORDER BY number DESC LIMIT 1",
      cell));
}

/// Adds the version in force and the targets of rollbacks from there, the next one first. The
/// versions before a damaged row are still added.
void add_way_back(Database& database, const std::string& cell, std::size_t most,
                  std::vector<Activation>& way) {
  Rows rows = prepare(
      database,
      "WITH RECURSIVE way (number, version, back, step) AS (SELECT * FROM (SELECT number, version, "
      "back, 1 FROM activations WHERE cell = $1 ORDER BY number DESC LIMIT 1) AS present UNION ALL "
      "SELECT a.number, a.version, a.back, step + 1 FROM way JOIN activations AS a ON a.number = "
      "way.back WHERE step < $2) SELECT number, version, back FROM way",
      cell, static_cast<std::int64_t>(most));
  while (auto activation = next_activation(rows)) way.push_back(*activation);
}

/// The activations that repeated rollbacks restore, the next one first.
Result<std::vector<Activation>> activations_before(Database& database, const std::string& cell) {
  std::vector<Activation> way;
  add_way_back(database, cell, kWholeWay, way);
  if (way.empty())
    return failure(ErrorCode::kNotFound, "cell {} has no model in force", cell)
        .of("cell")
        .with_text(cell);
  if (way.size() == 1) {
    return failure(ErrorCode::kNotFound, "cell {}: no model was in force before version {}", cell,
                   way.front().version)
        .of("version")
        .with_value(way.front().version);
  }
  way.erase(way.begin());
  return way;
}

void insert_activation(Database& database, const std::string& cell, int version,
                       const std::optional<std::int64_t>& back,
                       const std::optional<std::int64_t>& number = std::nullopt) {
  if (!number) {
    change(database,
           "INSERT INTO activations (cell, version, back, activated_at) VALUES ($1, $2, $3, $4)",
           cell, version, back, unix_now());
    return;
  }
  change(database,
         "INSERT INTO activations (cell, version, back, activated_at, number) VALUES ($1, $2, $3, "
         "$4, $5)",
         cell, version, back, unix_now(), *number);
}

/// Releases the batches from quarantine that the job of this version may release.
void release_batches_of(Database& database, const std::string& cell, int version,
                        const ChangeId& by) {
  auto rows = prepare(
      database,
      "SELECT id, quarantine FROM batches WHERE cell = $1 AND quarantine <> '' AND id IN (SELECT "
      "batch FROM job_releases JOIN jobs ON jobs.id = job_releases.job WHERE jobs.cell = $1 AND "
      "jobs.model_version = $2) AND id NOT IN (SELECT batch FROM discarded WHERE cell = $1)",
      cell, version);
  std::vector<std::pair<std::string, std::string>> kept_out;
  while (rows.next()) kept_out.emplace_back(rows.text(0), rows.text(1));
  for (const auto& [id, why] : kept_out) {
    change(database, "UPDATE batches SET quarantine = '' WHERE cell = $1 AND id = $2", cell, id);
    record_audit(database,
                 {cell, "release", "batch " + id, "in quarantine: " + why, "free",
                  fmt::format("version {} was made from it", version)},
                 by);
  }
}

std::string spoken(const std::optional<Activation>& activation) {
  return activation ? fmt::format("version {}", activation->version) : "none";
}

void record_figures(Database& database, std::int64_t activation, const JobOutcome& judged) {
  change(database,
         "INSERT INTO activation_figures (number, before_m, after_m, limit_m, why) VALUES ($1, $2, "
         "$3, $4, $5)",
         activation, judged.before, judged.after, judged.limit, judged.why);
}

/// Adds the verdict on the version of this activation: from the activation, or from the job that
/// made it.
void add_judgement(Database& database, const std::string& cell, const Activation& activation,
                   InForceRecord& record) {
  constexpr const char* kFigures =
      "SELECT before_m, after_m, limit_m, why, 0 FROM activation_figures WHERE number = $1 UNION "
      "ALL SELECT before_m, after_m, limit_m, why, 1 FROM job_outcomes JOIN jobs ON jobs.id = "
      "job_outcomes.job WHERE cell = $2 AND model_version = $3 ORDER BY 5 LIMIT 1";
  auto row = prepare(database, kFigures, activation.number, cell, activation.version);
  if (!row.next()) return;
  JobOutcome& judged = record.judged.emplace();
  judged.verdict = JobVerdict::kInForce;
  judged.before = optional_number(row, 0);
  judged.after = optional_number(row, 1);
  judged.limit = optional_number(row, 2);
  judged.why = row.text(3);
  record.judged_when_made = row.truth(4);
}

/// The reason as the audit trail records it.
std::string reason_of(const ChangeId& by, const std::optional<JobOutcome>& judged) {
  if (!judged || judged->why.empty()) return by.reason;
  return by.reason.empty() ? judged->why : by.reason + "; " + judged->why;
}

/// Puts `version` in force. The new activation remembers the present one. `what`: the kind of the
/// change in the audit trail.
void activate_on_top(Database& database, const std::string& cell, int version, const char* what,
                     const std::string& why, const ChangeId& by) {
  const auto present = present_activation(database, cell);
  if (present && present->version == version) return;
  insert_activation(database, cell, version,
                    present ? std::optional(present->number) : std::nullopt);
  record_audit(database,
               {cell, what, "in force", spoken(present), fmt::format("version {}", version), why},
               by);
}

void insert_model_times(Database& database, const std::string& cell, int version,
                        const ModelProvenance& provenance) {
  change(database,
         "INSERT INTO model_times (cell, version, trained_at, measured_at) VALUES ($1, $2, $3, $4)",
         cell, version, provenance.trained_at, provenance.measured_at);
}

void insert_model(Database& database, const std::string& cell, int version,
                  const CompensatedModel& model, const std::string& content) {
  const ModelProvenance& from = model.provenance();
  const auto& validation = model.parts().validation;
  change(
      database,
      "INSERT INTO models (cell, version, id, hash, level, batch_id, created_at, training_poses, "
      "validation_rms, content) VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10)",
      cell, version, from.id, from.hash, from.level, from.batch_id, unix_now(), from.training_poses,
      validation && validation->poses > 0 ? validation->compensated.rms : 0.0, content);
  insert_model_times(database, cell, version, from);
}

Result<int> version_of(const Result<ChangeOutcome>& outcome) {
  return outcome.map([](const ChangeOutcome& made) { return made.version; });
}

Result<CompensatedModel> model_in(const ServedCopies::Copy& copy) {
  const auto text = TRY(read_text_file(copy.file));
  return deserialize(text, copy.file, ModelTexts::kAsTheyAre);
}

}  // namespace

Result<int> Store::add_model(const std::string& cell, const NewModel& added, std::int64_t job,
                             bool put_in_force, const std::string& message, bool release,
                             const ChangeId& change_id, const JobOutcome& outcome) {
  const CompensatedModel& model = added.model;
  const std::string content = added.text.empty() ? serialize(model) : added.text;
  const auto insert = [&](Database& database) -> Result<ChangeOutcome> {
    const auto next = TRY(next_version(database, cell));
    const int version = next;
    insert_model(database, cell, version, model, content);
    record_audit(database,
                 {cell, job == 0 ? "import" : "model", fmt::format("version {}", version), "",
                  fmt::format("sha256 {}{}", model.provenance().hash,
                              job == 0 ? "" : fmt::format(", of job {}", job)),
                  message},
                 change_id);
    if (job != 0) {
      TRY(end_job(database, connection_->worker, job, cell, version, message, outcome));
    }
    if (put_in_force || release) release_batches_of(database, cell, version, change_id);
    if (put_in_force) activate_on_top(database, cell, version, "put in force", message, change_id);
    return ChangeOutcome{version};
  };
  const auto stored = connection_->in_transaction([&](Database& database) {
    return once(database, cell, change_id, [&] { return insert(database); });
  });
  if (stored && put_in_force) copy_after_change(cell);
  return version_of(stored);
}

Status Store::activate(const std::string& cell, int version, const ChangeId& change_id,
                       const std::optional<JobOutcome>& judged) {
  const auto activate_in = [&](Database& database) -> Result<ChangeOutcome> {
    if (!exists(database, "SELECT 1 FROM models WHERE cell = $1 AND version = $2", cell, version)) {
      return failure(ErrorCode::kNotFound, "cell {} has no model version {}", cell, version)
          .of("version")
          .with_value(version);
    }
    if (is_pruned(database, "version", cell, std::to_string(version)))
      return pruned_failure(fmt::format("version {} of cell {}", version, cell))
          .of("version")
          .with_value(version);
    release_batches_of(database, cell, version, change_id);
    const auto before = present_activation(database, cell);
    activate_on_top(database, cell, version, "activate", reason_of(change_id, judged), change_id);
    const auto now = present_activation(database, cell);
    if (judged && now && (!before || now->number != before->number))
      record_figures(database, now->number, *judged);
    return ChangeOutcome{version};
  };
  const auto activated = connection_->in_transaction([&](Database& database) {
    return once(database, cell, change_id, [&] { return activate_in(database); });
  });
  if (activated) copy_after_change(cell);
  return activated.map([](const ChangeOutcome&) {});
}

Result<std::optional<InForceRecord>> Store::in_force_record(const std::string& cell) const {
  return connection_->exclusively([&](Database& database) -> Result<std::optional<InForceRecord>> {
    const auto present = present_activation(database, cell);
    if (!present) return std::optional<InForceRecord>();
    auto since = prepare(database, "SELECT activated_at FROM activations WHERE number = $1",
                         present->number);
    since.next();
    InForceRecord record;
    record.version = present->version;
    record.since = since.integer64(0);
    if (present->back) {
      record.before =
          activation_of(prepare(database,
                                "SELECT number, version, back FROM activations WHERE number = $1",
                                *present->back))
              ->version;
    }
    add_judgement(database, cell, *present, record);
    return std::optional(std::move(record));
  });
}

Result<std::vector<int>> Store::previous_in_force(const std::string& cell) const {
  return connection_->exclusively([&](Database& database) {
    return activations_before(database, cell).map([](const std::vector<Activation>& before) {
      std::vector<int> versions;
      for (const Activation& activation : before) versions.push_back(activation.version);
      return versions;
    });
  });
}

Result<int> Store::rollback(const std::string& cell, int steps, const ChangeId& change_id) {
  const auto go_back = [&](Database& database) -> Result<ChangeOutcome> {
    const auto before = TRY(activations_before(database, cell));
    if (steps < 1 || static_cast<std::size_t>(steps) > before.size()) {
      return failure(ErrorCode::kNotFound, "cell {}: {} versions to go back to, not {}", cell,
                     before.size(), steps)
          .of("steps")
          .beyond(steps, steps < 1 ? 1 : before.size());
    }
    const Activation& wanted = before[static_cast<std::size_t>(steps - 1)];
    const auto present = present_activation(database, cell);
    insert_activation(database, cell, wanted.version, wanted.back);
    record_audit(
        database,
        {cell, "rollback", "in force", spoken(present), fmt::format("version {}", wanted.version)},
        change_id);
    return ChangeOutcome{wanted.version};
  };
  const auto restored = connection_->in_transaction([&](Database& database) {
    return once(database, cell, change_id, [&] { return go_back(database); });
  });
  if (restored) copy_after_change(cell);
  return version_of(restored);
}

Result<std::vector<StoredModel>> Store::models(const std::string& cell) const {
  return connection_->exclusively([&](Database& database) -> Result<std::vector<StoredModel>> {
    const auto present = present_activation(database, cell);
    auto rows =
        prepare(database,
                "SELECT version, id, hash, level, batch_id, created_at, training_poses, "
                "validation_rms, COALESCE(trained_at, created_at), measured_at FROM models LEFT "
                "JOIN model_times USING (cell, version) WHERE cell = $1 ORDER BY version",
                cell);
    std::vector<StoredModel> models;
    while (rows.next()) {
      StoredModel model;
      model.cell = cell;
      model.version = rows.integer(0);
      model.id = rows.text(1);
      model.hash = rows.text(2);
      model.level = rows.text(3);
      model.batch_id = rows.text(4);
      model.created_at = rows.integer64(5);
      model.training_poses = rows.integer(6);
      model.validation_rms = rows.number(7);
      model.in_force = present && present->version == model.version;
      model.trained_at = rows.integer64(8);
      model.measured_at = optional_integer(rows, 9);
      models.push_back(std::move(model));
    }
    return models;
  });
}

Result<std::string> Store::model_text(const std::string& cell, int version) const {
  return connection_->exclusively([&](Database& database) -> Result<std::string> {
    auto row = prepare(database, "SELECT content FROM models WHERE cell = $1 AND version = $2",
                       cell, version);
    if (!row.next())
      return failure(ErrorCode::kNotFound, "cell {} has no model version {}", cell, version)
          .of("version")
          .with_value(version);
    if (is_pruned(database, "version", cell, std::to_string(version)))
      return pruned_failure(fmt::format("version {} of cell {}", version, cell))
          .of("version")
          .with_value(version);
    return row.text(0);
  });
}

Result<ReadModel> Store::read(const std::string& cell, int version) const {
  ModelOnDisk on_disk{cell, version, model_text(cell, version), "",
                      connection_->copies->files_of(cell, version)};
  const auto hash = connection_->exclusively([&](Database& database) -> Result<std::string> {
    auto row = prepare(database, "SELECT hash FROM models WHERE cell = $1 AND version = $2", cell,
                       version);
    return row.next() ? row.text(0) : std::string();
  });
  if (hash) on_disk.hash = *hash;
  auto model =
      read_model(on_disk, fmt::format("{}: model {}@{}", connection_->path, cell, version));
  if (model && !model->damage.empty()) connection_->note_damage(model->damage);
  return model;
}

Result<CompensatedModel> Store::model(const std::string& cell, int version) const {
  auto read_one = TRY(read(cell, version));
  return std::move(read_one.model);
}

Result<std::optional<int>> Store::version_in_force(const std::string& cell) const {
  return connection_->exclusively([&](Database& database) -> Result<std::optional<int>> {
    const auto present = present_activation(database, cell);
    return present ? std::optional(present->version) : std::nullopt;
  });
}

Result<std::map<std::string, int>> Store::versions_in_force() const {
  return connection_->exclusively([](Database& database) -> Result<std::map<std::string, int>> {
    // A look into the index for each cell, and not the whole history.
    Rows rows = prepare(database,
                        "SELECT cell, (SELECT version FROM activations WHERE activations.cell = "
                        "cells.cell ORDER BY number DESC LIMIT 1) FROM cells");
    std::map<std::string, int> versions;
    while (rows.next()) {
      if (!rows.is_null(1)) versions[rows.text(0)] = rows.integer(1);
    }
    return versions;
  });
}

void Store::copy_after_change(const std::string& cell) const {
  // The change is stored: a copy that fails only makes the next fault worse.
  if (const Status copied = copy_model_in_force(cell); !copied)
    connection_->note_damage(
        fmt::format("cell {}: the model in force has no copy: {}", cell, sentence(copied.error())));
}

Status Store::copy_model_in_force(const std::string& cell) const {
  struct Present {
    Activation activation;
    std::string content;
  };
  const auto copies = connection_->copies->of(cell);
  const auto present =
      TRY(connection_->exclusively([&](Database& database) -> Result<std::optional<Present>> {
        const auto now = present_activation(database, cell);
        const std::int64_t copied = copies.empty() ? 0 : copies.front().activation;
        const bool is_copied =
            now && (connection_->is_shared() ? copied == now->number : copied >= now->number);
        if (!now || is_copied) return std::nullopt;
        auto row = prepare(database, "SELECT content FROM models WHERE cell = $1 AND version = $2",
                           cell, now->version);
        if (!row.next()) return std::nullopt;
        return Present{*now, row.text(0)};
      }));
  if (!present) return {};
  const Activation& now = present->activation;
  if (connection_->is_shared()) connection_->copies->forget_after(cell, now.number);
  return connection_->copies->keep(cell, now.number, now.version, present->content);
}

std::vector<int> Store::versions_to_serve(const std::string& cell) const {
  const auto copies = connection_->copies->of(cell);
  std::vector<Activation> known;
  const Status read = connection_->exclusively([&](Database& database) -> Status {
    known.clear();  // the source may be asked again
    add_way_back(database, cell, kMostToServe, known);
    return {};
  });
  if (!read)
    connection_->note_damage(fmt::format("cell {}: its history: {}", cell, sentence(read.error())));
  const std::int64_t newest = known.empty() ? 0 : known.front().number;
  std::vector<int> versions;
  const auto add = [&versions](int version) {
    if (std::find(versions.begin(), versions.end(), version) == versions.end())
      versions.push_back(version);
  };
  for (const ServedCopies::Copy& copy : copies) {
    if (copy.activation > newest && !connection_->is_shared()) add(copy.version);
  }
  for (const Activation& activation : known) add(activation.version);
  for (const ServedCopies::Copy& copy : copies) add(copy.version);
  return versions;
}

Status Store::take_back_from_copy(const std::string& cell) {
  const auto copies = connection_->copies->of(cell);
  if (connection_->is_shared() || copies.empty() || connection_->state().why_not_written) return {};
  const ServedCopies::Copy& newest = copies.front();
  const auto lost = TRY(connection_->exclusively([&](Database& database) -> Result<bool> {
    const auto present = present_activation(database, cell);
    return !present || present->number < newest.activation;
  }));
  if (!lost) return {};
  const auto model = TRY(model_in(newest));
  const Status taken = connection_->in_transaction([&](Database& database) -> Status {
    auto there = prepare(database, "SELECT hash FROM models WHERE cell = $1 AND version = $2", cell,
                         newest.version);
    if (!there.next()) {
      count_version(database, cell, newest.version);
      insert_model(database, cell, newest.version, model, serialize(model));
    } else if (there.text(0) != model.provenance().hash) {
      return failure(ErrorCode::kConflict, "cell {}: version {} is another one than was in force",
                     cell, newest.version)
          .in(newest.file);
    }
    const auto present = present_activation(database, cell);
    insert_activation(database, cell, newest.version,
                      present ? std::optional(present->number) : std::nullopt, newest.activation);
    record_audit(database, {cell, "take back", "in force", spoken(present),
                            fmt::format("version {}", newest.version),
                            "from its copy: the store had lost it"});
    return {};
  });
  if (taken)
    connection_->note_damage(
        fmt::format("{}: what put version {} of cell {} in force was lost; taken back from {}",
                    connection_->path, newest.version, cell, newest.file));
  return taken;
}

}  // namespace trammel
