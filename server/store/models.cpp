#include <utility>

#include "server/base/unix_time.h"
#include "server/compensate/model_file.h"
#include "server/store/changes.h"
#include "server/store/connection.h"
#include "server/store/job_rows.h"
#include "server/store/store.h"

// Models, and the history of which was in force.

namespace trammel {
namespace {

/// A row of the cell's history of models in force.
struct Activation {
  std::int64_t number = 0;
  int version = 0;
  std::optional<std::int64_t> back;
};

std::optional<Activation> activation_of(SQLite::Statement row) {
  if (!row.executeStep()) return std::nullopt;
  Activation activation{row.getColumn(0).getInt64(), row.getColumn(1).getInt(), std::nullopt};
  if (!row.isColumnNull(2)) activation.back = row.getColumn(2).getInt64();
  return activation;
}

std::optional<Activation> present_activation(SQLite::Database& database, const std::string& cell) {
  return activation_of(prepare(
      database, "SELECT number, version, back FROM activations WHERE cell = ? ORDER BY number DESC LIMIT 1", cell));
}

/// The activations that repeated rollbacks restore, the next one first.
Result<std::vector<Activation>> activations_before(SQLite::Database& database, const std::string& cell) {
  const auto present = present_activation(database, cell);
  if (!present) return failure(ErrorCode::kNotFound, "cell {} has no model in force", cell).of("cell").with_text(cell);
  if (!present->back) {
    return failure(ErrorCode::kNotFound, "cell {}: no model was in force before version {}", cell, present->version)
        .of("version")
        .with_value(present->version);
  }
  std::vector<Activation> before;
  for (auto back = present->back; back; back = before.back().back) {
    before.push_back(
        activation_of(prepare(database, "SELECT number, version, back FROM activations WHERE number = ?", *back))
            .value());
  }
  return before;
}

void insert_activation(SQLite::Database& database, const std::string& cell, int version,
                       const std::optional<std::int64_t>& back) {
  SQLite::Statement row(database, "INSERT INTO activations (cell, version, back, activated_at) VALUES (?, ?, ?, ?)");
  row.bind(1, cell);
  row.bind(2, version);
  if (back) row.bind(3, *back);  // unbound is NULL
  row.bind(4, unix_now());
  row.exec();
}

/// Releases from quarantine the batches that the job of this version may release.
void release_batches_of(SQLite::Database& database, const std::string& cell, int version) {
  change(database,
         "UPDATE batches SET quarantine = '' WHERE cell = ? AND id IN (SELECT batch FROM job_releases JOIN jobs "
         "ON jobs.id = job_releases.job WHERE jobs.cell = ? AND jobs.model_version = ?)",
         cell, cell, version);
}

/// Puts `version` in force. The new activation remembers the present one.
void activate_on_top(SQLite::Database& database, const std::string& cell, int version) {
  const auto present = present_activation(database, cell);
  if (present && present->version == version) return;
  insert_activation(database, cell, version, present ? std::optional(present->number) : std::nullopt);
}

void insert_model_times(SQLite::Database& database, const std::string& cell, int version,
                        const ModelProvenance& provenance) {
  SQLite::Statement row(database,
                        "INSERT INTO model_times (cell, version, trained_at, measured_at) VALUES (?, ?, ?, ?)");
  row.bind(1, cell);
  row.bind(2, version);
  row.bind(3, provenance.trained_at);
  if (provenance.measured_at) row.bind(4, *provenance.measured_at);  // unbound is NULL
  row.exec();
}

Result<int> version_of(const Result<ChangeOutcome>& outcome) {
  return outcome.map([](const ChangeOutcome& made) { return made.version; });
}

int next_version(SQLite::Database& database, const std::string& cell) {
  auto row = prepare(database, "SELECT COALESCE(MAX(version), 0) + 1 FROM models WHERE cell = ?", cell);
  row.executeStep();
  return row.getColumn(0).getInt();
}

}  // namespace

Result<int> Store::add_model(const std::string& cell, const CompensatedModel& model, std::int64_t job,
                             bool put_in_force, const std::string& message, bool release, const ChangeId& change_id,
                             const JobOutcome& outcome) {
  const std::string content = serialize(model);
  const ModelProvenance& from = model.provenance();
  const auto& validation = model.parts().validation;
  const auto insert = [&](SQLite::Database& database) -> Result<ChangeOutcome> {
    const int version = next_version(database, cell);
    change(database,
           "INSERT INTO models (cell, version, id, hash, level, batch_id, created_at, training_poses, validation_rms, "
           "content) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
           cell, version, from.id, from.hash, from.level, from.batch_id, unix_now(), from.training_poses,
           validation ? validation->compensated.rms : 0.0, content);
    insert_model_times(database, cell, version, from);
    if (job != 0) {
      if (auto ended = end_job(database, job, cell, version, message, outcome); !ended)
        return tl::make_unexpected(ended.error());
    }
    if (put_in_force || release) release_batches_of(database, cell, version);
    if (put_in_force) activate_on_top(database, cell, version);
    return ChangeOutcome{version};
  };
  return version_of(connection_->in_transaction(
      [&](SQLite::Database& database) { return once(database, change_id, [&] { return insert(database); }); }));
}

Status Store::activate(const std::string& cell, int version, const ChangeId& change_id) {
  const auto activate_in = [&](SQLite::Database& database) -> Result<ChangeOutcome> {
    if (!prepare(database, "SELECT 1 FROM models WHERE cell = ? AND version = ?", cell, version).executeStep()) {
      return failure(ErrorCode::kNotFound, "cell {} has no model version {}", cell, version)
          .of("version")
          .with_value(version);
    }
    release_batches_of(database, cell, version);
    activate_on_top(database, cell, version);
    return ChangeOutcome{version};
  };
  const auto activated = connection_->in_transaction(
      [&](SQLite::Database& database) { return once(database, change_id, [&] { return activate_in(database); }); });
  return activated.map([](const ChangeOutcome&) {});
}

Result<std::vector<int>> Store::previous_in_force(const std::string& cell) const {
  return connection_->exclusively([&](SQLite::Database& database) {
    return activations_before(database, cell).map([](const std::vector<Activation>& before) {
      std::vector<int> versions;
      for (const Activation& activation : before) versions.push_back(activation.version);
      return versions;
    });
  });
}

Result<int> Store::rollback(const std::string& cell, int steps, const ChangeId& change_id) {
  const auto go_back = [&](SQLite::Database& database) -> Result<ChangeOutcome> {
    const auto before = activations_before(database, cell);
    if (!before) return tl::make_unexpected(before.error());
    if (steps < 1 || static_cast<std::size_t>(steps) > before->size()) {
      return failure(ErrorCode::kNotFound, "cell {}: {} versions to go back to, not {}", cell, before->size(), steps)
          .of("steps")
          .beyond(steps, steps < 1 ? 1 : before->size());
    }
    const Activation& wanted = (*before)[static_cast<std::size_t>(steps - 1)];
    insert_activation(database, cell, wanted.version, wanted.back);
    return ChangeOutcome{wanted.version};
  };
  return version_of(connection_->in_transaction(
      [&](SQLite::Database& database) { return once(database, change_id, [&] { return go_back(database); }); }));
}

Result<std::vector<StoredModel>> Store::models(const std::string& cell) const {
  return connection_->exclusively([&](SQLite::Database& database) -> Result<std::vector<StoredModel>> {
    const auto present = present_activation(database, cell);
    auto rows = prepare(database,
                        "SELECT version, id, hash, level, batch_id, created_at, training_poses, validation_rms, "
                        "COALESCE(trained_at, created_at), measured_at "
                        "FROM models LEFT JOIN model_times USING (cell, version) WHERE cell = ? ORDER BY version",
                        cell);
    std::vector<StoredModel> models;
    while (rows.executeStep()) {
      StoredModel model;
      model.cell = cell;
      model.version = rows.getColumn(0).getInt();
      model.id = rows.getColumn(1).getString();
      model.hash = rows.getColumn(2).getString();
      model.level = rows.getColumn(3).getString();
      model.batch_id = rows.getColumn(4).getString();
      model.created_at = rows.getColumn(5).getInt64();
      model.training_poses = rows.getColumn(6).getInt();
      model.validation_rms = rows.getColumn(7).getDouble();
      model.in_force = present && present->version == model.version;
      model.trained_at = rows.getColumn(8).getInt64();
      model.measured_at = optional_integer(rows, 9);
      models.push_back(std::move(model));
    }
    return models;
  });
}

Result<CompensatedModel> Store::model(const std::string& cell, int version) const {
  const auto content = connection_->exclusively([&](SQLite::Database& database) -> Result<std::string> {
    auto row = prepare(database, "SELECT content FROM models WHERE cell = ? AND version = ?", cell, version);
    if (!row.executeStep())
      return failure(ErrorCode::kNotFound, "cell {} has no model version {}", cell, version)
          .of("version")
          .with_value(version);
    return row.getColumn(0).getString();
  });
  if (!content) return tl::make_unexpected(content.error());
  return deserialize(*content, fmt::format("{}: model {}@{}", connection_->path, cell, version));
}

Result<std::optional<int>> Store::version_in_force(const std::string& cell) const {
  return connection_->exclusively([&](SQLite::Database& database) -> Result<std::optional<int>> {
    const auto present = present_activation(database, cell);
    return present ? std::optional(present->version) : std::nullopt;
  });
}

}  // namespace trammel
