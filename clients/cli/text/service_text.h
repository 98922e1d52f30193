#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "clients/cli/terminal/table.h"
#include "clients/session/session.h"
#include "server/report/history_json.h"

/// Texts of a service on its servers, models, jobs and batches, for people (dates in UTC) and for
/// programs.
namespace trammel::cli {

/// A line per job: those that run and wait, the last done one of each cell, and those that failed.
[[nodiscard]] std::string jobs_text(const std::vector<client::DatedJob>& jobs);
/// One row per job, with the outcome of those that have ended.
[[nodiscard]] std::string all_jobs_text(const std::vector<client::DatedJob>& jobs,
                                        TableForm form = TableForm::kTable);
/// A job that has begun, and the commands that show its progress.
[[nodiscard]] std::string started_text(const std::string& cell, std::int64_t job);

[[nodiscard]] std::string models_text(const std::vector<exchange::ModelInfo>& models,
                                      TableForm form = TableForm::kTable);

[[nodiscard]] nlohmann::ordered_json server_json(const client::ServerStatus& server);
[[nodiscard]] std::string server_text(const client::ServerStatus& server);

/// Adds to `servers`, which answered, those of the record that do not: they train only, or are gone
/// (`reachable` false). `of_record`: as servers_text() takes them.
void add_other_servers(const nlohmann::ordered_json& of_record, nlohmann::ordered_json& servers);

/// The text of a server's `record`; empty if that is a file beside the server.
[[nodiscard]] std::string record_text(const nlohmann::ordered_json& record);

/// The servers of the record, as one of them lists them; null: it cannot tell. Empty if the record
/// is a file.
[[nodiscard]] std::string servers_text(const nlohmann::ordered_json& servers,
                                       const nlohmann::ordered_json& record);

[[nodiscard]] nlohmann::ordered_json quarantine_json(
    const std::vector<client::BatchOfService>& batches);
[[nodiscard]] std::string quarantine_text(const std::vector<client::BatchOfService>& batches);

[[nodiscard]] nlohmann::ordered_json batches_json(
    const std::vector<client::BatchOfService>& batches);
/// One row per batch, with the server that states it if there are several.
[[nodiscard]] std::string batches_text(const std::vector<client::BatchOfService>& batches,
                                       TableForm form = TableForm::kTable);

/// A version that was put in force: before, after, limit, reason and next step, as far as the
/// service states them. `said`: the member `in_force` in the answer to READ_HEALTH, unchecked; null
/// if there is none.
[[nodiscard]] nlohmann::ordered_json in_force_json(const std::string& cell, int version,
                                                   const nlohmann::ordered_json& said);
/// The text for people.
[[nodiscard]] std::string in_force_text(const nlohmann::ordered_json& now);

/// True if the job put the model that it made in force, whatever is in force now.
[[nodiscard]] bool put_in_force(const client::JobStatus& job);
/// The end of a job that did not fail.
[[nodiscard]] std::string ended_text(const client::JobStatus& job);
/// The next step where a job did not put a model in force, by its verdict; empty where there is
/// nothing.
[[nodiscard]] std::string next_step(const client::JobStatus& job);

}  // namespace trammel::cli
