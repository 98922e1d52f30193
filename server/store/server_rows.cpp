#include "server/store/server_rows.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <utility>

#include "server/store/audit_rows.h"
#include "server/store/connection.h"
#include "server/store/statements.h"
#include "server/store/store.h"

// The servers that are there, by their heartbeats.

namespace trammel {
namespace {

constexpr std::int64_t kForgottenAfter = 86'400;  // s without a word

/// `{"cell-7": [3, "5f..", "a0..", "", false]}`.
std::string spelled(const std::map<std::string, CellAtServer>& cells) {
  nlohmann::json json = nlohmann::json::object();
  for (const auto& [cell, at] : cells)
    json[cell] = {at.version, at.files.cell, at.files.robot, at.why_not, at.is_apart};
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

/// The cells in a server's text; entries in another program's form are left out.
std::map<std::string, CellAtServer> cells_spelled(const std::string& text) {
  std::map<std::string, CellAtServer> cells;
  const auto json = nlohmann::json::parse(text, nullptr, false);
  if (!json.is_object()) return cells;
  for (const auto& [cell, at] : json.items()) {
    const bool fits = at.is_array() && at.size() >= 4 && at[0].is_number_integer() &&
                      at[1].is_string() && at[2].is_string() && at[3].is_string();
    if (!fits) continue;
    cells[cell] = {at[0].get<int>(),
                   {at[1].get<std::string>(), at[2].get<std::string>()},
                   at[3].get<std::string>()};
    cells[cell].is_apart = at.size() > 4 && at[4].is_boolean() && at[4].get<bool>();
  }
  return cells;
}

/// Ends the leases of earlier starts on the same host: they are dead, and their jobs should not
/// wait. If one is alive after all, it can store nothing of a job that another server has taken.
void end_leases_of_starts_before(Database& database, const std::string& token,
                                 const ServerSelf& self) {
  const int ended = change(database,
                           "UPDATE job_claims SET lease_until = 0 WHERE job IN (SELECT id FROM "
                           "jobs WHERE state = 'running') AND token IN (SELECT token FROM servers "
                           "WHERE server = $1 AND host = $2 AND token <> $3)",
                           self.server, self.host, token);
  if (ended > 0) tell_others(database);
}

/// Writes the whole row, and removes the row of an earlier start on the same host.
void write_row(Database& database, const std::string& token, const ServerSelf& self,
               const std::string& cells) {
  const std::int64_t now = now_of(database);
  change(database,
         "DELETE FROM servers WHERE (server = $1 AND host = $2 AND token <> $3) OR heard_at < $4",
         self.server, self.host, token, now - kForgottenAfter);
  change(database,
         "INSERT INTO servers (token, server, host, pid, program, since, heard_at, serves, trains, "
         "followed, cells_json) VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11) ON CONFLICT "
         "(token) DO UPDATE SET heard_at = excluded.heard_at, followed = excluded.followed, "
         "cells_json = excluded.cells_json",
         token, self.server, self.host, self.pid, self.program, now, now, self.serves ? 1 : 0,
         self.trains ? 1 : 0, self.followed, cells);
}

ServerInRecord row_of(const Rows& row, std::int64_t now, std::int64_t changes) {
  ServerInRecord one;
  one.self = {row.text(1),
              row.text(2),
              row.integer64(3),
              row.text(4),
              row.truth(7),
              row.truth(8),
              cells_spelled(row.text(10)),
              row.integer64(9)};
  one.since = row.integer64(5);
  one.heard_at = row.integer64(6);
  one.silent_s = std::max<std::int64_t>(now - one.heard_at, 0);
  one.is_gone = one.silent_s > kGoneAfter.count();
  one.behind = std::max<std::int64_t>(changes - one.self.followed, 0);
  return one;
}

}  // namespace

ServerSelf ServerSelf::here(std::string program, bool serves, bool trains) {
  std::array<char, 256> name{};
  if (::gethostname(name.data(), name.size() - 1) != 0) name = {};
  return {"", name.data(), ::getpid(), std::move(program), serves, trains, {}, 0};
}

std::vector<ServerInRecord> server_rows(Database& database, bool with_cells,
                                        const std::string& but) {
  const std::int64_t now = now_of(database), changes = audit_rows(database);
  std::map<std::string, std::vector<JobAtServer>> jobs;  // by token
  auto claims =
      prepare(database,
              "SELECT token, jobs.id, cell FROM job_claims JOIN jobs ON jobs.id = job_claims.job "
              "WHERE state = 'running' AND lease_until > $1 ORDER BY jobs.id",
              now);
  while (claims.next()) jobs[claims.text(0)].push_back({claims.integer64(1), claims.text(2)});
  const std::string wanted = fmt::format(
      "SELECT token, server, host, pid, program, since, heard_at, serves, trains, followed, {} "
      "FROM servers WHERE token <> $1 ORDER BY server, host, since",
      with_cells ? "cells_json" : "'{}'");
  std::vector<ServerInRecord> servers;
  auto rows = prepare(database, wanted.c_str(), but);
  while (rows.next()) {
    servers.push_back(row_of(rows, now, changes));
    servers.back().works_on = jobs[rows.text(0)];
  }
  return servers;
}

Status Store::tell_presence(const ServerSelf& self) {
  if (!is_shared()) return {};
  const std::string cells = spelled(self.cells), token = connection_->worker.token;
  ServerSelf named = self;
  named.server = connection_->worker.server;
  const Status told = connection_->urgently([&](Database& database) -> Status {
    const std::string is_there =
        fmt::format("UPDATE servers SET heard_at = {}, followed = $1 WHERE token = $2 RETURNING {}",
                    now_in(database), unwaited_for(database));
    if (cells == connection_->told_cells &&
        exists(database, is_there.c_str(), named.followed, token))
      return {};
    if (!connection_->has_told) end_leases_of_starts_before(database, token, named);
    write_row(database, token, named, cells);
    return {};
  });
  connection_->told_cells = told ? cells : "";
  connection_->has_told = connection_->has_told || told;
  return told;
}

Status Store::take_leave() {
  if (!is_shared()) return {};
  return connection_->urgently([&](Database& database) -> Status {
    change(database, "DELETE FROM servers WHERE token = $1", connection_->worker.token);
    return {};
  });
}

Result<std::vector<ServerInRecord>> Store::servers(bool with_cells) const {
  if (!is_shared()) return std::vector<ServerInRecord>();
  return connection_->exclusively([&](Database& database) -> Result<std::vector<ServerInRecord>> {
    return server_rows(database, with_cells);
  });
}

}  // namespace trammel
