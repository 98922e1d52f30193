#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "clients/cli/terminal/table.h"
#include "clients/session/session.h"

/// Texts of a service on its servers, models, jobs and batches, for people (dates in UTC) and for
/// programs.
namespace trammel::cli {

[[nodiscard]] nlohmann::ordered_json job_json(const client::JobStatus& job);
[[nodiscard]] nlohmann::ordered_json jobs_json(const std::vector<client::DatedJob>& jobs);
/// A line a job: those that run and wait, of those that are done the last one of each cell, those
/// that failed.
[[nodiscard]] std::string jobs_text(const std::vector<client::DatedJob>& jobs);
/// A row each, with how those that are over ended.
[[nodiscard]] std::string all_jobs_text(const std::vector<client::DatedJob>& jobs,
                                        TableForm form = TableForm::kTable);
/// A job that was begun, and the commands that show how it goes.
[[nodiscard]] std::string started_text(const std::string& cell, std::int64_t job);

[[nodiscard]] nlohmann::ordered_json models_json(const std::vector<exchange::ModelInfo>& models);
[[nodiscard]] std::string models_text(const std::vector<exchange::ModelInfo>& models,
                                      TableForm form = TableForm::kTable);

[[nodiscard]] nlohmann::ordered_json server_json(const client::ServerStatus& server);
[[nodiscard]] std::string server_text(const client::ServerStatus& server);

/// Adds to `servers`, which answered, those of the record that do not: they train only, or are gone
/// (`reachable` false). `of_record`: as servers_text() takes them.
void add_other_servers(const nlohmann::ordered_json& of_record, nlohmann::ordered_json& servers);

/// The text of `record` as a server says it; empty where that is a file beside the server.
[[nodiscard]] std::string record_text(const nlohmann::ordered_json& record);

/// The servers of the record as one of them tells; null: it cannot say. Empty where the record is a
/// file.
[[nodiscard]] std::string servers_text(const nlohmann::ordered_json& servers,
                                       const nlohmann::ordered_json& record);

[[nodiscard]] nlohmann::ordered_json quarantine_json(
    const std::vector<client::BatchOfService>& batches);
[[nodiscard]] std::string quarantine_text(const std::vector<client::BatchOfService>& batches);

[[nodiscard]] nlohmann::ordered_json batches_json(
    const std::vector<client::BatchOfService>& batches);
/// A row a batch, with the server that says it where there are several.
[[nodiscard]] std::string batches_text(const std::vector<client::BatchOfService>& batches,
                                       TableForm form = TableForm::kTable);

/// A version that was put in force: before, after, limit, why, and what to do next, as far as the
/// service says so. `said`: its `in_force` of the cell (READ_HEALTH), from outside; null: nothing.
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
